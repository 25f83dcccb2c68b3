"""Two clients on one line that know nothing of each other: what they meet in, and what else explains it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Final

from ...tables.findings import Severity
from ..bits import likelihood_bits, surplus_bits
from ..costs import LostAnswers, cost_of, kind_bits, kind_of, overlaid, share_of, together, twice
from ..evidence import HEALTHY, Evidence
from ..exchanges import Ending
from ..hits import (
    answers_too_many,
    by_another,
    evenness_bits,
    given_up_by_timer,
    interrupted,
    is_one_units,
    late_of_any,
    requests_evenness_bits,
    requests_part,
    spells_of_hits,
    timed_by_the_master,
)
from ..registry import OF_A_LINE, Explained, Suspicion, Symptom, suspect
from ..repeats import broadcasts_answered
from ..signatures import Behind, Signature
from ..unitledger import UnitLedger
from .common import examples

_LEAST: Final = 5
_MET: Final = 3  # times, that two are seen to send at once or to know nothing of each other
_MANY: Final = 10  # second answers of a unit,
_SOME: Final = 0.05  # of its requests
_UNLIKE_BITS: Final = 100.0  # by which the damage of some units is theirs: another master meets all alike
_SENT_INTO: Final = 0.15  # of damaged answers
_CROSSED: Final = 0.4  # of what is hit
_HASTY: Final = 0.35  # of the timeout: nobody gives up so soon
_CUT_SHORT_BITS: Final = 4.0
_AT_ONCE: Final = 0.1  # the same, by which times may be wrong
_COLLIDED: Final = {"crossed": 0.27, "cut": 0.17, "cut-short": 0.15, "whole": 0.22, "long": 0.07, "other": 0.03,
                    "middle": 0.03, "tail": 0.02, "head": 0.02, "ahead": 0.06, "bits": 0.01}  # fmt: skip
_RUN_INTO: Final = ("crossed", "cut", "cut-short")  # as a request that is sent into an answer leaves it
_ON_FRAMES: Final = 0.93  # of what collides
_NEARLY_ALL: Final = 0.8
_ALONE_BITS: Final = 12.0
_SEVERAL: Final = 4  # units: of fewer another master may well ask one alone
_OFTEN: Final = 0.3
_DISORDER: Final = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.LATENESS, Symptom.SILENCE, Symptom.DOUBLES, Symptom.MARKS,
                    Symptom.VALUES)  # fmt: skip


class _Meetings:
    """What the requests of two clients would meet in on this bus, of all its units: how often each, at most."""

    def __init__(self, evidence: Evidence) -> None:
        self.evidence = evidence
        self.units = [unit for unit in evidence.units if evidence.is_open(Symptom.DAMAGE, unit.unit)]
        self.early = {unit.unit: interrupted(evidence, unit) for unit in self.units}
        self.by_timer = [unit for unit in self.units if unit.late and given_up_by_timer(evidence, unit)]
        self.others = [
            unit for unit in self.units if unit not in self.by_timer
        ]  # what is late of these is not the timer's
        # a master that takes noise for an answer goes on before that comes
        self.misled = sum(unit.strayed + evidence.silent_but_for(unit, Behind.NOISE) for unit in self.units)

    @cached_property
    def late_of_any(self) -> float:
        return max(late_of_any(self.evidence) - self.misled, 0)

    @cached_property
    def sure(self) -> bool:
        """Whether no single client does so: where it is sure, it need not meet all units alike: slow ones are met most."""
        early = self.early.values()
        spread = sum(early) - max(early, default=0) >= _MET or not is_one_units(self.evidence)
        if sum(early) >= _MET and spread:  # two answers to one unit's requests drive a master on as well
            return True
        return self.late_of_any - max((unit.late for unit in self.others), default=0) >= _LEAST

    @cached_property
    def late(self) -> float:
        return max(sum(unit.late for unit in self.others) - self.misled, 0) if self.sure else self.late_of_any

    @cached_property
    def hasty(self) -> float:
        """Requests that came before an answer can be given up."""
        return sum(max(_hasty(self.evidence, unit), self.early[unit.unit]) for unit in self.units)

    @cached_property
    def own(self) -> dict[int, Sequence[Signature]]:
        """Damaged answers by unit that the client's own requests ran into."""
        return {unit.unit: timed_by_the_master(self.evidence, unit) for unit in self.units}

    @cached_property
    def damaged(self) -> int:
        """Damaged answers, without the client's own."""
        parts = ((unit, 1 - _part(self.evidence, unit, self.own[unit.unit])) for unit in self.units)
        return sum(round(self.evidence.damaged(unit) * part) for unit, part in parts)

    @cached_property
    def readings(self) -> list[Signature]:
        every = ((unit, each) for unit in self.units for each in self.evidence.readings(unit))
        return [each for unit, each in every if each not in self.own[unit.unit]]

    @cached_property
    def requests_behind(self) -> dict[int, float]:
        """Requests behind answers, by unit."""
        return {unit.unit: self.evidence.requests_behind(unit) for unit in self.units}

    @cached_property
    def requests(self) -> float:
        return sum(self.requests_behind.values())

    @cached_property
    def hit(self) -> list[UnitLedger]:
        """The units that are met at all."""
        signs: tuple[Callable[[UnitLedger], float], ...] = (
            self.evidence.damaged,
            lambda unit: unit.late,
            lambda unit: _hasty(self.evidence, unit),
            lambda unit: self.requests_behind[unit.unit],
        )
        return [unit for unit in self.units if any(sign(unit) > 0 for sign in signs)]

    @cached_property
    def behind(self) -> float:
        return sum(self.evidence.behind(unit, Behind.REQUEST, Behind.NOISE) for unit in self.units)

    @cached_property
    def hits(self) -> float:
        return min(self.hasty + self.late + self.behind + self.damaged, self.evidence.ledger.exchanges)

    @cached_property
    def crossed(self) -> float:
        """Requests that came while an answer was due, in damaged answers too."""
        into = share_of(self.readings, "crossed", "cut", "cut-short", "long")
        sent_into = max(into, overlaid(self.readings) / max(len(self.readings), 1))
        return self.hasty + self.late + self.requests + self.damaged * sent_into

    @cached_property
    def met(self) -> float:
        """Answers and requests that two sent at once."""
        met = min(overlaid(self.readings), sum(kind_of(each) in _RUN_INTO for each in self.readings))
        behind = surplus_bits(self.requests, self.damaged + self.requests, requests_part(self.evidence))
        if behind > _UNLIKE_BITS:
            return met + self.evidence.requests_overlaid  # what disturbs a line meets answers as well
        return met

    # What else explains it.

    def is_no_matter_of_clients(self) -> bool:
        """Frames without order, broadcasts or one request answered by many, or the damage of one unit."""
        if not self.evidence.ordered or broadcasts_answered(self.evidence):
            return True
        return any(answers_too_many(self.evidence, unit) for unit in self.units)

    def is_impatience(self) -> bool:
        """A client that gives up too soon runs into answers all alone."""
        return self.hasty + self.late < _MET and sum(unit.late for unit in self.by_timer) >= _MET

    def is_of_few_units(self) -> bool:
        """Where it is not sure, another client would meet all units alike."""
        if self.sure:
            return False
        unlike = min(evenness_bits(self.evidence), requests_evenness_bits(self.evidence)) < -_UNLIKE_BITS
        few = len(self.hit) < min(2, len(self.units))
        return few or unlike or _twice(self.evidence) or _is_one_late(self.evidence)

    def is_too_little(self) -> bool:
        """Hardly anything crossed an answer that was due."""
        least = _LEAST if self.sure else max(_LEAST, _CROSSED * self.hits)
        return self.crossed < least or not self.hasty + self.late + self.requests

    def is_damage_alone(self) -> bool:
        """One transmitter and a bad line do as well."""
        return self.hasty + self.late < _MET and self.met < max(_MET, _SENT_INTO * len(self.readings))

    @cached_property
    def bits(self) -> float:
        """What speaks for two clients."""
        damaged, behind = self.damaged + self.requests, self.damaged + self.behind
        bits = surplus_bits(self.hits, self.evidence.ledger.exchanges, HEALTHY) + kind_bits(self.readings, _COLLIDED)
        bits += overlaid(self.readings) + 2 * (self.hasty + self.late) + likelihood_bits(damaged, behind, _ON_FRAMES)
        bits -= likelihood_bits(damaged, behind, 0.5)
        bits += evenness_bits(self.evidence) / 2  # two cycles meet where they do, yet not at one unit only
        spells = spells_of_hits(self.evidence)[0]
        if not self.sure:  # of what is not seen two polls go on as they do
            return bits - spells
        # one of them comes later, or goes; no single master cuts short what it asked, whatever disturbs the line
        return bits + spells + _CUT_SHORT_BITS * sum(self.early.values())


