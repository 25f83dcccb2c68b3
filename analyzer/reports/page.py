"""The report as one page of text, for reading at a cabinet.

Facts first, trouble marked by its own lines; what this capture cannot tell is said, never shown as zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import Final

from dissectors.values import harmless

from ..failures import failed_words
from ..languages import counted, grouped, page_words, phrase, retold
from ..linewords import line_words
from ..outages import unheard
from ..words import duration, is_clock, moment
from . import against, findings, pagetables
from .findings import and_more
from .model import RateRow, Report
from .paragraphs import WIDTH, PageLine, Paragraph

_LOSSES: Final = 3
_RATES: Final = 6
_HAPPENED: Final = 4  # of a recording


def text(report: Report, width: int = WIDTH) -> str:
    """The page, so many columns wide, newline at the end; names and notes in it are harmless."""
    lines = ([line] if isinstance(line, str) else line.lines(width) for line in _lines(report))
    return "\n".join(harmless(line.rstrip()) for wrapped in lines for line in wrapped) + "\n"


def _lines(report: Report) -> Iterator[PageLine]:
    for label, words in facts(report):
        yield Paragraph(harmless(words), first=f"{page_words(label):<9} ", others=" " * 10, whole=True)
    if not report.frames:
        yield ""
        yield nothing(report)
    yield from findings.cause_lines(report.causes, shares=not report.is_handful)
    yield from findings.left_lines(report.not_explained)
    if report.before:
        yield ""
        yield from against.lines(report.against, file_name(report.before))
    for table in pagetables.tables(report) if report.frames else ():
        yield ""
        yield from table
    yield from findings.lines(report.findings, handful=report.is_handful)
    yield from pagetables.value_lines(report.values)


def facts(report: Report) -> Iterator[tuple[str, str]]:
    """The bus in brief: a label with its words; an empty label goes on with the one before."""
    named = [part for part in (file_name(report.source), report.format) if part]
    yield "capture", ", ".join(named) or page_words("unnamed")
    if report.filter:
        yield "filter", page_words("{filter} (the rest of the report covers matching rows only)", filter=report.filter)
    yield "line", line_words(report.line)
    yield from _several_lines(report.separate_ports)
    yield "span", _span(report)
    yield from _quiet(report)
    label = "skipped" if report.format == "text" else "damaged"  # a log's words between its bytes are no damage
    for loss in report.damage[:_LOSSES]:
        yield label, retold(loss)
    if report.damage_count > _LOSSES:
        yield "", page_words("and {count:,} more such places", count=report.damage_count - _LOSSES)
    yield from _recording(report)
    yield from _left_out(report)
    yield "bytes", _bytes(report)
    if report.tcp_frames and report.baud is not None:
        yield (
            "",
            page_words(
                "Modbus TCP on a serial line: its gateway passes on bytes as they are, and should turn them into RTU"
            ),
        )
    if report.not_modbus:
        yield "", page_words("not Modbus, but {name}", name=phrase("{name}", name=report.not_modbus))
    if not report.frames:
        return
    frames = f"{grouped(report.frames)}: {counted(report.requests, 'request', 'requests')}, "
    frames += counted(report.responses, "response", "responses")
    if report.damaged_frames:
        frames += page_words("; {count:,} with a wrong check value", count=report.damaged_frames)
    yield "frames", frames
    if report.doubtful_frames:
        yield "", page_words("{count:,} of them doubtful (confidence under 0.5)", count=report.doubtful_frames)
    yield from _transactions(report)
    if not report.is_handful:
        yield "load", _load(report)
        yield "response", _response(report)
    elif report.times.count:
        yield "response", _response(report, ("min", "max"))
    if report.clock_skew_ns is not None and not report.clock_skew_ns[0] <= 0 <= report.clock_skew_ns[1]:
        yield "clocks", _clocks(report.clock_skew_ns)
    if report.rates:
        yield "rates", _rates(report.rates)


def _several_lines(ports: Sequence[int]) -> Iterator[tuple[str, str]]:
    """That a capture holds more than one line, and how to look at one."""
    if not ports:
        return
    words = page_words(
        "{count} separate lines (ports {ports}), counted as one bus: waits, late answers and load are wrong; read one "
        "with --only-port {first}",
        count=len(ports),
        ports=", ".join(map(str, ports)),
        first=ports[0],
    )
    yield "", words


def line_of_several(ports: Sequence[int], port: int, name: str) -> str:
    """What stands above the page of one of several lines; `name`: what the capture calls its port, if anything."""
    words = "port {port}, one of {count} separate lines in this capture (--only-port {port})"
    return page_words(words, port=port, count=len(ports)) + f": {harmless(name)}" * bool(name)


def _left_out(report: Report) -> Iterator[tuple[str, str]]:
    """What the page does not cover: what was not read, what failed."""
    if report.partial:
        yield "partial", page_words("reading stopped early; the report covers the part read")
    if report.failed:
        yield "failed", retold(failed_words(report.failed))


_SEVERAL_FRAMES: Final = 64  # bytes, in which a bus would have had frames


def file_name(source: str) -> str:
    """A capture's name without the folders of this machine."""
    return PurePath(source).name or source


def nothing(report: Report) -> str:
    """What to say where there is no frame."""
    if report.filter:
        return page_words("No frame passes the filter.")
    words = page_words("No Modbus frame was found.")
    if report.causes or report.not_modbus or report.bytes < _SEVERAL_FRAMES:
        return words
    return f"{words} " + page_words(
        "The line speaks another protocol, or the tap is set to another speed than the line."
    )


