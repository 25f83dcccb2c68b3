"""Damage with a structure: answers that always end at one length, bytes that only the tap lost, requests that are right
but for one thing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Final, NamedTuple

from dissectors.crc import crc_bytes, matching
from dissectors.lengths import Role, pdu_length

from ...tables.findings import Severity
from ...tables.taps import TapKind, tap_kind
from ..bits import surplus_bits
from ..costs import kind_bits
from ..evidence import HEALTHY, Evidence
from ..exchanges import Ending
from ..foretold import of_all
from ..hits import evenness_bits
from ..registry import ASKED_FOR, Explained, Foretold, Suspicion, Symptom, suspect
from ..signatures import AnswerDamage
from ..taken import move
from ..unitledger import UnitLedger
from .common import damage_suspicion, examples
from .taps import everything

_LEAST: Final = 4
_ALWAYS: Final = 0.9
_BUFFER: Final = 16  # bytes: nobody makes a smaller one,
_CUT_OFF: Final = 5  # and a driver that lets go too early loses no more than a few
_LENGTH_BITS: Final = 3.0  # an answer that ends at just this byte, of those where it might
_SHORT: Final = (AnswerDamage.CUT, AnswerDamage.TAIL, AnswerDamage.MIDDLE)


class CutAt(NamedTuple):
    """The length at which a unit's answers end, how many do, and the longest that came whole."""

    length: int
    cut: int
    due: int
    whole: int


def _cut_at(evidence: Evidence, unit: UnitLedger) -> CutAt | None:
    readings = evidence.readings(unit)
    if len(readings) < _LEAST:
        return None
    ends = Counter(each.length for each in readings if each.damage in _SHORT and each.length < each.due)
    if not ends:
        return None
    length, count = ends.most_common(1)[0]
    if count < _ALWAYS * len(readings):
        return None
    dues = [each.due for each in readings if each.length == length]
    whole = max((int(due) for due in _whole(evidence, unit)), default=0)
    if len(set(dues)) == 1 and not whole and (length < _BUFFER or max(dues) - length < _CUT_OFF):
        return None  # of one length only: its end may as well be lost otherwise
    return (
        CutAt(length, round(evidence.damaged(unit) * count / len(readings)), max(dues), whole)
        if whole <= length
        else None
    )


def _whole(evidence: Evidence, unit: UnitLedger) -> set[int]:
    """The lengths of answers that mostly come whole."""
    rows = evidence.rows(unit.unit)
    good, bad = rows.due[rows.outcome == Ending.OK], Counter(rows.due[rows.outcome == Ending.GARBAGE].tolist())
    return {due for due, count in Counter(good.tolist()).items() if due and count > bad[due]}


@suspect(
    "cut-at-length",
    Severity.ERROR,
    blame="unit",
    text="Answers of {units:unit|units} end at byte {length}: {cut:,} longer ones are cut off just there, shorter ones "
    "are whole",
    share="{cut:,} of {answers:,} answers of {units:unit|units}",
    deciding_test="Ask {units:unit|units} for fewer registers, so that the answer has at most {length} bytes: it must "
    "arrive whole",
    remedy="Ask for less at a time, at most {length} bytes per answer; a transmit buffer in the unit or in a converter "
    "on the way holds no more",
    foretold=Foretold({Symptom.DAMAGE: ASKED_FOR}),
)
def cut_at_length(evidence: Evidence) -> Iterator[Suspicion]:
    """All damaged answers end at one length, and all that are longer are damaged."""
    found = [(unit, cut) for unit in evidence.units if (cut := _cut_at(evidence, unit)) is not None]
    for length in sorted({cut.length for _, cut in found}):
        mine = [(unit, cut) for unit, cut in found if cut.length == length]
        yield damage_suspicion(
            evidence,
            [unit for unit, _ in mine],
            sum(evidence.surplus(unit) + _LENGTH_BITS * cut.cut for unit, cut in mine),
            {"length": length, "cut": sum(cut.cut for _, cut in mine)},
            (Symptom.DAMAGE, Symptom.LATENESS, Symptom.BEHIND),
        )


