"""The ledger as suspects see it: what is explained is left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Final

from dissectors.limits import EXCEPTION, MAX_ADU

from ..deframing.tap_clock import UNKNOWN
from .bits import surplus_bits
from .exchanges import Ending
from .ledger import Ledger
from .ledgerview import LedgerView, T
from .rawbytes import is_of_line
from .registry import Explained, Symptom
from .signatures import LONG, AnswerDamage, Behind, Signature, is_like_request
from .unitledger import UnitLedger

HEALTHY: Final = 0.004  # damaged exchanges of a line on which nothing is wrong
_AT_ONCE_CHARS: Final = 1.5
_STRAY: Final = (Behind.NOISE, Behind.ZEROS)
_TAILS: Final = 3
_OFTEN: Final = 0.2
_HALF: Final = 0.5
_MOSTLY: Final = 0.6
_SOON_CHARS: Final = 2.5  # nobody answers sooner
_STRAYED: Final = 2  # bytes
_OF_OPEN: Final = ("begun", "requests_overlaid")  # kept, and another where more is explained


def usual_rate(hits: float, trials: float) -> float:
    """The rate of a symptom that is nobody's in particular, by how often others show it."""
    return max(HEALTHY, (hits + 0.5) / (trials + 50))


class Evidence(LedgerView):
    """A ledger, less what is explained."""

    explained: Explained

    def __init__(self, ledger: Ledger) -> None:
        super().__init__(ledger)
        self.explained = frozenset()

    def without(self, explained: Explained) -> Evidence:
        """The same with more of it explained."""
        found = copy(self)  # what the ledger shows is not read again
        found.explained = self.explained | explained
        for name in _OF_OPEN:
            vars(found).pop(name, None)
        return found

    def is_open(self, symptom: Symptom, unit: int | None) -> bool:
        """Whether nothing has explained this symptom of a unit yet."""
        return (symptom, unit) not in self.explained

    def others(self, *units: UnitLedger) -> list[UnitLedger]:
        """The units that are polled besides these."""
        return [other for other in self.units if other not in units]

    def silent(self, unit: UnitLedger) -> int:
        """Requests without an answer that nothing explains; of two clocks only those of a unit that is never heard."""
        if not self.ordered and unit.answered + unit.loose:
            return 0
        return self.surely_silent(unit) if self.is_open(Symptom.SILENCE, unit.unit) else 0

    def damaged(self, unit: UnitLedger) -> int:
        """Answers that are none and that nothing explains; of those looked at, the share that is damaged indeed."""
        if not self.is_open(Symptom.DAMAGE, unit.unit) or not self.ordered:
            return 0
        count, samples = unit.count(Ending.GARBAGE), len(self.garbage(unit))
        return round(count * len(self.readings(unit)) / samples) if samples else count

    def hit(self, unit: UnitLedger) -> int:
        """Requests to a unit that came to nothing, or whose answers came damaged."""
        return self.silent(unit) + self.damaged(unit)

    def readings(self, unit: UnitLedger) -> list[Signature]:
        """Samples of damaged answers, read; those that are whole after all, though in pieces, are left out."""
        garbage = self.garbage(unit) if self.is_open(Symptom.DAMAGE, unit.unit) else []
        return [reading for reading in garbage if reading.damage is not AnswerDamage.NONE]

    def damaged_so(self, unit: UnitLedger, is_so: Callable[[Signature], bool]) -> float:
        """About how many damaged answers of a unit are damaged so."""
        readings = self.readings(unit)
        return self.damaged(unit) * sum(map(is_so, readings)) / max(len(readings), 1)

    def begun_by(self, reading: Signature) -> int | None:
        """Another unit that is polled, and by whose number and function a damaged answer begins, or what stands behind a
        good one; None for none."""
        begin = bytes(reading.heard[:2])
        return begin[0] if begin in self._begins and begin[0] != reading.request[0] else None

    @cached_property
    def begun(self) -> Counter[int]:
        """How many damaged answers of others, or bytes behind their good ones, begin by the number and function of each
        unit."""
        behind = [each for unit in self.units for each in self.followed(unit)]
        readings = [each for unit in self.units for each in self.readings(unit)]
        readings += [each for each in behind if not self.requests.begin(each.heard, each.request[0])]  # asked next
        return Counter(sender for reading in readings if (sender := self.begun_by(reading)) is not None)

    @cached_property
    def _begins(self) -> frozenset[bytes]:
        return frozenset(
            bytes((poll.unit, poll.function | error)) for poll in self.polls if poll.unit for error in (0, EXCEPTION)
        )

    def followed(self, unit: UnitLedger) -> list[Signature]:
        """Samples of good answers with something behind them, read."""
        return self.trailed(unit) if self.is_open(Symptom.BEHIND, unit.unit) else []

    def behind(self, unit: UnitLedger, *kinds: Behind) -> float:
        """About how many good answers have such a thing behind them."""
        return self.about(unit, lambda reading: reading.behind in kinds)

    def requests_behind(self, unit: UnitLedger) -> float:
        """About how many good answers have a damaged request behind them, known again or as long as one."""
        return self.about(unit, is_like_request)

    def about(self, unit: UnitLedger, is_so: Callable[[Signature], bool]) -> float:
        """About how many good answers have something behind them of which that is so."""
        readings = self.followed(unit) if self.ordered else []
        return unit.followed.offered * sum(map(is_so, readings)) / max(len(readings), 1)

    def tails(self, unit: UnitLedger) -> float:
        """About how many good answers run on, as where a second transmitter ends later: what comes right behind them is
        no request, no glitch of a driver that lets go or of noise, and seldom the same; 0 where most of it is."""
        readings = self.followed(unit) if self.ordered else []
        off = self.verdict.wait_ns if self.verdict.wait_ns < UNKNOWN else 0.0
        most = _AT_ONCE_CHARS * self.ledger.char_ns + off
        at_once = [each for each in readings if each.behind in _STRAY and 0 <= each.rested <= most]
        longer = sum(len(each.heard) > self._longest_request for each in at_once) >= _OFTEN * len(at_once)
        longest = MAX_ADU if longer or off <= self.ledger.char_ns else LONG  # or it may be a request
        found = [e.heard for e in at_once if len(e.heard) < longest and not is_of_line(e.heard)]
        if len(set(found)) < max(_TAILS, _HALF * len(found), _HALF * len(readings)):
            return 0.0
        return unit.followed.offered * len(at_once) / len(readings)

    def stray(self, unit: UnitLedger) -> float:
        """About how many good answers have bytes of the idle line behind them."""
        return max(self.behind(unit, *_STRAY) - self.tails(unit), 0.0)

    @cached_property
    def requests_overlaid(self) -> int:
        """How many of what stands behind good answers is longer without a silence than any request: two that were sent at
        once."""
        every = (each for unit in self.units for each in self.followed(unit))
        return sum(is_like_request(each) and each.most > self._longest_request for each in every)

    @cached_property
    def _longest_request(self) -> int:
        return max(map(len, self.ledger.polls.requests), default=0) + _STRAYED

    def elsewhere(self, unit: UnitLedger) -> float:
        """The rate at which the answers of other units are damaged, those apart that have a fault of their own by it; of
        nobody's doing at the least."""
        others = self.others(unit)
        others = [other for other in others if self.damaged(other) <= _HALF * other.asked] or others
        hits, trials = sum(map(self.damaged, others)), sum(other.asked for other in others)
        return max(HEALTHY, (hits + 0.5) / (trials + 0.5 / HEALTHY))

    def is_too_soon(self, unit: UnitLedger) -> bool:
        """Whether the garbage behind requests to a unit begins before it can answer, and is no whole answer
        that noise runs into: somebody else was sending already."""
        if not self.verdict.fine:
            return False
        soonest = min(unit.delays.quantile(0.05) or 0.0, _SOON_CHARS * self.ledger.char_ns)
        readings = self.readings(unit)
        found = sum(0 <= each.delay < soonest and each.length < each.due - 1 for each in readings)
        return found >= max(_TAILS, _MOSTLY * len(readings))

    def surplus(self, unit: UnitLedger) -> float:
        """How much likelier the damage of a unit is as its own than as everybody's, in bits."""
        if self.is_too_soon(unit):
            return 0.0
        return surplus_bits(self.damaged(unit), unit.asked, self.elsewhere(unit))


def alone_or_together(every: Sequence[T], sharing: Sequence[T]) -> list[list[T]]:
    """The groups to weigh: those that share it as one, if they are several, and each of the others by itself."""
    if len(sharing) < 2:
        return [[each] for each in every]
    return [*([each] for each in every if each not in sharing), list(sharing)]
