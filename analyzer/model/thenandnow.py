"""Then and now: two captures of one bus, or two spans of one capture, and what is otherwise.

New, gone, worse and better is what two reports tell; polls and values are compared here. A value has moved where
what was read of it now lies further from what was read then than either varies: what merely wanders is no news.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..languages import counted, tr
from ..reports.against import differences
from .bus import Bus
from .meanings import BIT_AREAS, Meanings, NamedReading
from .polls import TransactionValues
from .scope import ScopedFigures
from .search import for_test
from .selection import in_span

if TYPE_CHECKING:
    from ..reports.model import Report
    from .pollwatch import PollKey, PollLog
    from .registers import RegisterLog, Spot
    from .source import ViewSource

_FEW: Final = 3  # requests, so that a poll is one
_SLOWER: Final = 1.5  # times
_LEAST_TIMES: Final = 20
_Readings = NDArray[np.uint16]  # a line each
_ORDER: Final = ("new", "worse", "moved", "better", "gone")


@dataclass(frozen=True, slots=True)
class Compared:
    """One of the two."""

    name: str
    report: Report
    registers: RegisterLog
    watched: PollLog


@dataclass(frozen=True, slots=True)
class Change:
    """One thing that is otherwise: `kind` is new, worse, moved, better or gone, `text` has the numbers of both."""

    kind: str
    about: str
    text: str
    units: tuple[int, ...] = ()
    spot: Spot | None = None


def whole_side(bus: Bus, source: ViewSource) -> Compared:
    """A bus as far as it is known."""
    return Compared(source.name, bus.report(source, story=True), bus.registers, bus.watched)


def span_side(bus: Bus, source: ViewSource, span: tuple[int, int], name: str, stop: Callable[[], bool]) -> Compared:
    """A span of it."""
    figures = ScopedFigures(bus, for_test(in_span(*span))(bus, 0, bus.count), stop)
    return Compared(name, figures.report(source), figures.registers, figures.watched)


def read_side(source: ViewSource, stop: Callable[[], bool]) -> Compared:
    """Another capture, read to its end. Raises what is wrong with it."""
    bus = Bus.of(source)
    for analysed in source.steps(stop):
        bus.feed(analysed)
    bus.close()
    return whole_side(bus, source)


def changes(now: Compared, then: Compared, meanings: Meanings) -> list[Change]:
    """What is otherwise, new and worse first."""
    told = [Change(each.change, each.about, each.text, each.units) for each in differences(now.report, then.report)]
    if not any(each.about == "poll" for each in told):
        told += _polls(now.watched, then.watched)
    told += [*_slower(now.watched, then.watched), *_moved(now.registers, then.registers, meanings)]
    return sorted(told, key=lambda each: _ORDER.index(each.kind))


def _polls(now: PollLog, then: PollLog) -> Iterator[Change]:
    new, old = ({poll.key: poll for poll in log if poll.facts.asked >= _FEW} for log in (now, then))
    for kind, words, here, there in (
        ("new", "{poll} is polled now ({requests})", new, old),
        ("gone", "{poll} is no longer polled ({requests} before)", old, new),
    ):
        for key in sorted(here.keys() - there.keys()):
            requests = counted(here[key].facts.asked, "request", "requests")
            yield Change(kind, "poll", tr(words, poll=_called(key), requests=requests), (key.unit,))


def _slower(now: PollLog, then: PollLog) -> Iterator[Change]:
    """Polls that are asked at another pace."""
    old = {poll.key: poll for poll in then}
    for poll in now:
        before = old.get(poll.key)
        every, was = poll.every_ns, None if before is None else before.every_ns
        if before is None or not every or not was or min(len(poll.intervals), len(before.intervals)) < _LEAST_TIMES:
            continue
        if max(every, was) > _SLOWER * min(every, was):
            text = tr(
                "{poll} is asked every {now}, was {then}", poll=_called(poll.key), now=_time(every), then=_time(was)
            )
            yield Change("worse" if every > was else "better", "poll", text, (poll.key.unit,))


def _moved(now: RegisterLog, then: RegisterLog, meanings: Meanings) -> Iterator[Change]:
    parts: set[Spot] = set()
    for spot in now.spots():
        if spot in parts:
            continue
        meaning = meanings.at(spot)
        unit, area, address = spot
        parts.update((unit, area, address + k) for k in range(1, meaning.words))
        sides = [_held(log, spot, meaning.words) for log in (now, then)]
        if not all(len(side) for side in sides) or not _apart(
            *sides, is_number=meaning.is_number, meanings=meanings, spot=spot
        ):
            continue
        reading, was = (_reading(spot, side[-1].tolist(), meanings) for side in sides)
        name = f"{reading.register} {reading.meaning.name}".rstrip()
        text = tr("unit {unit}, {name}: was {then}, now {now}", unit=unit, name=name, then=was.text, now=reading.text)
        yield Change("moved", "value", text, (unit,), spot)


def _held(log: RegisterLog, spot: Spot, words: int) -> _Readings:
    """Some of what registers held, a line each, the newest last."""
    return log.samples(*spot, words)[1]


def _apart(
    now: _Readings,
    then: _Readings,
    *,
    is_number: bool,
    meanings: Meanings,
    spot: Spot,
) -> bool:
    """Whether what is read now lies further from what was read then than either reaches."""
    if not is_number or spot[1] < BIT_AREAS:
        return not {tuple(line) for line in now.tolist()} & {tuple(line) for line in then.tolist()}
    meaning = meanings.at(spot)
    new, old = (meaning.numbers(side) for side in (now, then))
    new, old = new[np.isfinite(new)], old[np.isfinite(old)]
    if not len(new) or not len(old):
        return False
    between = max(float(new.min() - old.max()), float(old.min() - new.max()))
    return between > max(float(np.ptp(new)), float(np.ptp(old)))


def _reading(spot: Spot, words: list[int], meanings: Meanings) -> NamedReading:
    unit, area, address = spot
    poll = TransactionValues(-1, -1, "", len(words), tuple(words), unit=unit, area=area, address=address)
    return next(meanings.readings(poll))


def _called(key: PollKey) -> str:
    told = tr("unit {unit}, function {function}", unit=key.unit, function=key.function)
    return f"{told}, {key.registers}" if key.register else told


def _time(ns: int) -> str:
    from ..words import short

    return short(ns)
