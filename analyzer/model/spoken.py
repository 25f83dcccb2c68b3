"""A capture read out line by line, for who hears a screen: causes first, then each transaction in words."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, tzinfo
from typing import TYPE_CHECKING

from ..languages import counted, page_words, tr, wording
from ..tables.schema import Kind
from ..tables.transactions import Status
from ..words import between, date_and_time, is_clock, seconds
from .bus import Bus
from .scope import Scope
from .selection import compiled
from .table import RowState

if TYPE_CHECKING:
    from .source import ViewSource

_OUTCOMES = {
    Status.UNANSWERED: "no answer", Status.BROADCAST: "to all, no answer is due", Status.DAMAGED: "damaged answer",
    Status.UNHEARD: "an answer may have come unheard",
}  # fmt: skip
_SILENT, _REFUSED = "no-response", "exception"  # findings that tell the outcome themselves


def spoken(source: ViewSource, text: str = "", zone: tzinfo = UTC, stop: Callable[[], bool] = bool) -> Iterator[str]:
    """Lines without columns, marks or colours. Raises analyzer.filters.FilterError."""
    bus = Bus.of(source)
    scope = Scope(compiled(text, source.line) if text else None)
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
            "Cause {number}, {severity}, {share:.0%} sure: {text}. To do: {remedy}",
            number=number, severity=tr(cause.severity), share=cause.confidence, text=cause.text, remedy=cause.remedy,
        )  # fmt: skip
    if not bus.frames:
        return
    which = tr(" with {filter}", filter=text) if text else ""
    yield f"{counted(transactions.count, 'transaction', 'transactions')}{which}."
    for row in transactions.rows().tolist():
        yield _transaction(bus, row, zone)


def _instead(bus: Bus, source: ViewSource) -> Iterator[str]:
    """What the report says where no frame is."""
    from ..reports.page import facts, nothing

    report = bus.report(source)
    yield nothing(report)
    for label, words in facts(report):
        yield f"{page_words(label)}: {words}" if label else words


def _transaction(bus: Bus, row: int, zone: tzinfo) -> str:
    frame, answer = bus.frame(row), bus.partner(row)
    t = bus.table.value("t_start_ns", row)
    findings = {f.code: f.text for each in (row, answer) if each is not None for f in bus.findings(each)}
    when = "" if not bus.timed else date_and_time(t, zone) if is_clock(t) else f"{seconds(t - bus.t_first)} s"
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
