"""What is wrong with the tap, not with the bus."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import sqrt
from statistics import median
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.crc import crc_ok
from dissectors.lengths import Role, pdu_length
from dissectors.limits import OVERHEAD
from dissectors.unnamed import is_of_its_own

from ...deframing.directions import port_role
from ...tables.findings import Severity
from ...tables.taps import TapKind, tap_kind
from ..bits import surplus_bits
from ..evidence import HEALTHY, Evidence
from ..exchanges import Ending
from ..flatmemory import Spell
from ..polls import Poll
from ..registry import Explained, Suspicion, Symptom, suspect
from ..unitledger import AT_ONCE_NS, UnitLedger
from .outages import silent_together

_LEAST: Final = 20  # frames
_REQUEST: Final = 8  # bytes, most of them
_FEW_MARKED: Final = 0.02  # of characters, by which edges that were read at the line's settings may be marked
_SOME_MARKED: Final = 0.2  # of the bytes: by a wrong parity all are, by a parity that is not awaited half of them
_FRAMES: Final = 10  # by which a wrong direction is told: chance makes no right check value so often
_NEARLY_ALL: Final = 0.9
_NOTHING: Final = 0.12  # of the bytes in right frames
_HALF: Final = 0.5  # of them, those of functions that nobody knows among them
_BYTES: Final = 150
_TEXT: Final = 0.7  # of bytes that people can read: no UART set wrongly gives so many
_MOSTLY: Final = 0.5
_COPY_BITS: Final = 64.0  # eight bytes that are just those before
_TIMERS: Final = 0.015  # of a timeout: so far a master's timer strays
_LATE_NS: Final = 500_000  # and as late its task comes to run
_AS_SOON: Final = 0.25  # of the time from request to request
_STEADY: Final = 0.02  # of it: so little it strays where a timer makes it
_CLOCKS: Final = 4.0  # times what the tap's times may be wrong by
_INNER: Final = (0.05, 0.95)  # what a hole in the capture or a rare rest makes is left out
_SOME_MISSED: Final = 0.2  # of the answers
_HARDLY_ANY: Final = 0.03  # of the silent requests
_TURNS: Final = 3
_MOST_UNITS: Final = 0.75
_ANOTHER: Final = 2  # polls
_AGAIN: Final = 0.1  # of the requests: a client that gives up asks again, whoever is silent
_PATIENCE_NS: Final = 75e6  # nobody gives up sooner, on a whole bus
_FEW: Final = 8  # waits of a poll that tell their mean and its error
_ERRORS: Final = 6.0  # times the error of a mean
_SLOPE_ERRORS: Final = 4.0  # times its own, for a slope that is about a character a byte besides


def everything(evidence: Evidence) -> Explained:
    """All symptoms of all units, and of the bus."""
    found = {(kind, unit.unit) for unit in evidence.ledger.units.values() for kind in Symptom}
    return frozenset(found | {(kind, None) for kind in Symptom} | {(Symptom.REQUESTS, 0)})


@suspect(
    "tap-one-direction",
    Severity.WARNING,
    blame="tap",
    text="The tap hears {heard} only: {frames:,} of them[, and {others:,} of the other kind]; the units may be fine",
    share="{frames:,} of {all:,} frames",
    deciding_test="Tap the other pair, or at the other end: the missing half must be there",
    remedy="On four wires tap both pairs; on two wires check that the tap sees both A and B, and that it does not sit "
    "behind "
    "a converter that passes one direction on",
)
def tap_one_direction(evidence: Evidence) -> Iterator[Suspicion]:
    """All frames of one kind."""
    ledger = evidence.ledger
    answered = sum(unit.answered for unit in evidence.units)
    silent = sum(map(evidence.silent, evidence.units))
    asked = sum(unit.asked for unit in evidence.units)
    if evidence.odd > 0.5 * ledger.frames:
        return
    if (
        ledger.loose_responses >= _LEAST
        and ledger.loose_responses >= 0.75 * ledger.frames
        and answered < 0.1 * ledger.frames
    ):
        yield _one(evidence, "answers", ledger.loose_responses, ledger.requests)
    elif (
        ledger.broadcasts < 0.5 * ledger.exchanges
        and asked >= _LEAST
        and silent >= _NEARLY_ALL * asked
        and ledger.responses == sum(unit.echoes + unit.echo_strays for unit in evidence.units)
    ):  # what is asked twice in a row reads like an answer
        seldom = median(
            unit.repeats / unit.asked for unit in evidence.units if unit.asked
        )  # a list may hold some twice
        if len(evidence.ledger.polls) > 1 and seldom <= _AGAIN and not _as_given_up(evidence):
            yield _one(evidence, "requests", ledger.requests, ledger.responses)
    elif _misses_answers(evidence):
        found = _one(evidence, "part of the answers", answered, asked)
        yield replace(found, bits=surplus_bits(silent, asked, HEALTHY) + 8.0 * silent, lost_answers=0)
    elif (since := _fallen_off(evidence)) is not None:
        heard = sum(outage.count for outage in since.values())
        begin = min(outage.begin for outage in since.values())
        yield replace(_one(evidence, "requests", heard, 0, heard), since=begin, lost_answers=0)


def _misses_answers(evidence: Evidence) -> bool:
    """Whether many answers of all units are not heard, though the master takes them: it goes on as soon as behind those
    that are, repeats nothing, and nothing else is heard that a second master or a bad line would make."""
    units = [unit for unit in evidence.units if unit.asked >= _FEW]
    asked, silent = sum(unit.asked for unit in units), sum(map(evidence.silent, units))
    if len(units) < 2 or silent < max(_LEAST, _SOME_MISSED * asked) or silent == asked:
        return False
    odd = sum(evidence.damaged(unit) + unit.late + unit.strays + unit.repeats for unit in units)
    if odd > _HARDLY_ANY * silent or any(evidence.silent(u) * asked < _MOSTLY * silent * u.asked for u in units):
        return False
    told = [unit for unit in units if len(unit.turns) >= _TURNS and len(unit.waits) >= _TURNS]
    soon = sum(_as_soon(unit, evidence.verdict.wait_ns) for unit in told)
    return len(told) >= max(_MOSTLY * len(units), 1) and soon >= _MOST_UNITS * len(told)


def _as_soon(unit: UnitLedger, off_ns: float) -> bool:
    """Whether the master goes on about as soon behind silence as behind answers of a unit, rests left out."""
    turns, waits = (np.clip(each.numbers, 0, np.quantile(each.numbers, 0.8)) for each in (unit.turns, unit.waits))
    turn = float(turns.mean())
    error = 2 * float(np.sqrt(turns.var() / len(turns) + waits.var() / len(waits)))
    return abs(float(waits.mean()) - turn) <= _AS_SOON * turn + min(error, turn / 4) + min(off_ns, turn) / 4


def _fallen_off(evidence: Evidence) -> Mapping[int, Spell] | None:
    """The spells of all units, from when on a tap of two ports hears no answer, though its master does: it goes on as
    soon as before. None where that is not so."""
    units = [unit for unit in evidence.units if unit.answered]
    if len(evidence.ledger.ports) < 2:
        return None
    for group in silent_together(evidence):
        spells = group[-1].spells
        silent = [unit for unit in units if unit.unit in spells and spells[unit.unit].before is None]
        if len(silent) > 1 and len(silent) >= _NEARLY_ALL * len(units) and _go_on(silent):
            return spells
    return None


def _go_on(units: list[UnitLedger]) -> bool:
    """Whether requests behind silence come as soon as those behind answers, of each unit, and not all by one timer."""
    for unit in units:
        wait, turn = unit.waits.quantile(0.5), unit.turns.quantile(0.5)
        if wait is None or turn is None or abs(wait - turn) > _AS_SOON * turn:
            return False
    turns = np.concatenate([unit.turns.numbers for unit in units])
    soon, late = np.quantile(turns, (0.1, 0.9))
    return bool(late - soon > _STEADY * late)


def _one(evidence: Evidence, heard: str, frames: int, others: int, every: int | None = None) -> Suspicion:
    every = evidence.ledger.frames if every is None else every
    numbers = {"heard": heard, "frames": frames, "others": others, "all": every}
    bits = surplus_bits(frames, every, 0.5) + 8.0 * frames
    return Suspicion((), bits, everything(evidence), numbers, evidence.ledger.begin, evidence.ledger.end)


def _as_given_up(evidence: Evidence) -> bool:
    """Whether the master goes on after always the same time, whatever it asks, as it does when nobody answers."""
    found = [(poll, mine) for poll in evidence.polls if len(mine := evidence.waits_in_vain(poll))]
    waits = [mine for _, mine in found]
    if not waits or not evidence.ledger.timed:
        return False
    if _by_length([poll for poll, _ in found], waits, evidence.ledger.char_ns):
        return False
    numbers = np.concatenate(waits)
    low, middle = float(np.quantile(numbers, 0.1)), float(np.quantile(numbers, 0.6))
    if middle < _PATIENCE_NS:
        return False
    strays = _TIMERS * middle + _LATE_NS
    if (alike := _are_alike([each for each in waits if len(each) >= _FEW], strays)) is not None:
        return alike
    return middle - low < strays + min(_CLOCKS * evidence.verdict.wait_ns, _TIMERS * middle + evidence.ledger.char_ns)


def _by_length(polls: Sequence[Poll], by_poll: Sequence[NDArray[np.float64]], char_ns: float) -> bool:
    """Whether the master goes on the later the longer the answer is that it asks for, about a character a byte: answers
    pass then, though the tap hears none. Over all waits, so that a coarse clock tells it as well."""
    due = np.concatenate(
        [np.full(len(mine), float(poll.about_bytes)) for poll, mine in zip(polls, by_poll, strict=True)]
    )
    waits = np.concatenate([np.clip(mine, *np.quantile(mine, _INNER)) for mine in by_poll])
    varied = due - due.mean()
    weight = float(varied @ varied)
    if len(due) <= _LEAST or not weight:
        return False
    slope = float(varied @ waits) / weight
    rest = waits - waits.mean() - slope * varied
    error = float(np.sqrt(rest @ rest / (len(due) - 2) / weight))
    return slope > _SLOPE_ERRORS * error and abs(slope - char_ns) < char_ns * _MOSTLY


def _are_alike(waits: Sequence[NDArray[np.float64]], strays: float) -> bool | None:
    """Whether waits hang on nothing that is asked, however coarse the clock and restless the master; None where too few
    polls tell. Where each is answered in its own time, those of two polls differ from the rest, or of one, which strays
    more than the rest (behind the last poll of a round a master may rest, but by its timer). `strays`: ns by which
    timers stray."""
    if len(waits) <= _ANOTHER:
        return None
    inner = [np.clip(each, *np.quantile(each, _INNER)) for each in waits]
    means, spreads = np.array([each.mean() for each in inner]), np.array([each.var() for each in inner])
    errors = np.sqrt(spreads / [len(each) for each in inner])
    differ = np.abs(means - np.median(means)) > strays + _ERRORS * errors
    one_strays = differ & (spreads - np.median(spreads) > strays**2)
    return bool(np.count_nonzero(differ) < _ANOTHER and not one_strays.any())


@suspect(
    "tap-reversed",
    Severity.WARNING,
    blame="tap",
    text="The two directions of the tap are swapped: {frames:,} frames on ports that are said to carry {said} read as "
    "{read}",
    share="{frames:,} frames",
    deciding_test="Exchange the two in the capture's settings: frames must appear",
    remedy="Exchange the two ports, or their directions in the capture (`directions`)",
)
def tap_reversed(evidence: Evidence) -> Iterator[Suspicion]:
    """Ports that carry the other direction than is said of them."""
    ledger = evidence.ledger
    wrong = right = 0
    said = read = ""
    for port, tally in ledger.ports.items():
        role = port_role(ledger.line, port)
        if role is None:
            continue
        other = Role.RESPONSE if role is Role.REQUEST else Role.REQUEST
        misshapen = tally["misshapen"]  # of the other kind by their length, though said to be of this one
        right += max(tally["requests" if role is Role.REQUEST else "responses"] - misshapen - tally["alike"], 0)
        found = tally["responses" if role is Role.REQUEST else "requests"] + misshapen
        found += _hidden(evidence, port, other)
        if found > wrong / 2:
            said, read = role.name.lower() + "s", other.name.lower() + "s"
        wrong += found
    if wrong >= _FRAMES and wrong > 2 * right:
        numbers = {"frames": wrong, "said": said, "read": read}
        looked_at = sum(len(data) for _, _, data in ledger.noise)
        bits = 16.0 * wrong * max(1.0, ledger.noise_bytes / max(looked_at, 1))
        yield Suspicion((), bits, everything(evidence), numbers, ledger.begin, ledger.end)


def _hidden(evidence: Evidence, port: int, role: Role) -> int:
    """How many frames of a role stand in the noise of a port, as far as it was kept."""
    return sum(_frames_in(data, role) for _, where, data in evidence.ledger.noise if where == port)


def _frames_in(data: bytes, role: Role) -> int:
    """How many frames of a role stand one behind the other from the first one on."""
    count, at = 0, 0
    while at + OVERHEAD < len(data):
        length = pdu_length(data[at + 1 :], role)
        if length is not None and length > 0 and crc_ok(data[at : at + length + OVERHEAD]):
            count, at = count + 1, at + length + OVERHEAD
        else:
            at += 1
    return count


@suspect(
    "local-echo",
    Severity.WARNING,
    blame="tap",
    text="{who} shows what it sends: {echoes:,} of {requests:,} requests[ to {units:unit|units}] come twice, one right after "
    "the other",
    share="{echoes:,} of {requests:,} requests[ to {units:unit|units}]",
    deciding_test="Look for an echo setting of the adapter or its driver; only the adapter's own frames come twice",
    remedy="Switch the adapter's local echo off, or tap the line with a second adapter",
)
def local_echo(evidence: Evidence) -> Iterator[Suspicion]:
    """Each request twice, at once."""
    ledger = evidence.ledger
    shown = sum(unit.count(Ending.ECHO) for unit in evidence.units)  # of units that do not answer, too
    echoed = max(ledger.repeats_answered, shown) if ledger.echoing else 0
    explains: set[tuple[Symptom, int | None]] = {(Symptom.FRAMING, None), (Symptom.TIMING, None)}
    for unit in evidence.units:
        explains.add((Symptom.TIMING, unit.unit))  # its answers are timed from the echo on
        readings = evidence.readings(unit)
        share = sum(reading.echoed for reading in readings) / len(readings) if readings else 0.0
        echoed += round(share * unit.count(Ending.GARBAGE))
        if share > _MOSTLY:
            explains |= {(kind, unit.unit) for kind in Symptom}
    firsts = max(sum(unit.asked for unit in evidence.units), 1)
    if echoed < max(_LEAST / 2, 0.4 * firsts):
        yield from _sent_back(evidence)
        return
    echoed = min(echoed, firsts)  # what an echo and noise share may be counted as both
    numbers = {"who": "The adapter", "units": (), "echoes": echoed, "requests": firsts}
    yield Suspicion((), _COPY_BITS * echoed, frozenset(explains), numbers, ledger.begin, ledger.end)


def _sent_back(evidence: Evidence) -> Iterator[Suspicion]:
    """Requests to some units, and no others, that come once more at once ahead of nearly each answer."""
    off, counts = evidence.verdict.wait_ns, dict[int, int]()
    for unit in evidence.units if evidence.ordered and off < AT_ONCE_NS else ():
        rows = evidence.rows(unit.unit)
        first = (rows.outcome == Ending.SILENT) & rows.next_same & (rows.wait <= AT_ONCE_NS + off) & ~rows.odd
        answered = np.isin(rows.number, rows.number[first] + 1) & (rows.outcome <= Ending.EXCEPTION)
        if np.count_nonzero(answered) >= max(_FEW, _NEARLY_ALL * np.count_nonzero(rows.outcome <= Ending.EXCEPTION)):
            counts[unit.unit] = round(np.count_nonzero(answered) * evidence.ledger.table.weight)
    if counts:
        requests = sum(evidence.ledger.units[unit].answered for unit in counts)
        echoes = min(sum(counts.values()), requests)
        numbers = {"who": "A converter on the way", "units": tuple(counts), "echoes": echoes, "requests": requests}
        explains = frozenset((kind, unit) for unit in counts for kind in (Symptom.SILENCE, Symptom.TIMING))
        yield Suspicion(tuple(counts), _COPY_BITS * echoes, explains, numbers)


def _has_seven_bits(data: bytes) -> bool:
    """Whether bytes in no frame never have the highest bit, as a third of them have: the tap takes seven bits of "
    "each."""
    return len(data) >= _BYTES and max(data) < 0x80


