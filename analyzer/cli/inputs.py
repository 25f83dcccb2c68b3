"""What several commands take in: a capture, how it is to be read, declarations of vendor functions, register maps."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from captures.line import POLARITIES

from ..meant import did_you_mean
from .commands import UsageError
from .lineoptions import LineWords, add_kept_names, add_line_arguments
from .terminal import tell_user

if TYPE_CHECKING:
    from captures import Capture
    from captures.line import LineSettings
    from dissectors.maps.files import UnitMaps

    from ..filters import Filter
    from ..options import Options

_GROUP: Final = b"[rtuscope.functions]"
_LIMITS: Final = (  # flag, option, least and most in ms, help
    ("--t15-ms", "t15_ns", 0.01, 5000.0, "longest silence inside a frame (1.5 characters)"),
    ("--t35-ms", "t35_ns", 0.01, 5000.0, "shortest silence between frames (3.5 characters)"),
    ("--turnaround-ms", "turnaround_ns", 0.0, 60000.0, "shortest pause after a broadcast, default 100"),
    ("--idle-ms", "idle_ns", 5.0, 5000.0, "silence after which the line counts as idle, default 50"),
)
CAPTURE_HELP: Final = (
    "a capture: .jsonl, .mcap, .pcapng, .sr, .vcd, .csv, .txt, .bin ... (rtuscope help formats); - is standard input; "
    "-r CAPTURE as well"
)
_READING: Final = (
    "baud",
    "parity",
    "bits",
    "stop",
    "polarity",
    "tz",
    "sample_rate",
    "only_port",
)  # what `captures.open` takes besides the format
_LAST: Final = 255
_COMPLAINTS: Final = 5  # complaints printed; the rest are counted


def add_capture_arguments(parser: argparse.ArgumentParser, *, format_flag: bool = True) -> None:
    """CAPTURE, how it is read, and --functions."""
    parser.add_argument("capture", metavar="CAPTURE", help=CAPTURE_HELP)
    add_reading_arguments(parser, format_flag=format_flag)
    add_functions_argument(parser)


def add_reading_arguments(parser: argparse.ArgumentParser, *, format_flag: bool = True) -> None:
    """--input-format, --baud and the like; without `format_flag` the command has a --format of its own."""
    group = parser.add_argument_group(
        "reading the capture (default: settings in the file, else inferred from its bytes)"
    )
    option = group.add_argument(
        "--input-format",
        type=capture_format,
        metavar="NAME",
        help="its format: analyser-session, bin, mcap, pcap, pcapng, saleae, saleae-binary, saleae-edges, scope-table, "
        "serial-chunks, sigrok, sigrok-table, text, vcd (rtuscope help formats)",
    )
    if format_flag:
        add_kept_names(group, option, "--format")
    add_line_arguments(group, LineWords())
    group.add_argument(
        "--polarity", choices=POLARITIES, help="for a logic analyser's edges: inverted means low when idle"
    )
    add_zone_argument(group)
    group.add_argument(
        "--sample-rate", type=float, metavar="HZ", help="for a log or table with sample numbers (sigrok-cli -A)"
    )
    group.add_argument(
        "--only-port", type=_port_number, metavar="N", help="read only port N of a capture that holds several lines"
    )


def known_name(text: str, find: Callable[[str], object], what: str, names: Callable[[], Iterable[str]]) -> str:
    """A name that `find` knows, for argparse; of one that it refuses, that which may have been meant of `names`."""
    from captures import CaptureError

    try:
        find(text)
    except (CaptureError, ValueError) as error:
        near = did_you_mean(text, names())
        raise argparse.ArgumentTypeError(f"no {what} {text!r}{near}" if near else str(error)) from None
    return text


def capture_format(text: str) -> str:
    """The name of a capture format; for argparse."""
    from captures.formats import by_name, foreign_formats, formats

    return known_name(text, by_name, "capture format named", lambda: [*formats(), *foreign_formats()])


def add_zone_argument(parser: argparse._ActionsContainer) -> None:
    """--tz."""
    parser.add_argument(
        "--tz",
        type=zone_name,
        metavar="ZONE",
        help="time zone for timestamps that carry none: Europe/Moscow, +03:00, UTC (default: local)",
    )


def zone_name(text: str) -> str:
    """The name or the offset of a time zone that there is; for argparse."""
    from zoneinfo import available_timezones

    from captures.io import time_zone

    return known_name(text, time_zone, "time zone", available_timezones)


def unit_number(text: str) -> int:
    """A unit's number, for argparse."""
    if not text.isdecimal() or int(text) > _LAST:
        raise argparse.ArgumentTypeError(f"{text!r} is not a unit address (0 to {_LAST})")
    return int(text)


def _port_number(text: str) -> int:
    """The number of a capture's port, for argparse."""
    if not text.isdecimal() or int(text) > _LAST:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port's number (0 to {_LAST})")
    return int(text)


def add_functions_argument(parser: argparse.ArgumentParser) -> None:
    """--functions."""
    parser.add_argument(
        "--functions",
        metavar="FILE",
        action="append",
        default=[],
        help="a Python file that declares vendor functions; it is executed: only use files that you trust",
    )


