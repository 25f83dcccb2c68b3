"""`rtuscope document`: the bus described from what it did."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .inputs import (
    add_capture_arguments,
    add_limit_arguments,
    add_map_argument,
    chosen_charts,
    chosen_limits,
    load_functions,
    open_capture,
)
from .onepage import add_page_arguments, put_out, status_of
from .terminal import Progress, interruptible

if TYPE_CHECKING:
    from captures import Capture

    from ..reports.description import BusDescription

EXAMPLE = """\
rtuscope simulate meter.jsonl --map eastron-sdm630@1
rtuscope document meter.jsonl
rtuscope document meter.jsonl --html bus.html
rtuscope document meter.jsonl --map eastron-sdm630@1 --json"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    add_page_arguments(parser, json="the same facts as JSON", html="write one HTML page to send to others")
    add_map_argument(parser)
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    from ..reports.description import html, markdown

    load_functions(arguments)
    capture = open_capture(arguments)
    return status_of(put_out(arguments, capture, lambda: _described(arguments, capture), markdown=markdown, html=html))


def _described(arguments: argparse.Namespace, capture: Capture) -> BusDescription:
    from ..reports.description import describe

    maps, limits = chosen_charts(arguments), chosen_limits(arguments)
    progress = Progress(f"document {arguments.capture}")
    with interruptible() as stop:
        described = describe(
            capture, source=str(arguments.capture), maps=maps, options=limits, progress=progress, stop=stop
        )
    progress.clear()
    return described