@suspect(
    "two-masters",
    Severity.ERROR,
    blame="master",
    text="Two clients poll this line without knowing of each other: {crossed:,} requests came while an answer was due"
    "[, {damaged:answer|answers} {damaged:|is|are} cut or overlaid by one]",
    share="{hits:,} of {exchanges:,} exchanges, of {units_hit:unit|units}",
    deciding_test="Look for a second client: a panel, a service computer, a gateway, a program that was left running; "
    "one that controls something is taken off only with the operator's consent",
    remedy="Let one client poll and the other get its values from it, or put a gateway with several clients between",
    foretold=OF_A_LINE,
)
def two_masters(evidence: Evidence) -> Iterator[Suspicion]:
    """Requests while an answer is due, and what collides with them, for all units alike."""
    meetings = _Meetings(evidence)
    others = (
        meetings.is_no_matter_of_clients,
        meetings.is_impatience,
        meetings.is_of_few_units,
        meetings.is_too_little,
        meetings.is_damage_alone,
    )
    if any(explains_it() for explains_it in others):
        return
    explains = frozenset((kind, unit.unit) for unit in evidence.units for kind in _DISORDER)
    lost = _lost_to_each_other(evidence, explains)
    yield Suspicion(
        (),
        meetings.bits,
        explains,
        {
            "crossed": round(meetings.hasty + meetings.late + meetings.requests),
            "damaged": meetings.damaged,
            "hits": round(meetings.hits),
            "exchanges": evidence.ledger.exchanges,
            "units_hit": len(meetings.hit),
        },
        lost_answers=lost.answers,
        lost_ms=lost.ms,
        frames=examples(meetings.hit, Ending.GARBAGE),
    )


