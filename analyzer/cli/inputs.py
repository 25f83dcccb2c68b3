"""What several commands take in: a capture file, and declarations of vendor functions."""

from __future__ import annotations

import argparse
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from .app import UsageError

if TYPE_CHECKING:
    from analyzer.filters import Filter
    from captures import Capture
    from captures.line import LineSettings

_GROUP: Final = b"[rtuscope.functions]"
_TOLD: Final = 5  # complaints printed; the rest are counted


def add_capture_arguments(parser: argparse.ArgumentParser) -> None:
    """CAPTURE and --functions."""
    parser.add_argument("capture", metavar="CAPTURE", help="a capture: .jsonl, .mcap, .bin, .txt, .log ...")
    add_functions_argument(parser)


def add_functions_argument(parser: argparse.ArgumentParser) -> None:
    """--functions."""
    parser.add_argument(
        "--functions", metavar="FILE", action="append", default=[], help="a Python file that declares vendor functions"
    )


def add_filter_argument(parser: argparse.ArgumentParser) -> None:
    """--filter."""
    parser.add_argument(
        "--filter", metavar="EXPR", help="only what passes, such as 'unit == 17 and exception' (docs/filters.md)"
    )


def chosen_filter(arguments: argparse.Namespace, line: LineSettings) -> Filter | None:
    """The filter that was given, for a line of these settings."""
    if arguments.filter is None:
        return None
    from analyzer.filters import FilterError, compile_filter

    try:
        return compile_filter(arguments.filter, line)
    except FilterError as error:
        raise UsageError(f"--filter: {error}") from error


def load_functions(arguments: argparse.Namespace) -> None:
    """Declare what the installed plug-ins and the named files declare."""
    if arguments.functions or _plugged_in():
        from dissectors.functions import load_entry_points, load_file

        load_entry_points()
        for path in arguments.functions:
            load_file(path)


def _plugged_in() -> bool:
    """Whether any installed package names our entry point group: asking importlib.metadata costs 40 ms, this 2."""
    for folder in sys.path:
        with suppress(OSError), os.scandir(folder or ".") as entries:
            for entry in entries:
                if entry.name.endswith((".dist-info", ".egg-info")):
                    with suppress(OSError), open(f"{entry.path}/entry_points.txt", "rb") as file:  # noqa: PTH123
                        if _GROUP in file.read():
                            return True
    return False


def open_capture(arguments: argparse.Namespace) -> Capture:
    """The capture that was named."""
    import captures

    return captures.open(arguments.capture)


def tell_damage(name: str, capture: Capture) -> None:
    """Say what of the capture could not be read."""
    for loss in capture.damage[:_TOLD]:
        print(f"rtuscope: {name}: {loss}", file=sys.stderr)
    if capture.damage_count > _TOLD:
        print(f"rtuscope: {name}: and {capture.damage_count - _TOLD:,} more such places", file=sys.stderr)
