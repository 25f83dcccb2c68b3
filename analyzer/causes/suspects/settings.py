"""A unit whose UART is not set like the line's."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import log2
from statistics import median
from typing import Final

import numpy as np

from ...tables.findings import Severity
from ..bits import surplus_bits
from ..costs import kind_bits, share_of
from ..evidence import Evidence, usual_rate
from ..exchanges import Ending
from ..heads import beginnings
from ..ledger import ASKED, BAD
from ..polls import Poll
from ..rawbytes import CharacterFormat, drifts, formats_of, misread, other_formats, samples, whole_by_another_clock
from ..registry import COMES_AND_GOES, LENGTHS, Foretold, Suspicion, Symptom, suspect
from ..repeats import waits_longer
from ..samples import READ_REQUEST
from ..sentas import formats_as_fast, sent_as
from ..signatures import Signature, known_header
from ..unitledger import UnitLedger
from .common import damage_suspicion, examples

_LEAST: Final = 3
_BYTE: Final = 8.0
_MOST_BYTES: Final = 6  # that count for a sample: an answer that echoes is known as far
_NOT_AS_SENT: Final = log2(0.04)  # bits: settings garble the same bytes in the same way nearly always
_SAME, _OTHER = log2(0.96 / 0.5), log2(0.04 / 0.5)  # bits: garbage that is like that of the same poll before, or not
_EXPECTED: Final = {"whole": 0.83, "middle": 0.06, "cut": 0.03, "long": 0.03, "head": 0.02}
_DRIFTED: Final = {"whole": 0.25, "middle": 0.55, "bits": 0.1, "cut": 0.03, "long": 0.03, "head": 0.04}
_MOSTLY: Final = 0.6
_HEADER: Final = 3  # bytes: unit, function, byte count
_BEGINS_RIGHT: Final = 2.0  # bits, each
_SHORT: Final = 32  # bytes of which each may have been two
_TRIED: Final = 12
_RUNS_ON: Final = 4  # bytes, by which an answer that is read by another format may be longer
_A_CLOCK: Final = "a clock that is off"
_GARBAGE: Final = "are garbage of about the right length, never silence"
_MARKED: Final = 0.2  # of good answers
_ABOUT_AS: Final = 0.5  # times as often
_LEAST_ASKED: Final = 6
_SEVERAL: Final = 2  # polls: one alone may be asked more often than the others on purpose
_NEARLY_ALL: Final = 0.9
_REPEATED: Final = (0.4, 0.85)  # of the requests of each poll
_AS_LONG: Final = 0.95
_LATER: Final = 1.05
_AGAIN: Final = 1.5  # times a visit
_HOLE_CHARS: Final = 2.0
_MOST_REFUSED: Final = 90.0


@suspect(
    "unit-line-settings",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} sends at other settings ({settings}[ by {drift:+.0%}]) than the line"
    "[ ({line})][ ({line_baud} bit/s, {line_bits}-bit characters)]: {damaged:,} of its {answers:,} answers {how}",
    share="{damaged:,} of {answers:,} answers of unit {unit}[, {others_damaged:,} of {others_answers:,} of others]",
    deciding_test="Listen to unit {unit} alone at other settings ({settings}[ by {drift:+.0%}]): its answers must then "
    "read well",
    remedy="Set the unit's baud rate, parity and stop bits to those of the line[ ({line})]; a clock that is off by some per cent "
    "(an RC oscillator) means another device is needed",
    foretold=Foretold({Symptom.DAMAGE: COMES_AND_GOES | LENGTHS}),  # whatever is asked
)
def unit_line_settings(evidence: Evidence) -> Iterator[Suspicion]:
    """Garbage from one unit, or good answers that its parity bits give away."""
    for unit in evidence.units:
        readings = evidence.readings(unit)
        whole = _whole_otherwise(evidence, readings) if len(readings) >= _LEAST else (0.0, "", 0.0)
        garbled = share_of(readings, "whole", "middle", "long", "cut") >= _MOSTLY
        if len(readings) >= _LEAST and (garbled or whole[0] > 0):
            bits, words, drift = _fitting(evidence, readings)
            if (seven := _seven_bits(readings)) > bits:
                bits, words, drift = seven, "seven data bits and parity", 0.0
            kinds = kind_bits(readings, _EXPECTED)
            if whole[0] > bits:
                bits, words, drift = whole
                kinds = max(kinds, kind_bits(readings, _DRIFTED))
            if not bits:
                bits -= _good_between(evidence, unit)  # nobody changes settings to and fro
                bits -= _BEGINS_RIGHT * _beginning_right(readings)
            bits += evidence.surplus(unit) + kinds + _steadiness(evidence, unit)
            if bits > 0:
                yield _damaged_as(evidence, unit, bits, words, drift, _GARBAGE)
        elif evidence.is_open(Symptom.MARKS, unit.unit):
            yield from _marked(evidence, unit)
            yield from _refused(evidence, unit)


def _damaged_as(evidence: Evidence, unit: UnitLedger, bits: float, settings: str, drift: float, how: str) -> Suspicion:
    """The answers of a unit that sends at these settings, beside those of the line as far as they are known."""
    line = evidence.ledger.line
    known = line.character_format or ""
    words = {
        "settings": settings,
        "drift": drift,
        "how": how,
        "line": known and f"{line.baud or ''} {known}".strip(),
        "line_baud": line.baud,
        "line_bits": 0 if known or not line.baud else line.char_bits or 0,
    }
    return damage_suspicion(evidence, [unit], bits, words)


def _fitting(evidence: Evidence, readings: Sequence[Signature]) -> tuple[float, str, float]:
    """The other settings by which the garbage's first bytes are just what was to be sent: their weight, their words, and
    by how much a clock is off."""
    best, words, off = 0.0, "another speed or parity, or a clock that is off", 0.0
    heard = beginnings(readings, _MOST_BYTES)
    for receiver in formats_of(evidence.ledger.line):
        for sender, drift in other_formats(receiver):
            bits = -_BYTE + max(
                sum(_match(header, heads, sender, receiver, sample) for header, heads in heard.items())
                for sample in samples(sender, receiver)
            )
            if bits > best:
                best, off = bits, drift
                words = _A_CLOCK if drift else sender.words
    return best, words, off


def _whole_otherwise(evidence: Evidence, readings: Sequence[Signature]) -> tuple[float, str, float]:
    """The clock or format by which damaged answers were whole when they were sent: its weight, its words, and by how much
    a clock is off."""
    short = [each for each in readings if 0 < each.due <= _SHORT and each.length <= each.due + _RUNS_ON]
    heard = list(dict.fromkeys((each.heard, known_header(each.request), each.due) for each in short))[:_TRIED]
    best = 0.0, "", 0.0
    for receiver in formats_of(evidence.ledger.line) if heard else ():
        for sender, drift in drifts(receiver):
            whole = (
                whole_by_another_clock(data, header, sender, receiver) if len(data) == due else 0.0
                for data, header, due in heard
            )
            best = max(best, (sum(bits or -1.0 for bits in whole) - _BYTE, _A_CLOCK, drift))
        for sender in formats_as_fast(receiver):
            bits = sum(sent_as(*each, sender, receiver) or -1.0 for each in heard) - _BYTE
            best = max(best, (bits, sender.words, 0.0))
    return best


def _beginning_right(readings: Sequence[Signature]) -> int:
    """How many damaged answers begin as they must by some bytes: settings that garble the rest leave few so."""
    return sum(each.heard.startswith(known_header(each.request)[:_HEADER]) for each in readings)


def _good_between(evidence: Evidence, unit: UnitLedger) -> int:
    """Good answers of a unit between its damaged ones, as far as parts of the time tell."""
    grid = evidence.ledger.grid
    asked, bad = grid.counts((ASKED, unit.unit)), grid.counts((BAD, unit.unit))
    hit = np.flatnonzero(bad)
    return int((asked - bad)[hit[0] + 1 : hit[-1]].sum()) if len(hit) else 0


def _seven_bits(readings: Sequence[Signature]) -> float:
    """How much likelier it is that the highest bit of each byte is the parity of the others, each byte taken once."""
    odd = [byte.bit_count() & 1 for byte in set(b"".join(reading.heard for reading in readings))]
    one = min(sum(odd), len(odd) - sum(odd))
    return one * _OTHER + (len(odd) - one) * _SAME - _BYTE


def _match(
    header: bytes, heads: Mapping[bytes, int], sender: CharacterFormat, receiver: CharacterFormat, sample: float
) -> float:
    """Bits for first bytes, each heard so often, that are garbled just so; nothing where they would be as they "
    "should."""
    garbled = misread(header, sender, receiver, sample)[:_MOST_BYTES]
    if not garbled or header.startswith(garbled):
        return 0.0
    same = sum(count for head, count in heads.items() if head.startswith(garbled) or garbled.startswith(head))
    return _BYTE * len(garbled) * same + _NOT_AS_SENT * (sum(heads.values()) - same)