def add_columns_arguments(parser: argparse._ActionsContainer, verb: str) -> None:
    """--fields and --count; `verb` is what becomes of frames."""
    parser.add_argument(
        "--fields",
        type=_names,
        default=(),
        metavar="NAME,NAME",
        help="only these columns, in this order: time,unit,function,summary (rtuscope help tables)",
    )
    parser.add_argument(
        "-c", "--count", type=_count, default=sys.maxsize, metavar="N", help=f"stop after N frames {verb}"
    )


def _names(text: str) -> tuple[str, ...]:
    """Names between commas; for argparse."""
    names = tuple(filter(None, (name.strip() for name in text.split(","))))
    if not names:
        raise argparse.ArgumentTypeError("name a column, such as time,unit,function")
    return names


def _count(text: str) -> int:
    """A number of frames, for argparse."""
    if not text.lstrip("0").isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of at least 1")
    return int(text)


def add_filter_argument(parser: argparse.ArgumentParser) -> None:
    """--filter."""
    parser.add_argument(
        "-Y",
        "--filter",
        metavar="FILTER",
        help="only rows that match, such as 'unit == 17 and exception' (rtuscope help filters)",
    )


def chosen_filter(arguments: argparse.Namespace, line: LineSettings, charts: UnitMaps | None = None) -> Filter | None:
    """The filter that was given, for a line of these settings, with the names of these register maps."""
    if arguments.filter is None:
        return None
    from ..filters import FilterError, compile_filter

    try:
        return compile_filter(arguments.filter, line, charts)
    except FilterError as error:
        raise UsageError(f"--filter: {error}") from error


def add_limit_arguments(parser: argparse.ArgumentParser, *, only: str | None = None) -> None:
    """--t15-ms and the like: what of the line's timing is set otherwise than the specification has it."""
    group = parser.add_argument_group("timing limits, for a line that differs from the specification")
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
            raise argparse.ArgumentTypeError(f"{text!r} is not between {least:g} and {most:g} ms")
        return round(number * 1e6)

    return limit


def chosen_limits(arguments: argparse.Namespace) -> Options:
    """The options that were given."""
    from ..options import Options

    limits = {name: getattr(arguments, flag[2:].replace("-", "_")) for flag, name, *_ in _LIMITS}
    t15, t35 = limits["t15_ns"], limits["t35_ns"]
    if t15 is not None and t35 is not None and t15 > t35:
        raise UsageError(f"--t15-ms {t15 / 1e6:g} is longer than --t35-ms {t35 / 1e6:g}")
    return Options(**{name: value for name, value in limits.items() if value is not None})


def given_limits(arguments: argparse.Namespace) -> list[str]:
    """The flags that `chosen_limits` reads, as they would be given again."""
    flags = ((flag, getattr(arguments, flag[2:].replace("-", "_"))) for flag, *_ in _LIMITS)
    return [word for flag, ns in flags if ns is not None for word in (flag, f"{ns / 1e6:.9g}")]


def add_check_argument(parser: argparse.ArgumentParser) -> None:
    """--check."""
    parser.add_argument("--check", action="store_true", help="exit with status 1 if there is any error-level finding")


def load_functions(arguments: argparse.Namespace) -> None:
    """Declare what the installed plug-ins and the named files declare; both are code that is run."""
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
    """The capture that was named, read as was asked for; what should be known of that goes to standard error."""
    return opened_capture(arguments.capture, arguments)


def opened_capture(path: str, arguments: argparse.Namespace) -> Capture:
    """The same of one file among several."""
    capture = capture_as_asked(path, arguments)
    for notice in capture.notices:
        tell_user(notice)
    return capture


def capture_as_asked(path: str, arguments: argparse.Namespace) -> Capture:
    """A file, read as was asked for; nothing is told."""
    import captures

    from ..paste import judge

    return captures.open(path, judge=judge, **reading_asked(arguments))


def reading_asked(arguments: argparse.Namespace) -> dict[str, Any]:
    """How captures are to be read, as far as it was asked for: keywords of `captures.open`."""
    asked = {"format": arguments.input_format, **{name: getattr(arguments, name) for name in _READING}}
    return {name: value for name, value in asked.items() if value is not None}


def given_reading(arguments: argparse.Namespace) -> list[str]:
    """The flags that `open_capture` reads, as they would be given again."""
    flags = [("--input-format", arguments.input_format)]
    flags += [(f"--{name.replace('_', '-')}", getattr(arguments, name)) for name in _READING]
    return [word for flag, value in flags if value is not None for word in (flag, str(value))]


def tell_damage(name: str, capture: Capture) -> None:
    """Say what of the capture could not be read."""
    for loss in capture.damage[:_COMPLAINTS]:
        tell_user(f"{name}: {loss}")
    if capture.damage_count > _COMPLAINTS:
        tell_user(f"{name}: and {capture.damage_count - _COMPLAINTS:,} more such places")


def add_map_argument(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """--map."""
    parser.add_argument(
        "--map",
        metavar="MAP[@UNIT]",
        action="append",
        default=[],
        help="a register map, a file or one of `rtuscope map list`, for one unit or for all; repeatable",
    )


def chosen_charts(arguments: argparse.Namespace) -> UnitMaps:
    """The maps that were given."""
    from dissectors.maps.files import unit_maps

    return unit_maps(arguments.map)
