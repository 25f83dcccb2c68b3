"""`rtuscope report`: the bus in one page."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from .app import DONE, FAILED, INTERRUPTED, NO_FRAME
from .inputs import (
    add_capture_arguments,
    add_check_argument,
    add_filter_argument,
    add_limit_arguments,
    chosen_filter,
    chosen_limits,
    load_functions,
    open_capture,
)
from .maps import add_map_argument, chosen_charts
from .outputs import add_overwrite_argument, to_be_overwritten
from .terminal import Progress, interruptible, put_json, tell

if TYPE_CHECKING:
    from captures import Capture
    from dissectors.maps.units import UnitMaps

    from ..filters import Filter
    from ..options import Options
    from ..registers.watch import ValueWatch
    from ..reports import Report

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope report bus.jsonl
rtuscope report bus.jsonl --filter 'function == 3'
rtuscope report bus.jsonl --html bus.html
rtuscope report bus.jsonl --json"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    add_filter_argument(parser)
    shape = parser.add_mutually_exclusive_group()
    shape.add_argument("--json", action="store_true", help="the same facts as JSON")
    shape.add_argument("--html", metavar="FILE", help="write one HTML page to send on, with charts and examples")
    add_overwrite_argument(parser, "FILE")
    add_check_argument(parser)
    add_map_argument(parser)
    parser.add_argument("--values", action="store_true", help="list what registers held, as far as inference is sure")
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    load_functions(arguments)
    limits = chosen_limits(arguments)
    capture = open_capture(arguments)
    charts = chosen_charts(arguments)
    chosen = chosen_filter(arguments, capture.line, charts)
    source = str(arguments.capture)
    if arguments.html is not None:
        to_be_overwritten(arguments.html, overwrite=arguments.overwrite, source=capture.path)
    values = _values(charts, inferred=arguments.values)
    if arguments.html is not None:
        return write_page(
            capture, source, arguments.html, filter=chosen, options=limits, check=arguments.check, values=values
        )
    return show(
        capture, source, as_json=arguments.json, filter=chosen, options=limits, check=arguments.check, values=values
    )


def _values(charts: UnitMaps, *, inferred: bool) -> ValueWatch | None:
    """What gathers the values, where a map or the user asks for them."""
    if not charts and not inferred:
        return None
    from ..registers.watch import ValueWatch

    return ValueWatch(charts, inferred=inferred)


def show(
    capture: Capture,
    source: str,
    *,
    as_json: bool,
    filter: Filter | None = None,
    options: Options | None = None,
    check: bool = False,
    values: ValueWatch | None = None,
) -> int:
    """Report on an open capture; returns the exit status, with `check` 1 where there are errors."""
    from ..options import Options
    from ..reports import summarize, text

    progress = Progress(f"report {source}")
    with interruptible() as stop:
        report = summarize(
            capture,
            source=source,
            filter=filter,
            options=options or Options(),
            progress=progress,
            stop=stop,
            values=values,
        )
    progress.clear()
    if as_json:
        put_json(report.to_json(), indent=2)
    else:
        sys.stdout.write(text(report))
    return _status(report, check=check)


def write_page(
    capture: Capture,
    source: str,
    path: str,
    *,
    filter: Filter | None = None,
    options: Options | None = None,
    check: bool = False,
    values: ValueWatch | None = None,
) -> int:
    """Write the report on an open capture as HTML; returns the exit status, as `show` does."""
    from ..exports.output import output
    from ..options import Options
    from ..reports import summarize
    from ..reports.html import Sights, page

    progress, sights = Progress(f"report {source}"), Sights()
    with output(path, source=capture.path) as file:  # an unusable name is told before the work, not after it
        with interruptible() as stop:
            report = summarize(
                capture,
                source=source,
                filter=filter,
                options=options or Options(),
                progress=progress,
                stop=stop,
                watch=sights.feed,
                values=values,
            )
        progress.clear()
        file.write(page(report, sights).encode())
    if report.partial:
        tell("stopped by Ctrl-C; the page covers what was read until then")
    return _status(report, check=check)


def _status(report: Report, *, check: bool) -> int:
    if report.partial:
        return INTERRUPTED
    if check and any(row.severity == "error" for row in report.findings):
        return FAILED
    return DONE if report.frames else NO_FRAME
