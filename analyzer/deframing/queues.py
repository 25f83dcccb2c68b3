"""Which of its requests a unit answers: paths over time, weighed by header, order and content.

A unit answers in the order in which it was asked. After a silence nobody knows whether it lost the request or answers
it late; behind that every answer may be to the request before the one that it seems to follow. A path says for each
answer which request it is of. To lose a request and to answer it late cost the same; what costs is an answer that was
given twice, one that nobody asked for, and a request that the client was content with and nobody ever answered. What an
answer holds is weighed by `contents`. A unit takes about as long for one answer as for the next: a path on which it
is far less steady than where each answer is of the newest request is less likely (`_unsteadiness`). Paths are
compared over some answers; where none leads by `LEAD_BITS`, nobody can tell.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from math import log2
from operator import itemgetter
from typing import Final, NamedTuple

from dissectors.lengths import Expectation

from ..tables.transactions import LATE_NS, LATE_WAITS, LONGEST_NS
from .contents import MOST_BITS

LEAD_BITS: Final = 6.0
_HOPELESS_BITS: Final = 24.0
_TWICE_BITS: Final = 10.0  # an answer to a request that was answered,
_TWICE_AGAIN_BITS: Final = 5.0  # from a unit that did so before: too little to be certain by
_ALIEN_BITS: Final = 20.0  # one to none that is known
_FORGOTTEN_BITS: Final = 3.0  # one to a request that is too long ago, where such may be open
_TOO_LATE_BITS: Final = 10.0  # one that the client would long have given up: it was away, or the tap held bytes back
_NEVER_BITS: Final = 1e6
_BROKEN_BITS: Final = 8.0  # one to a request that came broken, where something like it was
_LOST_BITS: Final = 8.0  # requests lost that the client took for answered, some in a row
_OVERDUE_BITS: Final = 4.0  # an answer that took much longer than any on its path
_OVERDUE: Final = 3  # times as long,
_SLACK_NS: Final = 100_000_000  # and so much longer
_SERVICES: Final = 8  # of a path that are looked at,
_SERVICES_LEAST: Final = 4
_STEADY_NS: Final = 4_000_000  # nothing is steadier than this: adapters hold reads back
_UNSTEADY_MOST: Final = 8.0  # bits
_LONG_AGO: Final = -(1 << 62)
_FOREVER: Final = 1 << 62  # ns
_OVER_BITS: Final = 14.0  # a path so far behind is no doubt: each answer begins one by which it is of nobody
_PATHS: Final = 16
ASKS: Final = 64  # requests back that an answer may be of
_SAME: Final = 24  # requests for one poll alone: then it matters no more which of them an answer is of
_NONE: Final = -1


@dataclass(slots=True)
class AskedRequest:
    """A whole request to a unit."""

    number: int  # its frame's index
    start: int
    t_end_ns: int
    read: int  # that brought its last byte
    adu: bytes
    expects: Expectation
    t_next_ns: int | None = None  # when the client went on to another request
    taken: bool = False  # an answer came that the client takes for its own
    damaged: bool = False  # it was answered by something that came damaged
    answered: bool = False  # an answer is settled to be its own


@dataclass(slots=True)
class UnitHabit:
    """What a unit was seen to do, from one doubt to the next."""

    doubles: bool = False  # it gave an answer twice, for certain
    alike: bool = False  # its polls hold the same: an answer that is the one before once more is none


@dataclass(slots=True)
class PendingAnswer:
    """An answer of which it is not settled yet whose it is."""

    number: int  # its frame's index
    t_start_ns: int
    t_end_ns: int
    adu: bytes
    taken_for: int  # number of the request that the client takes it for, or -1
    measured: bool = True  # it began in another read than the newest request ended in: its time is its own
    again: bool = False  # it is the unit's answer before once more


class AnswerPath(NamedTuple):
    """Of each pending answer the number of the request that it is of (-1: of none), and what that costs in bits."""

    newest: int  # number of the last request that was answered; -1: of none
    cost: float
    slowest_ns: int  # of its answers
    chosen: tuple[int, ...]
    free_ns: int = _LONG_AGO  # when the last of them ended
    services: tuple[int, ...] = ()  # ns that each took of late, from its request or the answer before it
    is_behind: bool = False  # an answer is not of the newest request
    waited_ns: int = 0  # from its request to the last answer

    @property
    def spread(self) -> float:
        """By how much services differ from the middle one (ns), but for the quarter that differs most: a path may begin
        with an answer that came too late. 0 where they are too few."""
        count = len(self.services)
        if count < _SERVICES_LEAST:
            return 0.0
        middle = sorted(self.services)[count // 2]
        return max(sorted(abs(each - middle) for each in self.services)[count - 1 - count // 4], _STEADY_NS)


class SettledAnswer(NamedTuple):
    """Whose an answer is: `request` is -1 where it is of none, or nobody can tell (`unsure`)."""

    answer: PendingAnswer
    request: AskedRequest | None
    unsure: bool


Strangeness = Callable[[AskedRequest, bytes], float]


@dataclass(slots=True)
class UnitQueue:
    """The requests to one unit of late, and the paths of its answers."""

    asks: list[AskedRequest] = field(default_factory=list)
    paths: list[AnswerPath] = field(default_factory=lambda: [AnswerPath(_NONE, 0.0, 0, ())])
    behind: list[float] = field(default_factory=lambda: [0.0])  # bits by which each path is worse than the first
    pending: list[PendingAnswer] = field(default_factory=list)
    forgotten: int = _NONE  # number of the newest request that is too long ago to be looked at
    broken: list[int] = field(default_factory=list)  # numbers of frames behind which a request may have come broken
    habit: UnitHabit = field(default_factory=UnitHabit)

    def ask(self, ask: AskedRequest) -> None:
        """Another request."""
        self.asks.append(ask)
        chosen = {number for path in self.paths for number in path.chosen}
        while len(self.asks) > ASKS and self.asks[0].number not in chosen:
            self.forgotten = self.asks.pop(0).number
            self.broken = [number for number in self.broken if number > self.forgotten]

    def _strange_bits(self, answer: PendingAnswer, strangeness: Strangeness) -> list[tuple[AskedRequest, float]]:
        """The requests that an answer may be of, and how strange it would be for each; 0 where there is no choice."""
        oldest = min(path.newest for path in self.paths)
        fitting = [ask for ask in self.asks if ask.number >= oldest and ask.expects.fits(answer.adu)]
        polls = {ask.adu: ask for ask in fitting}
        bits = {adu: strangeness(ask, answer.adu) if len(polls) > 1 else 0.0 for adu, ask in polls.items()}
        return [(ask, bits[ask.adu]) for ask in fitting]

    def answer(self, answer: PendingAnswer, strangeness: Strangeness, *, timed: bool) -> None:
        """An answer: every path goes on to each request that it may be of."""
        asks = self.asks
        bits = self._strange_bits(answer, strangeness)
        least = min((strange for _, strange in bits), default=0.0)
        stranger = least if least >= MOST_BITS else _ALIEN_BITS  # if strange for all, it may be of one not here
        ways = [(ask, strange, *_waited(ask, answer, timed=timed)) for ask, strange in bits]
        numbers, measured = [ask.number for ask, _ in bits], timed and answer.measured
        paths: dict[tuple[int, tuple[int, ...]], AnswerPath] = {}
        for path in self.paths:
            lost = next((ask.number for ask in asks if ask.taken and ask.number > path.newest), answer.number)
            overdue_ns = _OVERDUE * path.slowest_ns + _SLACK_NS if timed and path.slowest_ns > 0 else _FOREVER
            services = path.services[1 - _SERVICES :]
            for ask, strange, waited, latest_ns, never in ways[bisect_left(numbers, path.newest) :]:
                number, is_behind = ask.number, ask is not asks[-1]
                if number == path.newest:
                    cost = (_TWICE_AGAIN_BITS if self.habit.doubles else _TWICE_BITS) + strange * (not answer.again)
                else:
                    cost = strange + _LOST_BITS * (lost < number)
                cost += path.cost + _TOO_LATE_BITS * (waited > latest_ns + path.waited_ns) + never
                cost += _OVERDUE_BITS * (is_behind & (waited > overdue_ns))
                took = answer.t_start_ns - max(ask.t_end_ns, path.free_ns)
                _put(paths, AnswerPath(
                    number, cost, max(path.slowest_ns, waited), (*path.chosen, number), answer.t_end_ns,
                    (*services, took) if measured else path.services, path.is_behind | is_behind, waited,
                ))  # fmt: skip
            broken = next((number for number in self.broken if number > path.newest), _NONE)
            missed = _BROKEN_BITS if broken > path.newest else stranger
            unknown = _FORGOTTEN_BITS if path.newest < self.forgotten else missed
            newest, chosen = max(path.newest, broken), (*path.chosen, _NONE)
            _put(paths, path._replace(newest=newest, cost=path.cost + unknown, chosen=chosen))
        self.pending.append(answer)
        self._keep(paths)

    def _keep(self, paths: dict[tuple[int, tuple[int, ...]], AnswerPath]) -> None:
        """The few of these that are worth going on with, the best first: of equal ones that of newer requests."""
        ranked = sorted(zip(_totals(paths.values()), paths.values(), strict=True), key=itemgetter(0))
        equal = bisect_right(ranked, ranked[:_PATHS][-1][0], key=itemgetter(0))  # with the last one that may stay
        ranked = sorted(ranked[:equal], key=lambda pair: (pair[1].chosen, pair[1].newest), reverse=True)
        ranked = sorted(ranked, key=itemgetter(0))[:_PATHS]
        least = ranked[0][0]
        kept = [(bits - least, path) for bits, path in ranked if bits - least <= _HOPELESS_BITS]
        lowest = min(path.cost for _, path in kept)
        self.paths = [path._replace(cost=path.cost - lowest) for _, path in kept]
        self.behind = [bits for bits, _ in kept]

    def settled(self) -> list[SettledAnswer]:
        """The oldest answers of which all paths that may be right say the same."""
        found: list[SettledAnswer] = []
        while self.pending:
            best = self.paths[0].chosen[0]
            mine = self._known(best)
            for path, behind in zip(self.paths, self.behind, strict=True):
                if behind <= LEAD_BITS and path.chosen[0] != best:
                    other = self._known(path.chosen[0])
                    if mine is None or other is None or mine.adu != other.adu:
                        return found
            found.append(self._settle(mine, unsure=mine is None and self.pending[0].taken_for >= 0))
        return found

    def take_as_they_seem(self) -> None:
        """Every pending answer is of the request that the client takes it for: the unit's polls hold the same."""
        chosen = tuple(answer.taken_for for answer in self.pending)
        self.paths, self.behind = [AnswerPath(chosen[-1], 0.0, 0, chosen)], [0.0]
        self.habit.alike = True

    def give_up(self) -> SettledAnswer:
        """Nobody can tell whose the oldest answer is."""
        return self._settle(None, unsure=True)

    @property
    def plain(self) -> bool:
        """Whether all is as it should be: the newest that was taken for answered is, and no other path matters."""
        if self.pending or self.paths[0].newest < next((ask.number for ask in reversed(self.asks) if ask.taken), _NONE):
            return False
        return len(self.paths) == 1 or self.behind[1] >= _OVER_BITS or self._one_poll

    @property
    def _one_poll(self) -> bool:
        """Whether the unit was asked nothing else for long: then paths tell no more than which time of the same."""
        recent = self.asks[-_SAME:]
        return len(recent) == _SAME and all(ask.adu == recent[0].adu for ask in recent)

    def _known(self, number: int) -> AskedRequest | None:
        return next((ask for ask in self.asks if ask.number == number), None)

    def _settle(self, ask: AskedRequest | None, *, unsure: bool) -> SettledAnswer:
        answer = self.pending.pop(0)
        paths: dict[tuple[int, tuple[int, ...]], AnswerPath] = {}
        for path in self.paths:
            _put(paths, path._replace(chosen=path.chosen[1:]))
        self._keep(paths)
        return SettledAnswer(answer, ask, unsure)