_SURE_BITS: Final = 8.0
_MOSTLY_SHORT: Final = 0.7
# What is left of an answer that lost bytes, on buses of two simulators.
_LOST: Final = {
    "middle": 0.25,
    "cut-short": 0.22,
    "cut": 0.18,
    "head": 0.14,
    "whole": 0.08,
    "other": 0.06,
    "tail": 0.03,
    "crossed": 0.03,
}
_DISPLACED_BITS: Final = 16.0  # an answer that seems to be of another request
TAP_TAKES: Final = (
    Symptom.DAMAGE, Symptom.BEHIND, Symptom.LATENESS, Symptom.DOUBLES, Symptom.MARKS, Symptom.SILENCE, Symptom.SHIFT,
)  # fmt: skip


@suspect(
    "tap-loses",
    Severity.WARNING,
    blame="tap",
    text="The tap loses bytes, the bus does not: {damaged:,} answers came to it damaged; the client took {taken:,} of "
    "{told} whose "
    "next request shows it, as it came as soon as after good answers",
    share="{damaged:,} of {answers:,} answers, of {units:unit|units}",
    deciding_test="Compare the client's own error counters with this capture: they must not rise with the damage here",
    remedy="Relieve the computer that listens: a port with a deeper FIFO or an adapter with a shorter latency, no "
    "other work on "
    "that core, a recorder instead of a live view",
)
def tap_loses(evidence: Evidence) -> Iterator[Suspicion]:
    """Damaged answers of all that the client took."""
    moves = {unit.unit: move(evidence, unit.unit) for unit in evidence.units if evidence.damaged(unit)}
    units = [unit for unit in evidence.units if unit.unit in moves]
    told, bits = sum(each.told for each in moves.values()), sum(each.bits for each in moves.values())
    readings = [each for unit in units for each in evidence.readings(unit)]
    if told < _LEAST or bits < _SURE_BITS or len(readings) < _LEAST:
        return
    bits += evenness_bits(evidence)  # what a tap loses it loses of all
    if bits < _SURE_BITS or sum(each.length < each.due for each in readings) < _MOSTLY_SHORT * len(readings):
        return
    displaced = sum(each.displaced for each in evidence.ledger.shifts.units.values())  # behind requests that it lost
    damaged, answers = sum(map(evidence.damaged, units)), sum(unit.asked for unit in units)
    requests = sum(map(evidence.requests_behind, evidence.units))
    bits += max(kind_bits(readings, _LOST), 0.0)
    yield Suspicion(
        (),
        surplus_bits(min(damaged + requests, answers), answers, HEALTHY) + bits + _DISPLACED_BITS * displaced,
        of_all(evidence, TAP_TAKES),
        {
            "damaged": damaged,
            "answers": answers,
            "told": told,
            "taken": sum(each.taken for each in moves.values()),
            "units": tuple(unit.unit for unit in units),
        },
        since=evidence.ledger.begin,
        until=evidence.ledger.end,
        lost_answers=0,
        frames=examples(units, Ending.GARBAGE),
    )


_CUT_BITS: Final = 12.0  # that a request proves which is right but for its last byte: its function, a byte of its CRC,
_CONVENTION_BITS: Final = 15.0  # or both bytes, by one of a few dozen conventions
_ASKS: Final = (1, 2, 3, 4, 5, 6, 15, 16, 22, 23)
_BODY: Final = 6  # bytes before the check value, of the shortest
_TILED: Final = 0.6  # of the bytes in no frame
_FEW: Final = 8
CUT: Final = "the last byte is missing"
ENVELOPED: Final = "they are those of Modbus TCP, without a check value"
_CLAUSES: Final = {CUT: "cut", ENVELOPED: "cut"}  # the others are names of check values
_FLAW_BITS: Final = {CUT: _CUT_BITS}


def _flaws(data: bytes) -> Iterator[tuple[str, int]]:
    """What is wrong with each of the requests that stand in these bytes, right but for one thing, and how long it is."""
    at = 0
    while at < len(data) - _BODY:
        length = pdu_length(data[at + 1 :], Role.REQUEST) if data[at] and data[at + 1] in _ASKS else None
        end = at + 1 + (length or len(data))
        body, tail = data[at:end], data[end : end + 2]
        at += 1
        if tail and crc_bytes(body) != tail:
            variant = next(matching(body + tail), None) if len(tail) == 2 else None
            if variant is not None:
                at = end + 2
                yield variant.name, len(body) + 2
            elif len(body) == _BODY and tail[:1] == crc_bytes(body)[:1]:
                at = end + 1
                yield CUT, len(body) + 1