def _steadiness(evidence: Evidence, unit: UnitLedger) -> float:
    """Whether the same poll gives the same garbage each time, as far as its header goes."""
    polls: dict[bytes, list[Signature]] = defaultdict(list)
    for each in evidence.readings(unit):
        polls[each.request].append(each)
    return sum(map(_alike, polls.values()))


def _alike(readings: Sequence[Signature]) -> float:
    """The garbage of one poll by its first bytes: as many as come of the header alone, which by a faster sender are fewer.
    That a header is right tells nothing, for it is so where two mix, too."""
    header = known_header(readings[0].request)[:_MOST_BYTES]
    length, due = median(each.length for each in readings), max(each.due for each in readings)
    count = max(min(round(len(header) * length / max(due, 1)), len(header)), 1)
    common, times = Counter(each.heard[:count] for each in readings).most_common(1)[0]
    same = 0.0 if common == header[:count] else _SAME
    return (times - 1) * same + (len(readings) - times) * _OTHER


def _marked(evidence: Evidence, unit: UnitLedger) -> Iterator[Suspicion]:
    """Answers whose bytes are right and whose parity or stop bits are not."""
    if unit.marked < max(_LEAST, _MARKED * unit.answered):
        return
    others = evidence.others(unit)
    background = usual_rate(sum(o.marked for o in others), sum(o.answered for o in others))
    if _marks_all(evidence, unit, others):
        return
    bits = surplus_bits(unit.marked, unit.answered, background)
    found = _damaged_as(evidence, unit, bits, "another parity", 0.0, "have right bytes and marks of the UART")
    yield Suspicion(
        found.units,
        found.bits,
        frozenset({(Symptom.MARKS, unit.unit), (Symptom.DAMAGE, unit.unit)}),
        {**found.numbers, "damaged": unit.marked, "others_damaged": sum(o.marked for o in others)},
        since=unit.first,
        until=unit.last,
        frames=examples([unit], Ending.OK),
    )


