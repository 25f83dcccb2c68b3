"""`rtuscope report`: the bus in one page."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..languages import counted
from .commands import DONE, FAILED, INTERRUPTED, NO_FRAME, UsageError
from .inputs import (
    add_capture_arguments,
    add_check_argument,
    add_filter_argument,
    add_limit_arguments,
    add_map_argument,
    chosen_charts,
    chosen_filter,
    chosen_limits,
    load_functions,
    open_capture,
    opened_capture,
)
from .onepage import add_page_arguments
from .terminal import (
    Progress,
    interruptible,
    page_width,
    put_json,
    put_page,
    tell_user,
    to_be_overwritten,
)

if TYPE_CHECKING:
    from captures import Capture
    from dissectors.maps.files import UnitMaps

    from ..core import Analysed
    from ..filters import Filter
    from ..options import Options
    from ..registers.watch import ValueWatch
    from ..reports import Report

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope report bus.jsonl
rtuscope report bus.jsonl --filter 'function == 3'
rtuscope report bus.jsonl --html bus.html
rtuscope report bus.jsonl --by hour
rtuscope report bus.jsonl --against bus.jsonl
rtuscope report bus.jsonl --json"""

_OF_CAPTURES = ("filter", "check", "map", "against", "by", "values", "json")  # what is not for lakes


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    add_filter_argument(parser)
    sent = "write one HTML page to send to others, with charts and examples"
    add_page_arguments(parser, json="the same facts as JSON", html=sent)
    add_check_argument(parser)
    add_map_argument(parser)
    parser.add_argument(
        "--against", metavar="CAPTURE", help="compare with this capture: what is new, gone, worse or better"
    )
    parser.add_argument("--by", choices=("hour",), help="also count by hour of the day")
    parser.add_argument("--values", action="store_true", help="list register values whose meaning is certain")
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    if is_lake(arguments.capture):
        return write_fleet(arguments)
    load_functions(arguments)
    limits = chosen_limits(arguments)
    capture = open_capture(arguments)
    charts = chosen_charts(arguments)
    chosen = chosen_filter(arguments, capture.line, charts)
    source = str(arguments.capture)
    if arguments.html is not None:
        to_be_overwritten(arguments.html, overwrite=arguments.overwrite, source=capture.path)
    before = None
    if arguments.against is not None:
        from ..reports import of_one_line

        earlier = opened_capture(arguments.against, arguments)
        kept = chosen_filter(arguments, earlier.line, charts)
        before = of_one_line(_report(earlier, str(arguments.against), ReportTerms(kept, limits)))
    terms = ReportTerms(chosen, limits, charts, inferred=arguments.values, hours=arguments.by == "hour", before=before)
    if arguments.html is not None:
        shown = [write_page(capture, source, arguments.html, terms)]
    else:
        shown = show_report(capture, source, terms, as_json=arguments.json)
    return max(exit_status(report, check=arguments.check) for report in shown)


def is_lake(path: str) -> bool:
    """Whether what was named as a capture is what `rtuscope batch` makes."""
    if "://" in path:
        return True
    from pathlib import Path

    return (Path(path) / "manifest").is_dir()


def write_fleet(arguments: argparse.Namespace) -> int:
    """The pages of a fleet."""
    lake, page = arguments.capture, arguments.html
    if page is None:
        raise UsageError(f"{lake}: is a lake: --html FILE writes its pages, rtuscope ask queries it")
    if page == "-":
        raise UsageError(f"{lake}: is a lake, and each of its sites gets a page of its own: give --html a file name")
    if unfit := [f"--{name}" for name in _OF_CAPTURES if getattr(arguments, name, None)]:
        raise UsageError(f"{lake}: is a lake: {', '.join(unfit)} works on captures; for a lake, use rtuscope ask")
    from ..fleet.lake import Lake
    from ..fleet.pages import site_folder, write_pages

    opened = Lake(lake)
    if not to_be_overwritten(page, overwrite=arguments.overwrite) and not arguments.overwrite:
        folder = site_folder(page)
        if folder.exists():
            raise UsageError(f"{folder}: already exists: give another name, or --overwrite")
    count = write_pages(opened, page)
    tell_user(f"{page}: {counted(count, 'site', 'sites')}, one page each in {site_folder(page)}")
    return DONE


