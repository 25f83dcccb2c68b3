"""`rtuscope document`: the bus described from what it did."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from .commands import DONE, INTERRUPTED, NO_FRAME
from .inputs import (
    add_capture_arguments,
    add_limit_arguments,
    add_map_argument,
    chosen_charts,
    chosen_limits,
    load_functions,
    open_capture,
    tell_damage,
)
from .terminal import Progress, add_overwrite_argument, interruptible, put_json, tell, to_be_overwritten

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
    shape = parser.add_mutually_exclusive_group()
    shape.add_argument("--json", action="store_true", help="the same facts as JSON")
    shape.add_argument("--html", metavar="FILE", help="write one HTML page to send on")
    add_overwrite_argument(parser, "FILE")
    add_map_argument(parser)
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    load_functions(arguments)
    capture = open_capture(arguments)
    if arguments.html is not None:
        to_be_overwritten(arguments.html, overwrite=arguments.overwrite, source=capture.path)
        described = _write_page(arguments, capture)
    else:
        described = _described(arguments, capture)
        _show(described, as_json=arguments.json)
    tell_damage(arguments.capture, capture)
    if described.report.partial:
        return INTERRUPTED
    if not described.report.frames:
        tell(f"{arguments.capture}: no Modbus frame found")
        return NO_FRAME
    return DONE


def _show(described: BusDescription, *, as_json: bool) -> None:
    from ..reports.description import markdown

    if as_json:
        put_json(described.to_json(), indent=2)
    else:
        sys.stdout.write(markdown(described))


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


def _write_page(arguments: argparse.Namespace, capture: Capture) -> BusDescription:
    from ..exports.sink import output
    from ..reports.description import html

    with output(arguments.html, source=capture.path) as file:  # an unusable name is told before the work
        described = _described(arguments, capture)
        file.write(html(described).encode())
    if described.report.partial:
        tell("stopped by Ctrl-C; the page covers what was read until then")
    return described
