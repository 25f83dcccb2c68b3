"""Exceptions: units that are busy, and lists that ask for what a device does not have."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

from ...requests.asked import span_words
from ...requests.corrections import Areas
from ...requests.reasons import Unserved
from ...tables.findings import Severity
from ..bits import clustering_bits, mean_period_s, surplus_bits
from ..costs import LostAnswers
from ..evidence import Evidence
from ..exchanges import Ending
from ..polls import Poll
from ..registry import ASKED_FOR, Foretold, Suspicion, Symptom, suspect
from ..unserved import asks, unserved_of
from .common import silent_suspicion

_LEAST: Final = 3
_BUSY_LEAST: Final = 5
_BACKGROUND: Final = 0.02  # of requests that a healthy unit refuses,
_BUSY_BACKGROUND: Final = 0.004  # and of those for which it has no time: hardly any
_ALWAYS: Final = 0.9
_AREAS: Final = 4  # that are named
WRITES: Final = (5, 6, 15, 16, 22, 23)
_READ_BY: Final = {5: (1,), 15: (1,), 6: (3, 4), 16: (3, 4), 22: (3,), 23: (3,)}
_ILLEGAL_ADDRESS: Final = 2
_ILLEGAL: Final = (2, 3)  # address, quantity
_BUSY: Final = 6
_REFUSES: Final = (2, 3, 4)


@suspect(
    "unit-busy",
    Severity.WARNING,
    blame="unit",
    text="Unit {unit} reports that it is busy, in {spells:spell|spells}: {busy:,} of {asked:,} requests got exception "
    "{code}",
    share="{busy:,} of {asked:,} requests to unit {unit}",
    deciding_test="Compare how often unit {unit} is polled with its manual; polled half as often, the exceptions go "
    "if it cannot keep up",
    remedy="Poll it less often or fewer registers at once, and let the client ask again after a pause when it is busy",
)
def unit_busy(evidence: Evidence) -> Iterator[Suspicion]:
    """Exception 06 or 05, in spells."""
    for unit in evidence.units:
        if unit.busy < _BUSY_LEAST or not evidence.is_open(Symptom.REFUSAL, unit.unit):
            continue
        spells = unit.refusals.all
        runs = len(spells) + unit.refusals.single + unit.refusals.more
        codes = [code for poll in evidence.polls_of(unit.unit) for code in poll.exceptions if code in (5, 6)]
        begins = [each.begin for each in spells]
        bits = surplus_bits(unit.busy, unit.asked, _BUSY_BACKGROUND) + clustering_bits(unit.busy, unit.asked, runs)
        code = f"{max(set(codes), key=codes.count, default=_BUSY):02d}"
        numbers, lost = {"busy": unit.busy, "asked": unit.asked, "spells": runs, "code": code}, LostAnswers(unit.busy)
        cause = silent_suspicion(evidence, [unit], bits, (Symptom.REFUSAL,), numbers, lost, Ending.EXCEPTION)
        if spells:
            cause = replace(cause, since=begins[0], until=spells[-1].end, period_s=mean_period_s(begins))
        yield cause


def _refused(evidence: Evidence, unit: int, codes: tuple[int, ...]) -> list[Poll]:
    """Polls of a unit that nearly always get one of these exceptions."""
    if not evidence.is_open(Symptom.REFUSAL, unit):
        return []
    return [
        poll
        for poll in evidence.polls_of(unit)
        if (hits := sum(poll.exceptions[code] for code in codes)) >= _LEAST
        and hits >= _ALWAYS * (poll.count(Ending.OK) + poll.count(Ending.EXCEPTION))
    ]


def _well(evidence: Evidence, unit: int, functions: tuple[int, ...]) -> list[Poll]:
    """Polls of a unit by these functions that it answers."""
    mine = evidence.polls_of(unit)
    return [poll for poll in mine if poll.function in functions and poll.count(Ending.OK) > poll.exceptions.total()]


def _beside(poll: Poll, well: list[Poll]) -> bool:
    """Whether a poll reaches just one register beyond what reads well, or all but one of its registers read well."""
    areas = Areas.joined((good.address, good.end) for good in well).spans
    beyond = any(begin <= poll.address < end == poll.end - 1 for begin, end in areas)
    before = any(end >= poll.end > begin == poll.address + 1 for begin, end in areas)
    follows = any((good.quantity, good.end) == (poll.quantity, poll.address) for good in well)
    return beyond or before or follows or poll.end in (good.address for good in well)


def _suspicions(evidence: Evidence, refused: Mapping[int, list[Poll]], weight: float) -> Iterator[Suspicion]:
    """Units that refuse just the same are of one make: one entry of the list is wrong for all of them."""
    groups: defaultdict[frozenset[tuple[int, int, int]], list[int]] = defaultdict(list)
    for unit, polls in refused.items():
        groups[frozenset((each.function, each.address, each.quantity) for each in polls)].append(unit)
    groups.pop(frozenset(), None)
    for units in groups.values():
        yield _suspicion(evidence, tuple(units), refused, weight)


def _suspicion(
    evidence: Evidence, units: tuple[int, ...], refused: Mapping[int, list[Poll]], weight: float
) -> Suspicion:
    polls = [poll for unit in units for poll in refused[unit]]
    hits = sum(poll.count(Ending.EXCEPTION) for poll in polls)
    asked = sum(poll.asked for poll in polls)
    areas = areas_of(refused[units[0]])
    numbers = {
        "units": units,
        "refused": hits,
        "asked": asked,
        "areas": areas,
        "more": len(refused[units[0]]) - len(areas),
        "codes": ", ".join(f"{code:02d}" for code in sorted({code for poll in polls for code in poll.exceptions})),
        **asks(_reason(evidence, units[0])),
    }
    ledgers, bits = [evidence.ledger.units[unit] for unit in units], surplus_bits(hits, asked, _BACKGROUND) * weight
    cause = silent_suspicion(evidence, ledgers, bits, (Symptom.REFUSAL,), numbers, LostAnswers(hits), Ending.EXCEPTION)
    return replace(cause, since=min(poll.first for poll in polls), until=max(poll.last for poll in polls))


def _reason(evidence: Evidence, unit: int) -> Unserved | None:
    found = unserved_of(evidence, evidence.ledger.units[unit], silent=False)
    return found if found is not None and found.reason in ("address", "range-end") else None


def areas_of(polls: Sequence[Poll]) -> tuple[str, ...]:
    """The addresses of a few polls, as people write them."""
    return tuple(span_words(poll.address, poll.end) for poll in polls[:_AREAS])


_TEST: Final = (
    "Read the registers of {units:unit|units} one by one around {areas}: it shows where the map begins and ends"
)


@suspect(
    "off-by-one",
    Severity.WARNING,
    blame="master",
    text="The client's list is off by one for {units:unit|units}: requests at {areas:address|addresses}[ and {more} "
    "more] are refused (exception {codes}, {refused:,} of {asked:,}), while all but one register there reads well",
    share="{refused:,} of {asked:,} such requests to {units:unit|units}",
    deciding_test=_TEST,
    remedy="Compare the list with the device's manual: does it count registers from 1 (40001) and the wire from 0?[ "
    "Ask instead: {asks}]",
    foretold=Foretold({Symptom.REFUSAL: ASKED_FOR}),
)
def off_by_one(evidence: Evidence) -> Iterator[Suspicion]:
    """Reads that reach one register too far."""
    found = {unit.unit: _refused_reads(evidence, unit.unit, (_ILLEGAL_ADDRESS,)) for unit in evidence.units}
    beside = {
        unit: polls
        for unit, polls in found.items()
        if all(_beside(poll, _well(evidence, unit, (poll.function,))) for poll in polls)
    }
    yield from _suspicions(evidence, beside, 1.1)


def _refused_reads(evidence: Evidence, unit: int, codes: tuple[int, ...]) -> list[Poll]:
    return [poll for poll in _refused(evidence, unit, codes) if poll.function not in WRITES]


@suspect(
    "missing-registers",
    Severity.WARNING,
    blame="master",
    text="The client asks {units:unit|units} for registers that {units:|it does|they do} not have: {areas}[ and {more} more], refused "
    "{refused:,} of {asked:,} times (exception {codes})",
    share="{refused:,} of {asked:,} such requests to {units:unit|units}",
    deciding_test=_TEST,
    remedy="Remove these registers from the list, or correct their addresses or function using the device's manual[; "
    "ask "
    "instead: {asks}]",
    foretold=Foretold({Symptom.REFUSAL: ASKED_FOR}),
)
def missing_registers(evidence: Evidence) -> Iterator[Suspicion]:
    """Reads that are always refused, and writes for their address, of what does not read well either."""
    found = {}
    for unit in evidence.units:
        read_well = _writes(evidence, unit.unit)
        writes = (p for p in _refused(evidence, unit.unit, (_ILLEGAL_ADDRESS,)) if p.function in WRITES)
        found[unit.unit] = _refused_reads(evidence, unit.unit, _ILLEGAL) + [p for p in writes if p not in read_well]
    yield from _suspicions(evidence, found, 1.0)


@suspect(
    "read-only",
    Severity.WARNING,
    blame="master",
    text="The client writes registers of {units:unit|units} that it may only read: {areas}[ and {more} more], refused "
    "{refused:,} of {asked:,} times (exception {codes}), though they read well",
    share="{refused:,} of {asked:,} such requests to {units:unit|units}",
    deciding_test="Look in the manual of {units:unit|units} whether these registers may be written, and in which mode; a "
    "write for a test may start a machine",
    remedy="Remove the writes from the list, or unlock the device for writing (a parameter, a switch, remote mode)",
    foretold=Foretold({Symptom.REFUSAL: ASKED_FOR}),
)
def read_only(evidence: Evidence) -> Iterator[Suspicion]:
    """Writes that are always refused, where reading is not."""
    yield from _suspicions(evidence, {unit.unit: _writes(evidence, unit.unit) for unit in evidence.units}, 1.2)


def _writes(evidence: Evidence, unit: int) -> list[Poll]:
    """Refused writes of addresses that read well; one poll an address, whatever the values."""
    refused = [poll for poll in _refused(evidence, unit, _REFUSES) if poll.function in WRITES]
    return [
        poll
        for poll in refused
        if any(
            good.address <= poll.address and poll.end <= good.end
            for good in _well(evidence, unit, _READ_BY[poll.function])
        )
    ]