def _changes(data: bytes) -> float:
    """How often bits of a byte change from one to the next, on average: a line at another speed stretches or skips "
    "them."""
    octets = np.frombuffer(data, np.uint8)
    turned = ((octets ^ octets >> 1) & 0x7F).astype(np.uint8)
    changes = float(np.unpackbits(turned).sum()) / len(octets)
    return changes + _SPREAD / sqrt(len(octets))  # of few bytes it may be chance


def _marks_all(evidence: Evidence) -> bool:
    """Whether frames are right and the UART marks many bytes of nearly all of them, of each unit and of requests: one unit
    may send by another parity, but not all that is heard."""
    ledger, told = evidence.ledger, [unit for unit in evidence.units if unit.answered >= _FEW]
    asked = ledger.marked_bytes - sum(unit.marked_bytes for unit in evidence.units)
    return (
        sum(unit.answered for unit in told) >= _LEAST
        and ledger.right_bytes >= _NEARLY_ALL * ledger.bytes
        and ledger.marked_bytes >= _SOME_MARKED * ledger.bytes
        and all(unit.marked >= _MOST_UNITS * unit.answered for unit in told)
        and asked >= _SOME_MARKED * _REQUEST * ledger.requests
    )


def _told_by(evidence: Evidence, loose: int = 0, marks: float = 0.0, wrong: float = 0.0) -> dict[str, float]:
    """For people: bytes in no frame, the share of bytes marked, and the same where frames are right."""
    ledger = evidence.ledger
    told = {"right": ledger.right_bytes, "bytes": ledger.bytes, "baud": ledger.line.baud or 0}
    return {**told, "loose": loose, "marks": marks, "wrong": wrong}