@dataclass(frozen=True, slots=True)
class ReportTerms:
    """What a report shall be of, and what it says besides: values, hours, what changed since an earlier one."""

    filter: Filter | None = None
    options: Options | None = None
    charts: UnitMaps | None = None
    inferred: bool = False  # values of registers as well as is known without a map
    hours: bool = False
    before: Report | None = None


def _report(
    capture: Capture, source: str, terms: ReportTerms, watches: Sequence[Callable[[Analysed], None]] = ()
) -> Report:
    """Read a capture through; `watches` see every part of it."""
    from ..options import Options
    from ..reports import of_one_line, summarize
    from ..reports.against import differences
    from ..reports.breakdown import HourTable

    progress = Progress(f"report {source}")
    hours = HourTable(capture.line) if terms.hours else None
    looking = (*watches, *([] if hours is None else [hours.feed]))

    def watch(analysed: Analysed) -> None:
        for look in looking:
            look(analysed)

    with interruptible() as stop:
        report = summarize(
            capture,
            source=source,
            filter=terms.filter,
            options=terms.options or Options(),
            progress=progress,
            stop=stop,
            watch=watch,
            values=_values(terms),
        )
    progress.clear()
    if hours is not None:
        report = replace(report, hours=hours.rows())
    if terms.before is not None:
        report = replace(of_one_line(report), before=terms.before.source, against=differences(report, terms.before))
    return report


def _values(terms: ReportTerms) -> ValueWatch | None:
    """What gathers the values, where a map or the user asks for them."""
    if terms.charts is None or not (terms.charts or terms.inferred):
        return None
    from ..registers.watch import ValueWatch

    return ValueWatch(terms.charts, inferred=terms.inferred)


def show_report(capture: Capture, source: str, terms: ReportTerms = ReportTerms(), *, as_json: bool) -> list[Report]:
    """Print the report on an open capture, or one on each line of a capture that holds several; give what was shown."""
    from ..reports import text
    from ..reports.paragraphs import WIDTH

    report = _report(capture, source, terms)
    if as_json:
        put_json(report.to_json(), indent=2)
    elif report.separate_ports and not report.partial:
        return [*_show_lines(capture, report, terms)]
    else:
        put_page(text(report, page_width(WIDTH)))
    return [report]


def _show_lines(capture: Capture, report: Report, terms: ReportTerms) -> Iterator[Report]:
    """A report on each line of a capture that holds several."""
    from captures.editing import of_port

    from ..reports.page import line_of_several

    for place, port in enumerate(report.separate_ports):
        name = capture.line.notes.get(f"port {port}", "")
        put_page("\n" * (place > 0) + line_of_several(report.separate_ports, port, name) + "\n")
        yield from show_report(of_port(capture, port), report.source, terms, as_json=False)


def write_page(capture: Capture, source: str, path: str, terms: ReportTerms) -> Report:
    """Write the report on an open capture as HTML."""
    from ..exports.sink import output
    from ..reports.html import Sights, page

    sights = Sights()
    with output(path, source=capture.path) as file:  # an unusable name is told before the work, not after it
        report = _report(capture, source, terms, [sights.feed])
        file.write(page(report, sights).encode())
    if report.partial:
        tell_user("interrupted; the report covers only the part read so far")
    return report


def exit_status(report: Report, *, check: bool = False) -> int:
    """What the command ends with; with `check` 1 where there are errors."""
    if report.partial:
        return INTERRUPTED
    if check and any(row.severity == "error" for row in report.findings):
        return FAILED
    return DONE if report.frames else NO_FRAME
