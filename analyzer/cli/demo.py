"""`rtuscope demo`: the bundled sample capture in the terminal interface; on a pipe, a report on it."""

from __future__ import annotations

import argparse

from .commands import DONE
from .report import exit_status, show_report
from .terminal import full_screen

SAMPLE = "troubled.jsonl"
EXAMPLE = "rtuscope demo"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("--report", action="store_true", help="print the report on a terminal, too")
    parser.add_argument("--json", action="store_true", help="the report's facts as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Show the sample."""
    import captures
    from captures import samples

    capture = captures.open(samples.path(SAMPLE))
    if arguments.report or arguments.json or not full_screen():
        return max(map(exit_status, show_report(capture, SAMPLE, as_json=arguments.json)))
    from ..model.source import CaptureSource
    from ..tui import run as look

    capture.path = None  # no notes are kept among the installed files
    look(CaptureSource(capture, SAMPLE))
    return DONE