@suspect(
    "request-flaw",
    Severity.ERROR,
    blame="master",
    text="The client sends its requests wrongly[: {cut}][: their check value is {flaw}], in {frames:,} requests among "
    "the bytes examined, and no unit answers such frames",
    share="{frames:,} requests with this flaw, {right:,} right frames",
    deciding_test="Read from one unit with a program that is known to work: the unit must answer it",
    remedy="Correct the client's program: how it makes the CRC, and how many bytes it writes to the port; set a gateway that "
    "passes Modbus TCP on as it is to turn it into RTU",
)
def request_flaw(evidence: Evidence) -> Iterator[Suspicion]:
    """Requests that are right but for one thing, where next to nothing else is a frame, or next to nothing else is
    damaged; or that wear the header of Modbus TCP on a line of ours, and get no answer."""
    ledger = evidence.ledger
    serial = tap_kind(ledger.line) is TapKind.SERIAL
    if serial and ledger.enveloped >= _FEW and not ledger.enveloped_answers:
        yield _flawed(evidence, ENVELOPED, ledger.enveloped, alone=not ledger.frames)
        return
    alone = ledger.right_bytes <= (1 - _TILED) * ledger.bytes
    looked_at = [data for _, _, data in ledger.noise] + ledger.spoilt
    if not alone:
        looked_at = [each.heard for unit in evidence.units for each in evidence.followed(unit)]
    size = sum(map(len, looked_at))
    flaws = [each for data in looked_at for each in _flaws(data) if alone or each[0] != CUT]
    for flaw, count in Counter(flaw for flaw, _ in flaws).most_common(1):
        if count < _FEW or sum(length for each, length in flaws if each == flaw) < _TILED * size:
            return
        stands_for = max((ledger.bytes - ledger.right_bytes) / size, 1.0)
        yield _flawed(evidence, flaw, count, stands_for, alone=alone)


def _flawed(evidence: Evidence, flaw: str, count: int, stands_for: float = 1.0, *, alone: bool) -> Suspicion:
    """So many requests with a flaw, each of which stands for so many."""
    ledger = evidence.ledger
    behind: Explained = frozenset((Symptom.BEHIND, unit.unit) for unit in evidence.units)
    words = {"flaw": "", "cut": "", _CLAUSES.get(flaw, "flaw"): flaw}
    numbers = words | {"frames": count, "right": ledger.requests + ledger.responses}
    bits = _FLAW_BITS.get(flaw, _CONVENTION_BITS) * count * stands_for
    return Suspicion((), bits, everything(evidence) if alone else behind, numbers, ledger.begin, ledger.end)


_ANSWERS_DUE: Final = frozenset((1, 2, 3, 4, 7, 0x11, 0x14, 0x17, 0x18, 0x2B))  # functions that only read


@suspect(
    "unit-0-asked",
    Severity.ERROR,
    blame="master",
    text="The client reads from unit 0, the broadcast address, which never answers: {asked:,} requests[, each of which "
    "costs about {wait:ms}]",
    share="{asked:,} of {requests:,} requests go to unit 0 and want an answer",
    deciding_test="Look in the client's list for a device whose address was left at 0",
    remedy="Give that device an address from 1 to 247, in the device and in the client's list, or take the entry off "
    "the list",
)
def unit_0_asked(evidence: Evidence) -> Iterator[Suspicion]:
    """Reads that are sent to everybody, and that nobody may answer."""
    if not evidence.ledger.broadcasts:
        return
    polls = [poll for poll in evidence.polls_of(0) if poll.function in _ANSWERS_DUE]
    asked = sum(poll.asked for poll in polls)
    if asked < _LEAST or evidence.ledger.broadcasts_answered > HEALTHY * asked + 1:
        return
    if not evidence.is_open(Symptom.REQUESTS, 0):
        return
    wait = evidence.ledger.turnarounds.quantile(0.5)
    yield Suspicion(
        (0,),
        surplus_bits(asked, asked, HEALTHY),
        frozenset({(Symptom.REQUESTS, 0)}),
        {
            "asked": asked,
            "requests": evidence.ledger.exchanges,
            "wait": (wait or 0.0) / 1e6,
        },
        since=min(poll.first for poll in polls) if evidence.ledger.timed else None,
        until=max(poll.last for poll in polls) if evidence.ledger.timed else None,
        lost_answers=asked,
        lost_ms=None if wait is None else evidence.ledger.turnarounds.total / 1e6,
    )
