"""The report as one page of text, 80 columns, for reading at a cabinet.

Facts first, trouble marked by its own lines; what this capture cannot tell is said, never shown as zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from textwrap import wrap
from typing import Any, Final

from dissectors.values import harmless

from ..outages import unheard
from ..words import compact, duration, is_clock, moment, plural
from . import findings, values
from .model import Counts, Report, Times, UnitRow

_WIDTH: Final = 80
_UNBROKEN: Final[dict[str, Any]] = {"break_long_words": False, "break_on_hyphens": False}  # names, ports
_ROWS: Final = 24  # units on the page; --json has all
_EXCEPTIONS: Final = 10
_LOSSES: Final = 3
_LONG_NS: Final = 99_950_000_000
_HAPPENED: Final = 4  # of a recording
_COLUMNS: Final = (  # head, width, which of Counts
    ("requests", 9, "requests"),
    ("ok", 7, "answered"),
    ("exc", 6, "exceptions"),
    ("none", 6, "unanswered"),
    ("bad", 6, "damaged"),
    ("retry", 6, "retries"),
    ("late", 6, "late"),
)


def text(report: Report) -> str:
    """The page, newline at the end; names and notes in it are harmless."""
    return "\n".join(harmless(line.rstrip()) for line in _lines(report)) + "\n"


def _lines(report: Report) -> Iterator[str]:
    for label, words in facts(report):
        yield from wrap(harmless(words), _WIDTH, initial_indent=f"{label:<9} ", subsequent_indent=" " * 10, **_UNBROKEN)
    if not report.frames:
        yield ""
        yield nothing(report)
        return
    yield from findings.cause_lines(report.causes)
    if report.units:
        yield ""
        yield from _units(report)
        yield ""
        yield from _functions(report)
        yield ""
        yield "requests: ok + exc (exceptions) + none (unanswered) + bad (damaged) + broadcasts"
        if report.transactions.unheard:
            yield f"{'':10}+ {report.transactions.unheard:,} not heard: nothing was recorded when an answer was due"
    if report.exceptions:
        yield ""
        yield from _exceptions(report)
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
    return "No frame passes the filter." if report.filter else "No Modbus frame was found."


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
    said = [(time.from_ns, unheard(time)) for time in report.deaf]
    said += [(note.t_ns, f"at {moment(note.t_ns)}: {note.text}") for note in report.notes if note.kind == "clock"]
    label = "recorded"
    for _, words in sorted(said)[:_HAPPENED]:
        yield label, words
        label = ""
    if len(said) > _HAPPENED:
        yield "", f"and {plural(len(said) - _HAPPENED, 'more such time', 'more such times')} (--json has all)"
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
    way = "ahead of" if skew[0] > 0 else "behind"
    return f"the tap of the answers is {duration(least)} to {duration(most)} {way} that of the requests"


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


def _units(report: Report) -> Iterator[str]:
    shown: Sequence[UnitRow] = report.units
    if len(shown) > _ROWS:
        shown = sorted(sorted(shown, key=_trouble)[:_ROWS], key=lambda row: row.unit)
    rows = [(f"{row.unit:>4}", row.counts, _cells(row.times, "p50", "p95", "max")) for row in shown]
    yield from _table("unit", 10, _COLUMNS, ("p50", "p95", "max"), rows)
    if len(shown) < len(report.units):
        yield f"and {len(report.units) - len(shown)} units with less trouble (--json has all)"


def _trouble(row: UnitRow) -> tuple[int, int]:
    counts = row.counts
    return -(counts.unanswered + counts.exceptions + counts.damaged + counts.late), row.unit


def _functions(report: Report) -> Iterator[str]:
    rows = [(f"{row.function:02d} {row.name}", row.counts, _cells(row.times, "p50", "p95")) for row in report.functions]
    yield from _table("function", 30, _COLUMNS[:5], ("p50", "p95"), rows)


def _table(
    title: str,
    width: int,
    columns: Sequence[tuple[str, int, str]],
    percentiles: Sequence[str],
    rows: Sequence[tuple[str, Counts, Sequence[str]]],
) -> Iterator[str]:
    cells = [times for _, _, times in rows]
    yield (
        f"{title:<{width}}"
        + "".join(f"{head:>{w}}" for head, w, _ in columns)
        + "".join(f"{p:>{_width(cells, i)}}" for i, p in enumerate(percentiles))
    )
    for name, counts, times in rows:
        short = name if len(name) <= width else name[: width - 2] + ".."
        numbers = "".join(
            f"{compact(getattr(counts, key)) if getattr(counts, key) else '-':>{w}}" for _, w, key in columns
        )
        yield f"{short:<{width}}{numbers}" + "".join(f"{t:>{_width(cells, i)}}" for i, t in enumerate(times))


def _exceptions(report: Report) -> Iterator[str]:
    yield "exceptions"
    for row in report.exceptions[:_EXCEPTIONS]:
        yield f"{row.count:>9,} x unit {row.unit}, function {row.function:02d}: {row.exception:02X} {row.name}"
    if len(report.exceptions) > _EXCEPTIONS:
        yield f"{'':>9}   and {len(report.exceptions) - _EXCEPTIONS} other kinds (--json has all)"


def _cells(times: Times, *figures: str) -> list[str]:
    """Figures as they stand in a table: measured ones in at most seven characters."""
    return [_cell(times, figure) for figure in figures]


def _cell(times: Times, figure: str) -> str:
    low, high = times.bounds(figure) or (0, 0)
    return f"{low / 1e9:.3g} s" if low == high >= _LONG_NS else times.worded(figure)


def _width(cells: Sequence[Sequence[str]], column: int) -> int:
    """How wide a column of figures is, the space before it counted: 8, or more where there are intervals."""
    return max([8, *(len(row[column]) + 2 for row in cells if ".." in row[column])])
