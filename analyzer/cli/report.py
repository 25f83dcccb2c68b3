"""`rtuscope report`: the bus in one page."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from .app import DONE, INTERRUPTED, NO_FRAME
from .inputs import add_capture_arguments, add_filter_argument, chosen_filter, load_functions, open_capture
from .terminal import Progress, interruptible

if TYPE_CHECKING:
    from analyzer.filters import Filter
    from analyzer.reports import Report
    from captures import Capture

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


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    load_functions(arguments)
    capture = open_capture(arguments)
    chosen = chosen_filter(arguments, capture.line)
    source = str(arguments.capture)
    if arguments.html is not None:
        return write_page(capture, source, arguments.html, filter=chosen)
    return show(capture, source, as_json=arguments.json, filter=chosen)


def show(capture: Capture, source: str, *, as_json: bool, filter: Filter | None = None) -> int:
    """Report on an open capture; returns the exit status."""
    from analyzer.reports import summarize, text

    progress = Progress(f"report {source}")
    with interruptible() as stop:
        report = summarize(capture, source=source, filter=filter, progress=progress, stop=stop)
    progress.clear()
    if as_json:
        import json

        print(json.dumps(report.to_json(), indent=2))
    else:
        sys.stdout.write(text(report))
    return _status(report)


def write_page(capture: Capture, source: str, path: str, *, filter: Filter | None = None) -> int:
    """Write the report on an open capture as HTML; returns the exit status."""
    from analyzer.exports.output import output
    from analyzer.reports import summarize
    from analyzer.reports.html import Sights, page

    progress, sights = Progress(f"report {source}"), Sights()
    with output(path, source=capture.path) as file:  # an unusable name is told before the work, not after it
        with interruptible() as stop:
            report = summarize(capture, source=source, filter=filter, progress=progress, stop=stop, watch=sights.feed)
        progress.clear()
        file.write(page(report, sights).encode())
    return _status(report)


def _status(report: Report) -> int:
    if report.partial:
        return INTERRUPTED
    return DONE if report.frames else NO_FRAME