def _waited(ask: AskedRequest, answer: PendingAnswer, *, timed: bool) -> tuple[int, int, float]:
    """How long an answer would have waited (ns), how long it may without a cost, and what it costs that it is far too
    late, in bits. In time is what comes soon enough after the client went on, if it did; behind an answer that waited
    it may be later by as much: units fall ever further behind."""
    waited = answer.t_start_ns - ask.t_end_ns
    if not timed:
        return waited, _FOREVER, 0.0
    waits = LONGEST_NS if ask.t_next_ns is None else max(LATE_NS, LATE_WAITS * (ask.t_next_ns - ask.t_end_ns))
    return waited, waits, _NEVER_BITS * (waited > LONGEST_NS)


def _totals(paths: Iterable[AnswerPath]) -> list[float]:
    """What each path costs, its unsteadiness beside those that are not behind included: to wait steadily behind an
    older request may be chance, of echoes as of clients that keep time."""
    paths = list(paths)
    steady = min((path.spread for path in paths if not path.is_behind and path.spread), default=0.0)
    return [
        path.cost + (_unsteadiness(len(path.services), path.spread / steady) if path.is_behind and steady else 0.0)
        for path in paths
    ]


def _unsteadiness(count: int, times: float) -> float:
    """Bits against so many services that differ so many times as much as those of another path: what is no more than
    twice as much is chance."""
    return min(count * (log2(times) - 1), _UNSTEADY_MOST) if times > 2 else 0.0


def _put(paths: dict[tuple[int, tuple[int, ...]], AnswerPath], path: AnswerPath) -> None:
    """Of paths that say the same the one that costs least."""
    key = path.newest, path.chosen
    if key not in paths or path.cost < paths[key].cost:
        paths[key] = path