_LIVELY: Final = 3.25  # changes a byte; data have 3.5, lines at another speed up to 3.2
_SPREAD: Final = 1.32  # of the changes in a byte


@suspect(
    "tap-line-settings",
    Severity.ERROR,
    blame="tap",
    text="The tap's speed, parity or polarity differs from the line's[: almost nothing it hears is a frame "
    "({right:,} of {bytes:,} bytes, {loose:,} in none)][; its UART marks {marks:.0%} of the bytes][: its frames are right, "
    "and "
    "its UART marks {wrong:.0%} of the bytes, whoever sends them]",
    share="{right:,} of {bytes:,} bytes in frames",
    deciding_test="Listen at other speeds and parities (`rtuscope sniff --baud auto`), then with A and B exchanged",
    remedy="Set the tap's baud rate and parity to those of the line[ ({baud} bit/s now)], and connect A to A",
)
def tap_line_settings(evidence: Evidence) -> Iterator[Suspicion]:
    """Bytes, and no frames; or right ones, and marks at all of them."""
    ledger = evidence.ledger
    if _marks_all(evidence):
        yield Suspicion(
            (),
            surplus_bits(ledger.marked_bytes, ledger.bytes, HEALTHY),
            frozenset({(Symptom.MARKS, unit.unit) for unit in evidence.units} | {(Symptom.MARKS, None)}),
            _told_by(evidence, wrong=ledger.marked_bytes / ledger.bytes),
            ledger.begin,
            ledger.end,
            lost_answers=0,
        )
        return
    data = b"".join(octets for _, _, octets in ledger.noise)
    if (
        evidence.foreign[1]
        or ledger.bytes < _BYTES
        or (tap_kind(ledger.line) is TapKind.EDGES and ledger.marked_bytes < _FEW_MARKED * ledger.bytes)
        or (evidence.declared_bytes > _NOTHING * ledger.bytes and not _has_seven_bits(data))
        or ledger.right_bytes > _HALF * ledger.bytes
        or len(data) < _BYTES / 2
        or is_of_its_own([octets for _, _, octets in ledger.noise], ledger.line.baud)
        or sum(_hidden(evidence, port, role) for port in ledger.ports for role in Role) >= _FRAMES
    ):
        return
    text = sum(0x20 <= byte < 0x7F or byte in (0x0A, 0x0D) for byte in data) / len(data)
    marks = ledger.marked_bytes / ledger.bytes
    if marks < 0.02 and (text > _TEXT or _changes(data) > _LIVELY):
        return  # the UART read whole characters: of a protocol that nobody knows, for all one can tell
    numbers = _told_by(evidence, loose=ledger.bytes - ledger.right_bytes, marks=marks if marks > 0.02 else 0.0)
    yield Suspicion(
        (),
        30 + 200 * marks + (ledger.bytes - ledger.right_bytes if _has_seven_bits(data) else ledger.noise_bytes / 2),
        everything(evidence),
        numbers,
        ledger.begin,
        ledger.end,
    )
