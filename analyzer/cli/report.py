"""`rtuscope report`: the bus in one page."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from .app import DONE, INTERRUPTED, NO_FRAME
from .inputs import add_capture_arguments, load_functions, open_capture
from .terminal import Progress, interruptible

if TYPE_CHECKING:
    from captures import Capture

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope report bus.jsonl
rtuscope report bus.jsonl --json"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument("--json", action="store_true", help="the same facts as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    load_functions(arguments)
    return show(open_capture(arguments), str(arguments.capture), as_json=arguments.json)


def show(capture: Capture, source: str, *, as_json: bool) -> int:
    """Report on an open capture; returns the exit status."""
    from analyzer.reports import summarize, text

    progress = Progress(f"report {source}")
    with interruptible() as stop:
        report = summarize(capture, source=source, progress=progress, stop=stop)
    progress.clear()
    if as_json:
        import json

        print(json.dumps(report.to_json(), indent=2))
    else:
        sys.stdout.write(text(report))
    if report.partial:
        return INTERRUPTED
    return DONE if report.frames else NO_FRAME