def _span(report: Report) -> str:
    if report.span_ns is None:
        nothing = "nothing matches" if report.filter else "nothing captured"
        return unknown("no times in this capture" if not report.timed else nothing)
    return duration(report.span_ns) + _since(report.t_start_ns)


def _since(t_ns: int | None) -> str:
    """From when, where the capture has a clock."""
    return page_words(", from {moment}", moment=moment(t_ns)) if t_ns is not None and is_clock(t_ns) else ""


def _quiet(report: Report) -> Iterator[tuple[str, str]]:
    """How long nothing was asked, where that stands out."""
    if report.quiet is None:
        return
    begin, end = report.quiet
    yield "", page_words("longest silence {time}", time=duration(end - begin)) + _since(begin)


def unknown(why: str) -> str:
    """That something is unknown, and why."""
    return page_words("unknown: {why}", why=page_words(why))


def unknown_load(report: Report) -> str:
    """Why nobody can tell the load."""
    if not report.timed:
        return unknown("no times in this capture")
    if report.tcp_frames == report.frames > 0:
        return unknown("network packets do not load a line")
    if report.baud is None:
        return unknown("needs the line's speed (--baud)")
    if report.char_bits is None:
        return unknown("needs the character length (--parity, --stop)")
    return unknown("needs a longer capture")


def _recording(report: Report) -> Iterator[tuple[str, str]]:
    """When the recorder heard nothing, and when its clock was set."""
    events = [(time.from_ns, unheard(time)) for time in report.deaf]
    events += [
        (note.t_ns, page_words("at {moment}: {text}", moment=moment(note.t_ns), text=retold(note.text)))
        for note in report.notes
        if note.kind == "clock"
    ]
    label = "recorded"
    for _, words in sorted(events)[:_HAPPENED]:
        yield label, words
        label = ""
    if len(events) > _HAPPENED:
        yield "", and_more(len(events) - _HAPPENED, "more such time", "more such times")
    if report.deaf:
        yield "", page_words("answers missed then are not blamed on any unit")


def _bytes(report: Report) -> str:
    words = grouped(report.bytes)
    if report.noise_bytes:
        stretches = counted(report.noise_stretches, "stretch", "stretches")
        words += page_words(
            ", {count:,} of them outside frames ({stretches})", count=report.noise_bytes, stretches=stretches
        )
    for name, size in report.foreign.items():
        words += page_words("; {size:,} of another protocol, {name}", size=size, name=phrase("{name}", name=name))
    return words


def _rates(rates: Sequence[RateRow]) -> str:
    """How fast senders are, those that are farthest off first."""
    some = sorted(rates, key=lambda row: -abs(row.error))[:_RATES]
    words = []
    for row in some:
        error = round(row.error, 3) + 0.0  # no -0.0 %
        words.append(
            page_words("client {error:+.1%}", error=error)
            if row.unit is None
            else page_words("unit {unit} {error:+.1%}", unit=row.unit, error=error)
        )
    if len(rates) > _RATES:
        words.append(page_words("{count} more nearer to it", count=len(rates) - _RATES))
    return page_words("clocks against the line's rate: {senders}", senders=", ".join(words))


def _clocks(skew: tuple[int, int]) -> str:
    least, most = sorted(map(abs, skew))
    return page_words(
        "the tap of the answers is {least} to {most} ahead of that of the requests"
        if skew[0] > 0
        else "the tap of the answers is {least} to {most} behind that of the requests",
        least=duration(least),
        most=duration(most),
    )


def _transactions(report: Report) -> Iterator[tuple[str, str]]:
    counts = report.transactions
    if not counts.requests:
        return
    silent = "{number:,} without an answer here" if report.is_handful else "{number:,} unanswered"
    parts = [page_words("{number:,} answered", number=counts.answered)]
    here = report.is_handful  # a few lines that somebody copied end where he stopped
    for number, words in (
        (counts.exceptions, "{number:,} by exception"),
        (counts.unanswered + counts.unheard * here, silent),
        (counts.damaged, "{number:,} answered by a damaged frame"),
        (counts.broadcasts, "{number:,} broadcast"),
        (counts.unheard * (not here), "{number:,} not heard"),
    ):
        if number:
            parts.append(page_words(words, number=number))
    yield "requests", f"{grouped(counts.requests)}: {', '.join(parts)}"
    again = [counted(counts.retries, "retry", "retries")] if counts.retries else []
    if report.bytes_for_answers:
        again.insert(
            0,
            page_words("{count:,} of the unanswered got bytes that are not an answer", count=report.bytes_for_answers),
        )
    again += [counted(counts.late, "late answer", "late answers")] if counts.late else []
    again += [counted(counts.echoes, "echo of the adapter", "echoes of the adapter")] if counts.echoes else []
    if again:
        yield "", ", ".join(again)


def _load(report: Report) -> str:
    if report.load.mean is None:
        return unknown_load(report)
    words = page_words("{share:.1%} of the line's capacity", share=report.load.mean)
    if report.load.busiest_second is not None:
        words += page_words(", {share:.1%} in the busiest second", share=report.load.busiest_second)
    return words


def _response(report: Report, figures: Sequence[str] = ("p50", "p95", "p99", "max")) -> str:
    times = report.times
    if not times.count or times.off_ns is None:
        return unknown("no times in this capture" if not report.timed else "this tap's timestamps are too coarse")
    words = ", ".join(f"{figure} {times.worded(figure)}" for figure in figures)
    answers = report.transactions.answers
    if times.count < answers:
        words += page_words(" ({some:,} of {all:,} measured)", some=times.count, all=answers)
    if report.baud is None and report.tcp_frames < report.frames:  # and so not how long an answer's bytes take
        words += page_words(", to the ends of answers: the line's speed is not known")
    return words
