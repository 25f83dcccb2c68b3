"""What several commands take in: a capture file, and declarations of vendor functions."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from .app import UsageError

if TYPE_CHECKING:
    from analyzer.deframing.options import Options
    from analyzer.filters import Filter
    from captures import Capture
    from captures.line import LineSettings

_GROUP: Final = b"[rtuscope.functions]"
_LIMITS: Final = (  # flag, option, least and most in ms, help
    ("--t15-ms", "t15_ns", 0.01, 5000.0, "longest silence inside a frame (1.5 characters)"),
    ("--t35-ms", "t35_ns", 0.01, 5000.0, "least silence between frames (3.5 characters)"),
    ("--turnaround-ms", "turnaround_ns", 0.0, 60000.0, "least pause after a broadcast, 100 if not given"),
    ("--idle-ms", "idle_ns", 5.0, 5000.0, "silence after which the line counts as quiet, 50 if not given"),
)
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


def add_limit_arguments(parser: argparse.ArgumentParser, *, only: str | None = None) -> None:
    """--t15-ms and the like: what of the line's timing is set otherwise than the specification has it."""
    group = parser.add_argument_group("timing, where the line is set otherwise than the specification has it")
    for flag, _, least, most, words in _LIMITS:
        if only not in (None, flag):
            continue
        group.add_argument(flag, metavar="MS", type=_milliseconds(least, most), help=f"{words} ({least:g} to {most:g})")


def _milliseconds(least: float, most: float) -> Callable[[str], int]:
    def limit(text: str) -> int:
        try:
            number = float(text)
        except ValueError:
            number = float("nan")
        if not least <= number <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is no time from {least:g} to {most:g} ms")
        return round(number * 1e6)

    return limit


def chosen_limits(arguments: argparse.Namespace) -> Options:
    """The options that were given."""
    from analyzer.deframing.options import Options

    given = {name: getattr(arguments, flag[2:].replace("-", "_")) for flag, name, *_ in _LIMITS}
    t15, t35 = given["t15_ns"], given["t35_ns"]
    if t15 is not None and t35 is not None and t15 > t35:
        raise UsageError(f"--t15-ms {t15 / 1e6:g} is longer than --t35-ms {t35 / 1e6:g}")
    return Options(**{name: value for name, value in given.items() if value is not None})


def given_limits(arguments: argparse.Namespace) -> list[str]:
    """The flags that `chosen_limits` reads, as they would be given again."""
    given = ((flag, getattr(arguments, flag[2:].replace("-", "_"))) for flag, *_ in _LIMITS)
    return [word for flag, ns in given if ns is not None for word in (flag, f"{ns / 1e6:.9g}")]


def add_check_argument(parser: argparse.ArgumentParser) -> None:
    """--check."""
    parser.add_argument(
        "--check", action="store_true", help="exit status 1 where a finding of severity error is among the findings"
    )


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
