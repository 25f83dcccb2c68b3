"""What a ledger shows, whatever explains it: its clock, the master's habits, signatures, answers that read like requests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, wraps
from itertools import groupby
from operator import attrgetter
from typing import Any, Final, TypeVar, TypeVarTuple

import numpy as np

from dissectors.declaration import USER_DEFINED
from dissectors.lengths import Role, rule
from dissectors.limits import EXCEPTION

from ..deframing.tap_clock import MARGIN, UNKNOWN, USUAL_NS, TimeTrust, silences
from ..tables.schema import Float64s
from ..tables.transactions import ECHOED
from .contrasts import HITS_OF, NO_CONTRAST, Contrast, Family, contrasts
from .exchanges import Ending
from .exchangetable import AskedRows
from .flatmemory import Spells, densest
from .foreignframes import foreign_frames
from .ledger import Ledger
from .polls import Poll
from .rawbytes import LOW_ONCE, KnownRequests, is_in_ascii, is_of_line
from .registry import Symptom
from .samples import Sample
from .signatures import AnswerDamage, Behind, Signature, held_ns, signature
from .unitledger import AT_ONCE_NS, UnitLedger

_WAITS: Final = 3  # that tell a timeout, or how long a tap holds bytes back
_WHOLE: Final = 30  # answers of a unit, by which it is known what stands in them
_FAR: Final = 3.0  # times as long
_LATENCY_NS: Final = 20e6  # no adapter holds bytes back for longer that come one behind the other
_MOST_HELD: Final = 0.9
_TIMED: Final = 6  # waits
_TIMER: Final = 0.015  # of a time, by which a timer's strays,
_COARSEST: Final = 0.2  # or what shows it
_HALF: Final = 0.5
_AS_LATE: Final = 0.95
_UNPAIRED: Final = 0.25  # of the times that a poll comes
_MOSTLY: Final = 0.6
_FEW_STRAYS: Final = 4  # bytes
_BY_CHANCE: Final = 0.01  # of all bytes


V = TypeVar("V", bound="LedgerView")
Ts = TypeVarTuple("Ts")
T = TypeVar("T")


def kept(reckon: Callable[[V, *Ts], T]) -> Callable[[V, *Ts], T]:
    """Reckons each thing once, for it is asked for by many suspects and again when some of it is explained."""

    @wraps(reckon)
    def known(view: V, *of: *Ts) -> T:
        key = reckon, of
        if key not in view.known_so_far:
            view.known_so_far[key] = reckon(view, *of)
        found: T = view.known_so_far[key]
        return found

    return known


class LedgerView:
    """A ledger, read."""

    ledger: Ledger
    known_so_far: dict[Any, Any]

    def __init__(self, ledger: Ledger) -> None:
        self.ledger, self.known_so_far = ledger, {}

    @cached_property
    def units(self) -> list[UnitLedger]:
        """Units that are polled; none where next to nothing is a frame, for chance makes right check values."""
        ledger = self.ledger
        return ledger.polled if ledger.right_bytes > _BY_CHANCE * ledger.bytes else []

    @cached_property
    def verdict(self) -> TimeTrust:
        """What the tap's times can carry; not so much where it was seen to hold parts of frames back for longer than that,
        as a converter does that waits for a full packet; more where it is some units whose answers have holes."""
        if not self.ledger.timed:
            return TimeTrust()
        found = self.ledger.clock.newest()
        if not found.fine and self.tap_holes_ns < found.wait_ns:
            return replace(found, wait_ns=max(min(MARGIN * self.tap_holes_ns, found.wait_ns), USUAL_NS))
        samples = [] if found.fine else [each for unit in self.ledger.polled for each in unit.samples.kept]
        held = [ns for each in samples if (ns := held_ns(each, self.requests)) > found.wait_ns]
        return replace(found, wait_ns=float(np.quantile(held, _MOST_HELD))) if len(held) >= _WAITS else found

    @cached_property
    def tap_holes_ns(self) -> float:
        """The longest silence inside answers that may be the tap's: what stands in some units' answers, and in those of
        others that are as long never does, is not, but for what an adapter's timer makes. Infinite where units are alike."""
        table, whole = self.ledger.table, dict[int, AskedRows]()
        for unit in self.ledger.polled:
            rows = table.of(unit.unit)
            if np.count_nonzero(rows.good) >= _WHOLE:
                whole[unit.unit] = rows[rows.good]
        longest = {unit: float(rows.hole.max()) for unit, rows in whole.items()}
        most = max(longest.values(), default=0.0)
        torn = [rows for unit, rows in whole.items() if _FAR * longest[unit] > most]
        at = min((int(np.median(rows.hole_at[rows.hole > most / _FAR])) for rows in torn), default=0)
        quiet = [unit for unit, rows in whole.items() if _FAR * longest[unit] <= most and rows.due.max() > at]
        return max((longest[unit] for unit in quiet), default=UNKNOWN) if most > _LATENCY_NS else UNKNOWN

    @cached_property
    def t35_ns(self) -> float | None:
        """The silence between frames; None where the line's speed is not known."""
        found = silences(self.ledger.line, self.ledger.options)[1]
        return None if found == UNKNOWN else found

    @cached_property
    def load(self) -> float | None:
        """Share of the time that bytes take; None where nobody knows."""
        if not self.ledger.line.baud or not self.ledger.span_ns:
            return None
        return self.ledger.bytes * self.ledger.char_ns / self.ledger.span_ns

    @kept
    def rows(self, unit: int) -> AskedRows:
        """The exchanges of a unit, or an even part of them."""
        table = self.ledger.table
        return table.even(table.of(unit))

    def waits_in_vain(self, poll: Poll) -> Float64s:
        """From requests of a poll that stayed without an answer to the next request of any (ns)."""
        rows = self.rows(poll.unit)
        mine = (rows.function == poll.function) & (rows.address == poll.address) & (rows.quantity == poll.quantity)
        found: Float64s = rows.wait[mine & (rows.outcome == Ending.SILENT) & (rows.wait >= 0)].astype(np.float64)
        return found

    @kept
    def contrasts(self, symptom: Symptom, unit: int) -> list[Contrast]:
        """What a symptom of a unit hangs on, the best first."""
        rows = self.rows(unit)
        hits, of = HITS_OF[symptom](rows)
        return contrasts(rows[of], hits[of], self.ledger.char_ns * _HALF)

    def best_contrast(self, symptom: Symptom, unit: int, *families: Family) -> Contrast:
        """The best of them, of these families (all)."""
        fit = (each for each in self.contrasts(symptom, unit) if not families or each.family in families)
        return next(fit, NO_CONTRAST)

    def known(self, unit: UnitLedger) -> int:
        """Requests to a unit of which it is known whether they were answered."""
        return unit.asked - unit.count(Ending.SILENT) + self.surely_silent(unit)

    @kept
    def surely_silent(self, unit: UnitLedger) -> int:
        """Requests without an answer, those apart that may have had one which reads like the next request."""
        doubtful = sum(poll.count(Ending.SILENT) for poll in self._in_pairs(unit))
        silent = unit.count(Ending.SILENT) - max(doubtful, self.echoed_again(unit))
        return silent + self.silent_but_for(unit, Behind.NOISE)

    def _echoes_itself(self, unit: UnitLedger) -> bool:
        return unit.echoes_itself and self.verdict.wait_ns < AT_ONCE_NS

    def echoed_again(self, unit: UnitLedger) -> int:
        """What reads like requests without an answer that come again far sooner than the master gives up: answers more
        than one, each of which reads like the request."""
        if not self.ordered or self._in_pairs(unit):
            return 0
        if self._echoes_itself(unit):
            return len(unit.echo_waits)
        return round(len(unit.echo_waits) * unit.echo_waits.below(self._soon_ns)) if self._tells_haste else 0

    @kept
    def _in_pairs(self, unit: UnitLedger) -> list[Poll]:
        """Polls that come twice each time, far sooner than the master gives up or by a clock that does not tell, and whose
        answer is the request once more: the second is the answer, or nobody knows."""
        waits = unit.echo_waits.quantile(0.9)
        soon = unit.echoes_itself or (waits is not None and waits < self._soon_ns)
        if self._tells_haste and not soon:
            return []
        twice = [poll for poll in self.polls_of(unit.unit) if ECHOED[poll.function] and poll.repeats]
        groups = [(poll, poll.asked - poll.repeats) for poll in twice]
        return [each for each, of in groups if abs(each.asked + each.count(Ending.OK) - 2 * of) <= _UNPAIRED * of]

    @cached_property
    def _tells_haste(self) -> bool:
        """Whether the clock tells what comes at once from what comes when the master has given up."""
        return self.verdict.fine or self.verdict.wait_ns < self._soon_ns

    @property
    def _soon_ns(self) -> float:
        """What comes sooner does so before the master gives up; 0 where nobody knows."""
        return _HALF * (self.timeout_ns or 0.0)

    def silences(self, unit: UnitLedger) -> Spells:
        """When a unit was silent. Where the clock does not tell how soon an answer came, one that is its request once more
        may be that request, asked again: it ends no silence of a unit that answers otherwise."""
        if self._in_pairs(unit):
            return unit.silences_of_others
        repeats = unit.answered >= 2 * unit.echoes
        if self._tells_haste:  # some come when the master repeats what it asked
            late = unit.echo_delays.above(_AS_LATE * (self.timeout_ns or UNKNOWN))
            repeats = late > 0 and unit.answered > unit.echoes
        return unit.silences_but_echoes if repeats else unit.silences

    def unanswered(self, unit: UnitLedger) -> int:
        """Requests without a byte of an answer, but for those whose answer is the request once more: two answers to one of
        them read like a request that stayed without and another that did not."""
        silent = sum(poll.count(Ending.SILENT) for poll in self.polls_of(unit.unit) if not ECHOED[poll.function])
        return silent + self.silent_but_for(unit, Behind.NOISE)

    @kept
    def garbage(self, unit: UnitLedger) -> list[Signature]:
        """Samples of requests behind which bytes came and no answer, read."""
        return [self._read(sample) for sample in unit.samples.kept if sample.outcome == Ending.GARBAGE]

    @kept
    def trailed(self, unit: UnitLedger) -> list[Signature]:
        """Samples of good answers with something behind them, read."""
        return [self._read(sample) for sample in unit.followed.kept]

    def silent_but_for(self, unit: UnitLedger, kind: Behind) -> int:
        """About how many requests to a unit were not answered, though something came: another request, which a tap handed
        over in pieces, or noise, what a line makes that nobody drives."""
        garbage = self.garbage(unit)
        found = sum(each.damage is AnswerDamage.NONE and each.behind is kind for each in garbage)
        return round(unit.count(Ending.GARBAGE) * found / max(len(garbage), 1)) if self.ordered else 0

    def _read(self, sample: Sample) -> Signature:
        found = signature(sample, self.ledger.char_ns, self.requests, off_ns=self.verdict.wait_ns)
        strays = found.damage is AnswerDamage.WHOLE and found.length <= _MOSTLY * found.due
        if strays and (LOW_ONCE.issuperset(found.heard) or self._is_noise_where_nobody_answers(sample, found)):
            return replace(found, damage=AnswerDamage.NONE, behind=Behind.NOISE)
        return found

    def _is_noise_where_nobody_answers(self, sample: Sample, found: Signature) -> bool:
        """Whether a few bytes stand now and then where a unit that was never heard should answer: one that sends by other
        settings does so each time, and about as long as an answer."""
        unit = self.ledger.units[sample.unit]
        seldom = unit.count(Ending.GARBAGE) <= _HALF * unit.asked and not unit.answered
        return seldom and (is_of_line(found.heard) or found.length <= min(_FEW_STRAYS, _HALF * found.due))

    @cached_property
    def requests(self) -> KnownRequests:
        """What is asked on this bus, by which a request that collides with something is known again."""
        return KnownRequests.of(self.ledger.polls.sure_requests)

    @cached_property
    def polls(self) -> list[Poll]:
        """What is asked for, by unit, function and address."""
        return self.ledger.polls.polls()

    def polls_of(self, unit: int) -> list[Poll]:
        """What one unit is asked for."""
        return self._polls_by_unit.get(unit, [])

    @cached_property
    def _polls_by_unit(self) -> dict[int, list[Poll]]:
        return {unit: list(polls) for unit, polls in groupby(self.polls, key=attrgetter("unit"))}

    @cached_property
    def foreign(self) -> tuple[str, int]:
        """The protocol whose frames stand among the bytes in no frame, and how many of those looked at; ("", 0)."""
        return foreign_frames(self.ledger, in_ascii=any(map(is_in_ascii, self.ledger.polls.sure_requests)))

    @cached_property
    def declared_bytes(self) -> int:
        """Bytes in right frames of functions whose lengths are known: those of others chance makes of any bytes."""
        sizes = self.ledger.function_bytes
        seen = np.flatnonzero(sizes).tolist()
        return sum(int(sizes[code]) for code in seen if rule(code & ~EXCEPTION, Role.REQUEST) is not None)

    @cached_property
    def odd(self) -> int:
        """Right frames of functions that nobody has declared and that are not free for users."""
        counts = self.ledger.functions
        strange = [code for code in np.flatnonzero(counts).tolist() if rule(code, Role.REQUEST) is None]
        return sum(int(counts[code]) for code in strange if code not in USER_DEFINED)

    @property
    def ordered(self) -> bool:
        """Whether the order of frames is the line's: two taps are two clocks."""
        return len(self.ledger.ports) < 2 or self.verdict.fine

    @cached_property
    def timeout_ns(self) -> float | None:
        """What the master waits for an answer, to its next request: the densest of the waits that ended in silence, and
        no less than it does wait for answers."""
        told = [u.plain_waits if self._echoes_itself(u) else u.waits for u in self.ledger.units.values()]
        numbers = np.concatenate([np.zeros(0), *(each.numbers for each in told)])
        if np.count_nonzero(numbers > 0) < _WAITS:
            return None
        usual = densest(numbers)
        reach = max(_TIMER * usual, min(self.verdict.wait_ns, _COARSEST * usual))
        if np.count_nonzero(np.abs(numbers - usual) < reach) >= max(_TIMED, _MOSTLY * len(numbers)):
            return usual  # a timer's: what comes later than it is no answer that anybody waits for
        patient = numbers[numbers > self.patience_ns]
        if np.count_nonzero(patient > 0) >= _WAITS:
            return densest(patient)
        return usual if usual >= _HALF * self.patience_ns else None  # or it would hardly ever get an answer

    @cached_property
    def patience_ns(self) -> float:
        """What the master is seen to wait for answers that come; 0 where nobody knows."""
        known = [unit for unit in self.units if unit.answered > unit.echoes or unit.count(Ending.SILENT) <= unit.echoes]
        return max((unit.delays.quantile(0.9) or 0.0 for unit in known), default=0.0)
