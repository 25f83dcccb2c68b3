"""The report as one page of text, 80 columns, for reading at a cabinet.

Facts first, trouble marked by its own lines; what this capture cannot tell is said, never shown as zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap
from typing import Any, Final

from dissectors.values import harmless

from ..languages import page_words
from ..outages import unheard
from ..words import duration, is_clock, moment, plural
from . import against, findings, pagetables, values
from .model import Counts, Report

_WIDTH: Final = 80
_UNBROKEN: Final[dict[str, Any]] = {"break_long_words": False, "break_on_hyphens": False}  # names, ports
_LOSSES: Final = 3
_HAPPENED: Final = 4  # of a recording


def text(report: Report) -> str:
    """The page, newline at the end; names and notes in it are harmless."""
    return "\n".join(harmless(line.rstrip()) for line in _lines(report)) + "\n"


def _lines(report: Report) -> Iterator[str]:
    for label, words in facts(report):
        yield from wrap(
            harmless(words), _WIDTH, initial_indent=f"{page_words(label):<9} ", subsequent_indent=" " * 10, **_UNBROKEN
        )
    if not report.frames:
        yield ""
        yield nothing(report)
        return
    yield from findings.cause_lines(report.causes)
    if report.before:
        yield ""
        yield from against.lines(report.against, report.before)
    for table in pagetables.tables(report):
        yield ""
        yield from table
    yield from findings.lines(report.findings)
    yield from values.lines(report.values)


def facts(report: Report) -> Iterator[tuple[str, str]]:
    """The bus in brief: a label with its words; an empty label goes on with the one before."""
    yield "capture", ", ".join(part for part in (report.source, report.format) if part) or "unnamed"
    if report.filter:
        yield "filter", f"{report.filter} (what follows covers what passes)"
    yield "line", _line(report)
    yield "span", _span(report)
    label = "skipped" if report.format == "text" else "damaged"  # a log's words between its bytes are no damage
    for loss in report.damage[:_LOSSES]:
        yield label, loss
    if report.damage_count > _LOSSES:
        yield "", f"and {report.damage_count - _LOSSES:,} more such places"
    yield from _recording(report)
    if report.partial:
        yield "partial", "ended before the capture did; what follows covers the part read"
    yield "bytes", _bytes(report)
    if not report.frames:
        return
    frames = f"{report.frames:,}: {plural(report.requests, 'request', 'requests')}, "
    frames += plural(report.responses, "response", "responses")
    if report.damaged_frames:
        frames += f"; {report.damaged_frames:,} with a wrong check value"
    yield "frames", frames
    if report.doubtful_frames:
        yield "", f"{report.doubtful_frames:,} of them doubtful (confidence under 0.5)"
    yield from _transactions(report.transactions)
    yield "load", _load(report)
    yield "response", _response(report)
    if report.clock_skew_ns is not None and not report.clock_skew_ns[0] <= 0 <= report.clock_skew_ns[1]:
        yield "clocks", _clocks(report.clock_skew_ns)


def nothing(report: Report) -> str:
    """What to say where there is no frame."""
    return page_words("No frame passes the filter." if report.filter else "No Modbus frame was found.")


def _line(report: Report) -> str:
    if report.baud is None:
        return "baud not known"
    parts = [f"{report.baud} bit/s"]
    if report.char_bits is not None:
        parts.append(f"{report.char_bits:g}-bit characters")
    if report.tap:
        parts.append(f"tap {report.tap}")
    return ", ".join(parts)


def _span(report: Report) -> str:
    if report.span_ns is None:
        nothing = "nothing passes" if report.filter else "nothing captured"
        return "unknown: " + ("no times in this capture" if not report.timed else nothing)
    words = duration(report.span_ns)
    if report.t_start_ns is not None and is_clock(report.t_start_ns):
        words += f", from {moment(report.t_start_ns)}"
    return words


def _recording(report: Report) -> Iterator[tuple[str, str]]:
    """When the recorder heard nothing, and when its clock was set."""
    events = [(time.from_ns, unheard(time)) for time in report.deaf]
    events += [(note.t_ns, f"at {moment(note.t_ns)}: {note.text}") for note in report.notes if note.kind == "clock"]
    label = "recorded"
    for _, words in sorted(events)[:_HAPPENED]:
        yield label, words
        label = ""
    if len(events) > _HAPPENED:
        yield "", f"and {plural(len(events) - _HAPPENED, 'more such time', 'more such times')} (--json has all)"
    if report.deaf:
        yield "", "no unit is blamed for an answer that was missed then"


def _bytes(report: Report) -> str:
    words = f"{report.bytes:,}"
    if report.noise_bytes:
        words += (
            f", {report.noise_bytes:,} of them in no frame ({plural(report.noise_stretches, 'stretch', 'stretches')})"
        )
    for name, size in report.foreign.items():
        words += f"; {size:,} of another protocol, {name}"
    return words


def _clocks(skew: tuple[int, int]) -> str:
    least, most = sorted(map(abs, skew))
    side = "ahead of" if skew[0] > 0 else "behind"
    return f"the tap of the answers is {duration(least)} to {duration(most)} {side} that of the requests"


def _transactions(counts: Counts) -> Iterator[tuple[str, str]]:
    parts = [f"{counts.answered:,} answered"]
    for number, words in (
        (counts.exceptions, "by exception"),
        (counts.unanswered, "unanswered"),
        (counts.damaged, "answered by a damaged frame"),
        (counts.broadcasts, "broadcast"),
        (counts.unheard, "not heard"),
    ):
        if number:
            parts.append(f"{number:,} {words}")
    yield "requests", f"{counts.requests:,}: {', '.join(parts)}"
    again = [plural(counts.retries, "retry", "retries")] if counts.retries else []
    again += [plural(counts.late, "late answer", "late answers")] if counts.late else []
    if again:
        yield "", ", ".join(again)


def _load(report: Report) -> str:
    if report.load.mean is None:
        why = "no times in this capture" if not report.timed else "it needs the baud and a span"
        return f"unknown: {why}"
    words = f"{report.load.mean:.1%} of the line's capacity"
    if report.load.busiest_second is not None:
        words += f", {report.load.busiest_second:.1%} in the busiest second"
    return words


def _response(report: Report) -> str:
    times = report.times
    if not times.count or times.off_ns is None:
        return "unknown: " + ("no times in this capture" if not report.timed else "this tap's times cannot tell them")
    words = ", ".join(f"{figure} {times.worded(figure)}" for figure in ("p50", "p95", "p99", "max"))
    answers = report.transactions.answered + report.transactions.exceptions + report.transactions.damaged
    return words + (f" ({times.count:,} of {answers:,} measured)" if times.count < answers else "")