def _lost_to_each_other(evidence: Evidence, explains: Explained) -> LostAnswers:
    """What meets costs each of two masters a request; what one of them sends while the other waits only makes that one's
    answer late."""
    silences = frozenset(each for each in explains if each[0] is Symptom.SILENCE)
    met, silent = twice(evidence, cost_of(evidence, explains - silences)), cost_of(evidence, silences)
    lost = max(silent.answers - sum(unit.late for unit in evidence.units), 0)
    ms = 0.0 if not lost else None if silent.ms is None else silent.ms * lost / silent.answers
    return together((met, LostAnswers(lost, ms)))


def _is_one_late(evidence: Evidence) -> bool:
    """Whether one unit alone stays silent, more than its share, and what is heard in the place of others' answers and
    behind them begins as its answers do: it is late. Two masters leave all units silent."""
    begun = evidence.begun.most_common(1)
    if not begun or len(evidence.units) < _SEVERAL or begun[0][1] < max(_LEAST, _NEARLY_ALL * evidence.begun.total()):
        return False
    late = evidence.ledger.units[begun[0][0]]
    silent, asked = (
        sum(unit.count(Ending.SILENT) for unit in evidence.units),
        sum(unit.asked for unit in evidence.units),
    )
    mine = late.count(Ending.SILENT)
    return mine >= _NEARLY_ALL * silent and surplus_bits(mine, silent, late.asked / asked) >= _ALONE_BITS


def _twice(evidence: Evidence) -> bool:
    """Whether some units often answer one request twice, and rightly, for which no second master is needed."""
    return any(
        evidence.is_open(Symptom.DOUBLES, unit.unit)
        and max(unit.doubles, evidence.behind(unit, Behind.ANSWER), evidence.echoed_again(unit))
        >= max(_MANY, _SOME * unit.asked)
        for unit in evidence.units
    )


def _part(evidence: Evidence, unit: UnitLedger, some: Sequence[Signature]) -> float:
    """The share of a unit's damaged answers that these are."""
    return len(some) / max(len(evidence.readings(unit)), 1)


def _hasty(evidence: Evidence, unit: UnitLedger) -> int:
    """Requests behind which another one came sooner than a master gives up, who waits longer for answers that come."""
    timeout = 0.0 if evidence.timeout_ns is None else max(evidence.timeout_ns, evidence.patience_ns)
    if not timeout or not evidence.is_open(Symptom.SILENCE, unit.unit) or evidence.verdict.wait_ns > _HASTY * timeout:
        return 0
    waits = unit.quiet_waits.numbers  # what a master hears, though it is another answer, ends its waiting
    if not len(waits) or (evidence.verdict.wait_ns > _AT_ONCE * timeout and (waits <= 0).mean() > _OFTEN):
        return 0  # a tap that passes several requests on at once tells nothing of their waits
    hasty = float((waits < _HASTY * timeout).mean()) * by_another(evidence, unit, _HASTY * timeout)
    return round(len(unit.quiet_waits) * hasty)