def _marks_all(evidence: Evidence, unit: UnitLedger, others: Sequence[UnitLedger]) -> bool:
    """Whether a tap marks what others send about as often, answers or requests: then it is its own parity that is "
    "wrong."""
    own = unit.marked / unit.answered
    marked, answered = sum(other.marked for other in others), sum(other.answered for other in others)
    asked = evidence.ledger.marked_bytes - sum(each.marked_bytes for each in evidence.units)
    requests = sum(each.asked for each in evidence.units)
    return marked >= _ABOUT_AS * own * answered > 0 or asked > _ABOUT_AS * own * requests


def _waits_on(evidence: Evidence, unit: UnitLedger, polls: Sequence[Poll]) -> bool:
    """Whether the master waits on behind answers of a unit, far longer than it pauses elsewhere, and then repeats what it
    asked: it does not take them. Not told of one poll repeated once, which a list may hold at its beginning and its end,
    unless that begins in the midst."""
    if len(unit.redundant_pauses) < _LEAST_ASKED or unit.first_again is None or not waits_longer(evidence, unit):
        return False
    waited, last = unit.redundant_pauses.quantile(0.5), unit.last_pauses.quantile(0.5)
    if waited is None or last is None or len(unit.last_pauses) < _LEAST or last < _AS_LONG * waited:
        return False  # a poll that has a timer of its own does not keep others waiting for as long
    if any(poll.repeats > _REPEATED[1] * poll.asked for poll in polls):
        return False
    if unit.first_again - unit.first > unit.last - unit.first_again:
        return True
    several = len(polls) >= _SEVERAL and all(poll.repeats >= _SEVERAL for poll in polls)
    again = sum(poll.repeats for poll in polls) >= _AGAIN * sum(poll.asked - poll.repeats for poll in polls)
    turn = (unit.redundant_turns.quantile(0.5) or 0.0) + READ_REQUEST * evidence.ledger.char_ns
    return (several or again) and all(_goes_round(poll, turn) for poll in polls)


def _goes_round(poll: Poll, turn_ns: float) -> bool:
    """Whether a poll comes back later than so often a turn: the master asks others between. One with a timer of its own
    comes back in step, whoever is asked between."""
    visits = max(poll.asked - poll.repeats, 1)
    return len(poll.intervals) > 0 and float(poll.intervals.mean()) >= _LATER * turn_ns * poll.asked / visits


def _refused(evidence: Evidence, unit: UnitLedger) -> Iterator[Suspicion]:
    """Answers that are well, as far as the tap tells, and whose requests the master repeats all the same: each of several
    polls so many times, or by its timer, and those of no other unit. A tap that marks no parity errors hears them so."""
    polls = [poll for poll in evidence.polls_of(unit.unit) if poll.asked >= _LEAST_ASKED]
    always = len(polls) >= _SEVERAL and all(
        _REPEATED[0] * poll.asked <= poll.repeats <= _REPEATED[1] * poll.asked for poll in polls
    )
    if not polls or not (always or _waits_on(evidence, unit, polls)):
        return
    others = [poll for poll in evidence.polls if poll.unit not in (0, unit.unit)]
    repeats, asked = sum(poll.repeats for poll in polls), sum(poll.asked for poll in polls)
    others_repeats, others_asked = sum(poll.repeats for poll in others), sum(poll.asked for poll in others)
    if (
        not others_asked
        or any(poll.count(Ending.OK) < _NEARLY_ALL * poll.asked for poll in polls)
        or unit.behind > (1 - _NEARLY_ALL) * unit.answered
        or others_repeats > (1 - _NEARLY_ALL) * others_asked
        or (evidence.verdict.fine and unit.holes.above(_HOLE_CHARS * evidence.ledger.char_ns) > 1 - _NEARLY_ALL)
    ):
        return
    bits = min(surplus_bits(repeats, asked, usual_rate(others_repeats, others_asked)), _MOST_REFUSED)
    settings, how = "another parity, which this tap does not mark", "are whole, and the client asks again"
    found = _damaged_as(evidence, unit, bits, settings, 0.0, how)
    yield replace(
        found,
        numbers={**found.numbers, "damaged": repeats, "answers": asked},
        since=unit.first,
        until=unit.last,
        lost_answers=repeats,
        lost_ms=None,
        frames=examples([unit], Ending.OK),
    )
