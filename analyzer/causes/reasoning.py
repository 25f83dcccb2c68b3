"""From a ledger to causes: the suspect that saves most bits is taken, what it explains is struck, and so on.

While evidence grows they are looked at again each time there is a fair part more of it, and only changes are told.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from concurrent.futures import Future
from contextvars import copy_context
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, NamedTuple

from captures.line import LineSettings

from ..failures import CAUSES, FailedPart, Failures
from ..options import Options
from ..tables.batch import Batch
from ..tables.taps import may_speak_of
from ..tables.transactions import TransactionRows
from .certainty import Clues, certainty, clues
from .evidence import Evidence
from .foretold import against_bits, struck
from .gathered import GATHERED, GatheredRows
from .ledger import Ledger
from .leftovers import Left, left_over
from .registry import Cause, Explained, Suspect, Suspicion, suspects, words_of
from .traits import Traits, sorts_of, traits_of

THRESHOLD: Final = 24.0  # bits under which nothing is said
_LEFT_OVER: Final = 0.06  # of what is explained: so much may be left because no explanation is perfect,
_LEFT_OVER_MOST: Final = 100.0  # and a cause of its own weighs more
_CAUSES_MOST: Final = 8
_HARDLY: Final = 0.06  # a claim no surer than that explains nothing
_LIKELIER_THAN_NOT: Final = 0.5
_LEAST: Final = 1e-6  # of an exchange: values show in none
_TWICE: Final = 2.0  # as likely must be what takes the place of the heaviest
_OF_NO_FRAME: Final = frozenset(("request-flaw",))


@dataclass(frozen=True, slots=True)
class Weighed:
    """A suspicion with the suspect that has it."""

    suspect: Suspect
    suspicion: Suspicion


def weigh(
    evidence: Evidence, among: Sequence[Suspect] | None = None, failures: Failures | None = None
) -> list[Weighed]:
    """All suspicions that explain something new, the heaviest first; `among`: the suspects looked at (all).

    Judges that failed are told by `failures`; those that are there already are not asked.
    """
    line = evidence.ledger.line
    looked_at = suspects() if among is None else among
    failures = Failures() if failures is None else failures
    found = list[Weighed]()
    for each in looked_at:
        if each.cause not in failures and may_speak_of(each.cause, line):
            with failures.contained(each.cause):
                found += [_weighed(evidence, each, suspicion) for suspicion in each.judge(evidence)]
    fresh = [weighed for weighed in found if not weighed.suspicion.explains <= evidence.explained]
    return sorted(fresh, key=lambda weighed: -weighed.suspicion.bits)


def _weighed(evidence: Evidence, suspect: Suspect, suspicion: Suspicion) -> Weighed:
    bits = suspicion.bits - suspicion.against - against_bits(evidence, suspect.foretold, suspicion)
    return Weighed(suspect, replace(suspicion, bits=bits))


class CauseClaim(NamedTuple):
    """A cause with what its certainty goes by."""

    cause: Cause
    clues: Clues
    traits: Traits
    struck: Explained  # what it explains of what was open


@dataclass(frozen=True, slots=True)
class Story:
    """What a ledger shows: causes, best first, and what none of them takes; judges that `failed` said nothing."""

    causes: list[Cause]
    not_explained: list[Left]
    failed: tuple[FailedPart, ...] = ()


def causes_of(ledger: Ledger) -> list[Cause]:
    """The causes that a ledger shows, best first; none where this is no Modbus, of which reports say what it is."""
    return story_of(ledger).causes


def story_of(ledger: Ledger, among: Sequence[Suspect] | None = None) -> Story:
    """The causes that a ledger shows, and what is left; `among`: the suspects looked at (all)."""
    evidence, failures = Evidence(ledger), Failures()
    if ledger.verdict.foreign:  # nothing is told of frames where none is, but of what spoils all of them
        among = [each for each in (suspects() if among is None else among) if each.cause in _OF_NO_FRAME]
        return Story([claim.cause for claim in claims_of(evidence, among, failures)], [], failures.parts)
    if ledger.lines.ports:  # several lines that are read as one bus tell no story together
        return Story([], [])
    claims = [claim for claim in claims_of(evidence, among, failures) if claim.cause.confidence > _HARDLY]
    return Story([claim.cause for claim in claims], left_over(evidence.without(_taken(claims))), failures.parts)


def claims_of(
    evidence: Evidence, among: Sequence[Suspect] | None = None, failures: Failures | None = None
) -> list[CauseClaim]:
    """The best suspicions, one after the other, each with what its certainty goes by."""
    found, least, left = list[_PickedCause](), THRESHOLD, evidence
    failures = Failures() if failures is None else failures
    for _ in range(_CAUSES_MOST):
        weighed = weigh(left, among, failures)
        if not weighed or weighed[0].suspicion.bits < least:
            break
        best = _likeliest(left, [each for each in weighed if each.suspicion.bits >= least])
        least = max(least, min(_LEFT_OVER * best.suspicion.bits, _LEFT_OVER_MOST))
        rival = _rival(best, weighed)
        takes = struck(left, best.suspect.foretold, best.suspicion) - left.explained
        found.append(_PickedCause(best, rival, left, takes))
        left = left.without(takes)
    but_for_others = [evidence.without(_taken(other for other in found if other is not each)) for each in found]
    return [_claim(each, but) for each, but in zip(found, but_for_others, strict=True)]


def _likeliest(evidence: Evidence, weighed: Sequence[Weighed]) -> Weighed:
    """The heaviest; where it is likelier not so, of those that explain some of what it does the one whose bits, as far as it
    is sure and explains the same, are most, if they are twice its own: bits tell that something is wrong more than what."""
    takes = weighed[0].suspicion.explains
    some = [each for each in weighed if each.suspicion.explains & takes]
    own = {each.suspect.cause: _certainty(evidence, each, _rival(each, weighed)) for each in some[::-1]}
    sure = {each.suspect: max(own[each.suspect.cause], own.get(each.suspect.foretold.kind_of, 0.0)) for each in some}
    first = some[0]
    if sure[first.suspect] >= _LIKELIER_THAN_NOT:
        return first

    def weight(each: Weighed) -> float:
        shared = _exchanges(evidence, takes & each.suspicion.explains) + _LEAST
        return each.suspicion.bits * sure[each.suspect] * shared * _TWICE ** (each is first)

    return max(some, key=weight)


def _exchanges(evidence: Evidence, explains: Explained) -> float:
    """About how many exchanges show what is explained."""
    units = {number for _, number in explains if number is not None} & evidence.ledger.units.keys()
    sorts = ((number, sort) for number in units for sort in sorts_of(evidence, evidence.ledger.units[number]))
    return sum(count for number, (symptom, _, count) in sorts if (symptom, number) in explains)


def _rival(one: Weighed, weighed: Sequence[Weighed]) -> Weighed | None:
    """The heaviest one of another cause that explains some of the same."""
    others = (each for each in weighed if each.suspect is not one.suspect)
    return next((each for each in others if each.suspicion.explains & one.suspicion.explains), None)


def _certainty(evidence: Evidence, one: Weighed, rival: Weighed | None) -> float:
    rival_bits = rival.suspicion.bits if rival else 0.0
    goes_by = clues(evidence, one.suspicion, one.suspect.foretold, rival_bits=rival_bits)
    return certainty(one.suspect.cause, goes_by, traits_of(evidence, one.suspicion))


class _PickedCause(NamedTuple):
    """The heaviest suspicion of what was open, and what it takes of that."""

    best: Weighed
    rival: Weighed | None
    evidence: Evidence
    struck: Explained


def _taken(found: Iterable[_PickedCause | CauseClaim]) -> Explained:
    return frozenset(symptom for each in found for symptom in each.struck)


def _claim(taken: _PickedCause, but_for_others: Evidence) -> CauseClaim:
    best, rival, evidence, _ = taken
    suspect, found, ledger = best.suspect, best.suspicion, evidence.ledger
    timed, rival_bits = ledger.timed, rival.suspicion.bits if rival is not None else 0.0
    goes_by = clues(evidence, found, suspect.foretold, rival_bits=rival_bits)
    traits = traits_of(but_for_others, found)
    words = words_of(suspect, found.numbers)
    cause = Cause(
        cause=suspect.cause,
        severity=(found.severity or suspect.severity).name.lower(),
        units=found.units,
        blame=suspect.blame,
        text=words.text,
        share=words.share,
        since_ns=found.since if timed else None,
        until_ns=found.until if timed else None,
        period_s=found.period_s if timed else None,
        confidence=round(certainty(suspect.cause, goes_by, traits), 3),
        runner_up=rival.suspect.cause if rival else None,
        deciding_test=words.deciding_test,
        remedy=words.remedy,
        lost_answers=found.lost_answers,
        lost_ms=min(found.lost_ms, ledger.span_ns / 1e6) if timed and found.lost_ms is not None else None,
        frames=found.frames,
        bits=round(found.bits, 1),
        explains=found.explains,
        numbers=found.numbers,
    )
    return CauseClaim(cause, goes_by, traits, taken.struck)


_FIRST: Final = 40  # exchanges before anything is said
_GROWTH: Final = 1.3  # of what was looked at last
_LOOK_EVERY: Final = 5000  # exchanges from one look to the next
_SURER: Final = 0.1  # of confidence, that is worth telling

State = Literal["new", "revised", "withdrawn"]


@dataclass(frozen=True, slots=True)
class CauseRevision:
    """What became of one cause: `revision` counts the looks that changed anything, from 1; `exchanges` is what it rests
    on."""

    revision: int
    state: State
    exchanges: int
    cause: Cause

    def to_json(self) -> dict[str, Any]:
        """As a line of `sniff --json`."""
        return {
            "kind": "cause",
            "revision": self.revision,
            "state": self.state,
            "exchanges": self.exchanges,
            **self.cause.to_json(),
        }


class RunningStory:
    """Rows as they come in; revisions of causes out. `causes` are those of the newest look.

    `aside`: a look goes on in a thread of its own, which takes most of a second at first, and its outcome comes with
    later rows: for who shows a live line. Otherwise what comes out hangs on the rows alone.
    """

    def __init__(
        self,
        line: LineSettings,
        options: Options = Options(),  # noqa: B008 - frozen
        *,
        aside: bool = False,
    ) -> None:
        self._options, self._aside = options, aside
        self._begin(line)
        self.revision = 0
        self.causes: list[Cause] = []
        self._failures = Failures()

    def _begin(self, line: LineSettings) -> None:
        self._ledger, self._next = Ledger(line, self._options), _FIRST
        self._waiting = GatheredRows()  # not in the ledger yet
        self._going: Future[list[Cause]] | None = None  # a look of the ledger, to which nothing is added meanwhile

    def feed(self, batch: Batch, transactions: TransactionRows, line: LineSettings) -> list[CauseRevision]:
        """The next rows, of a line of these settings; where those are others than before, all begins anew."""
        if line != self._ledger.line:
            self._begin(line)
        if CAUSES in self._failures:
            return []
        self._waiting.add(batch, transactions)
        with self._failures.contained(CAUSES):
            return self._looked()
        return []

    def _looked(self) -> list[CauseRevision]:
        """What a look shows that is over by now, or is due."""
        if self._going is not None:
            return self._told(self._going.result()) if self._going.done() else []
        if self._waiting.rows < min(GATHERED, self._next - self._ledger.exchanges):
            return []  # an exchange has a row of its own
        self._waiting.enter(self._ledger)
        if self._ledger.exchanges < self._next:
            return []
        self._next = self._ledger.exchanges + min(int((_GROWTH - 1) * self._ledger.exchanges), _LOOK_EVERY)
        if not self._aside:
            return self._told(causes_of(self._ledger))
        self._going = _look_aside(self._ledger)
        return []

    def close(self) -> list[CauseRevision]:
        """No more comes."""
        if CAUSES in self._failures:
            return []
        told = list[CauseRevision]()
        with self._failures.contained(CAUSES):
            told += [] if self._going is None else self._told(self._going.result())
            self._waiting.enter(self._ledger)
            self._ledger.close()
            told += self._told(causes_of(self._ledger))
        return told

    def _told(self, causes: list[Cause]) -> list[CauseRevision]:
        """What a look shows that the one before did not."""
        self._going = None
        old = {_key(cause): cause for cause in self.causes}
        self.causes = causes
        new = {_key(cause): cause for cause in self.causes}
        changed: list[tuple[State, Cause]] = [("withdrawn", old[key]) for key in old if key not in new]
        for key, cause in new.items():
            before = old.get(key)
            if before is None:
                changed.append(("new", cause))
            elif abs(cause.confidence - before.confidence) >= _SURER or cause.units != before.units:
                changed.append(("revised", cause))
        self.revision += bool(changed)
        return [CauseRevision(self.revision, state, self._ledger.exchanges, cause) for state, cause in changed]


def _look_aside(ledger: Ledger) -> Future[list[Cause]]:
    """The causes of a ledger, in a thread; in the language in use."""
    found: Future[list[Cause]] = Future()

    def look() -> None:
        try:
            found.set_result(causes_of(ledger))
        except BaseException as error:  # raised again where it is told
            found.set_exception(error)

    threading.Thread(target=copy_context().run, args=(look,), daemon=True).start()
    return found


def _key(cause: Cause) -> tuple[str, tuple[int, ...]]:
    return cause.cause, cause.units[:1]
