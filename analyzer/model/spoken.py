"""A capture read out line by line, for who hears a screen: causes first, then each transaction in words."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, tzinfo
from typing import TYPE_CHECKING

from dissectors.maps.files import UnitMaps
from dissectors.values import harmless

from ..languages import counted, page_words, tr, wording
from ..tables.schema import Kind, bounds_of
from ..tables.transactions import Status
from ..words import between, date_and_time, duration, is_clock, seconds, unit_word
from .bus import Bus
from .meanings import Meanings
from .polls import poll_values
from .scope import Scope
from .selection import compiled
from .table import RowState
from .thenandnow import changes, read_side, whole_side

if TYPE_CHECKING:
    from .source import ViewSource

_OUTCOMES = {
    Status.UNANSWERED: "no answer", Status.BROADCAST: "to all, no answer is due", Status.DAMAGED: "damaged answer",
    Status.UNHEARD: "an answer may have come unheard",
}  # fmt: skip
_SILENT, _REFUSED = "no-response", "exception"  # findings that tell the outcome themselves


def spoken(
    source: ViewSource,
    text: str = "",
    zone: tzinfo = UTC,
    stop: Callable[[], bool] = bool,
    *,
    charts: UnitMaps | None = None,
    then: ViewSource | None = None,
) -> Iterator[str]:
    """Lines without columns, marks or colours; `charts` say what registers mean, and `then` is an earlier capture to
    compare with. Raises analyzer.filters.FilterError."""
    bus, charts = Bus.of(source), charts or UnitMaps()
    scope = Scope(compiled(text, source.line, charts) if text else None)
    for analysed in source.steps(stop):
        bus.feed(analysed)
    bus.close()
    _, transactions = scope.selections(bus)
    transactions.extend()
    causes = bus.causes()
    yield f"{source.name}: {counted(bus.frames, 'frame', 'frames')}, {counted(bus.found.count, 'finding', 'findings')}"
    if not bus.frames:
        yield from _instead(bus, source)
    if causes or bus.frames:
        yield f"{counted(len(causes), 'cause', 'causes')}." if causes else tr("No cause of trouble.")
    for number, cause in enumerate(causes, 1):
        yield tr(
            "Cause {number}, {severity}, {sure}: {text}. To do: {remedy}",
            number=number, severity=tr(cause.severity), sure=cause.sure, text=cause.text, remedy=cause.remedy,
        )  # fmt: skip
    if not bus.frames:
        return
    meanings = Meanings(bus, dict, lambda: charts.of)
    if meanings.is_due(often=True):
        meanings.use_meanings(meanings.ask(stop))
    if then is not None:
        yield from _otherwise(bus, source, then, meanings, stop)
    yield from _polls(bus, meanings)
    which = tr(" with {filter}", filter=text) if text else ""
    yield f"{counted(transactions.count, 'transaction', 'transactions')}{which}."
    for row in transactions.rows().tolist():
        yield transaction_words(bus, row, zone)


def _instead(bus: Bus, source: ViewSource) -> Iterator[str]:
    """What the report says where no frame is."""
    from ..reports.page import facts, nothing

    report = bus.report(source)
    yield nothing(report)
    for label, words in facts(report):
        yield f"{page_words(label)}: {words}" if label else words


def _otherwise(
    bus: Bus, source: ViewSource, then: ViewSource, meanings: Meanings, stop: Callable[[], bool]
) -> Iterator[str]:
    """What is otherwise than in an earlier capture."""
    before = read_side(then, stop)
    told = changes(whole_side(bus, source), before, meanings)
    sides = tr("{now} beside {then}", now=source.name, then=then.name)
    yield f"{counted(len(told), 'difference', 'differences')}: {sides}."
    for each in told:
        yield f"{tr(each.kind)}: {each.text}"


def _polls(bus: Bus, meanings: Meanings) -> Iterator[str]:
    """Every poll: how often, how it is answered, its newest values by name."""
    polls = sorted(bus.watched, key=lambda poll: poll.key)
    yield f"{counted(len(polls), 'poll', 'polls')}."
    for poll in polls:
        key = poll.key
        parts = [tr("Poll"), tr("unit {unit}", unit=key.unit), tr("function {function}", function=key.function)]
        parts += [key.registers] if key.register else []
        parts.append(tr("asked {count:,}", count=poll.facts.asked))
        if bus.timed and poll.every_ns:
            parts.append(tr("every {time}", time=duration(poll.every_ns)))
        took = poll.time(0.95)
        bounds = None if took is None else bounds_of(took, bus.off_ns)
        if bounds is not None:
            parts.append(tr("95% of answers within {time}", time=between(*bounds)))
        if poll.bad:
            parts.append(tr("{count:,} without a good answer", count=poll.bad))
        if poll.facts.answered >= 0:
            readings = meanings.readings(poll_values(bus, [poll.facts.answered])[0])
            parts += [f"{each.name} {each.text}" for each in readings]
        yield harmless(", ".join(parts))


def transaction_words(bus: Bus, row: int, zone: tzinfo) -> str:
    """A transaction, or a frame by itself, on one line: when, who, what, and what is wrong with it."""
    frame, answer = bus.frame(row), bus.partner(row)
    t = bus.table.value("t_start_ns", row)
    findings = {f.code: f.text for each in (row, answer) if each is not None for f in bus.findings(each)}
    when = (
        ""
        if not bus.timed
        else date_and_time(t, zone)
        if is_clock(t)
        else f"{seconds(t - bus.t_first)} {unit_word('s')}"
    )
    parts = [tr("Frame {index}", index=frame.index), *([when] if when else []), tr("unit {unit}", unit=frame.unit)]
    parts.append(frame.summary(wording()))
    if answer is not None and bus.table.value("kind", row) == Kind.REQUEST:
        took = bus.response(answer)
        head = tr("after {time}", time=between(*took)) if took is not None else tr("answer")
        parts.append(head if _REFUSED in findings else f"{head}: {bus.frame(answer).summary(wording())}")
    else:
        status = bus.table.value("state", row) & RowState.STATUS
        outcome = _OUTCOMES.get(Status(status - 1)) if status and _SILENT not in findings else None
        parts += [] if outcome is None else [tr(outcome)]
    parts += [f"{code}: {words}" for code, words in findings.items()]
    return ", ".join(parts)
