"""`rtuscope open`: a capture in the terminal interface; without one, a prompt to paste bytes at."""

from __future__ import annotations

import argparse
import os
import sys
from datetime import UTC
from pathlib import Path
from typing import TYPE_CHECKING

from .exits import DONE, UsageError
from .inputs import (
    CAPTURE_HELP,
    add_functions_argument,
    add_limit_arguments,
    add_map_argument,
    add_reading_arguments,
    chosen_charts,
    chosen_limits,
    given_limits,
    given_reading,
    load_functions,
    open_capture,
)
from .terminal import full_screen

if TYPE_CHECKING:
    from captures import Capture

    from ..options import Options

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope open bus.jsonl
rtuscope open"""
_PORT = 8000
_MOST_PORT = 65535


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "capture",
        nargs="?",
        metavar="CAPTURE",
        help=f"{CAPTURE_HELP}; none: paste bytes",
    )
    parser.add_argument("--light", action="store_true", help="dark on light (D switches)")
    parser.add_argument("--plain", action="store_true", help="read it out in plain lines, for a screen reader")
    parser.add_argument("-Y", "--filter", metavar="FILTER", default="", help="with --plain: only what passes")
    parser.add_argument("--web", action="store_true", help="serve it to a browser on this machine instead")
    parser.add_argument("--host", default="127.0.0.1", help="with --web: address to listen at (127.0.0.1)")
    parser.add_argument("--port", type=port, default=_PORT, help=f"with --web: port to listen at ({_PORT})")
    add_reading_arguments(parser)
    add_functions_argument(parser)
    add_map_argument(parser)
    add_limit_arguments(parser)


def port(text: str) -> int:
    """A TCP port; 0 is any that is free; for argparse."""
    if not text.isdecimal() or int(text) > _MOST_PORT:
        raise argparse.ArgumentTypeError(f"{text!r} is no port from 0 to {_MOST_PORT}")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Show it."""
    load_functions(arguments)
    limits = chosen_limits(arguments)
    charts = chosen_charts(arguments)
    capture = None if arguments.capture is None else open_capture(arguments)
    if arguments.web:
        from .web import serve

        serve(in_a_browser(arguments), arguments.host, arguments.port)
        return DONE
    if arguments.plain:
        return read_out(arguments, capture, limits)
    needs_a_terminal("open")
    from captures.io import time_zone

    from ..model.source import CaptureSource, Nothing
    from ..tui import run as show

    if capture is None:
        show(Nothing(), view="paste", light=arguments.light)
    else:
        name = capture.path.name if capture.path else "capture"
        shown_in = UTC if arguments.tz is None else time_zone(arguments.tz)

        def again(path: Path) -> CaptureSource:
            arguments.capture = str(path)
            return CaptureSource(open_capture(arguments), path.name, limits)

        source = CaptureSource(capture, name, limits)
        show(source, light=arguments.light, zone=shown_in, charts=charts.of, reader=again)
    return DONE


def read_out(arguments: argparse.Namespace, capture: Capture | None, limits: Options) -> int:
    """The capture in plain lines."""
    if capture is None:
        raise UsageError("--plain reads out a capture: which one?")
    from captures.io import time_zone

    from ..filters import FilterError
    from ..model.source import CaptureSource
    from ..model.spoken import spoken

    name = capture.path.name if capture.path else "capture"
    try:
        zone = UTC if arguments.tz is None else time_zone(arguments.tz)
        for line in spoken(CaptureSource(capture, name, limits), arguments.filter, zone):
            print(line)
    except FilterError as error:
        raise UsageError(f"--filter: {error}") from error
    return DONE


def needs_a_terminal(command: str) -> None:
    """UsageError where there is none; a browser will do."""
    if "TEXTUAL_DRIVER" not in os.environ and not full_screen():
        raise UsageError(
            f"{command} needs a terminal; on a pipe or with TERM=dumb use rtuscope report, export or parse"
        )


def in_a_browser(arguments: argparse.Namespace) -> list[str]:
    """The command that shows the same to a browser: no module of the folder that it is started in gets into it (-P)."""
    command = [sys.executable, "-P", "-m", "analyzer.cli", "open"]
    command += ["--light"] if arguments.light else []
    command += [f"--lang={arguments.lang}"] if arguments.lang else []
    command += [f"--functions={path}" for path in arguments.functions]
    command += [f"--map={name}" for name in arguments.map]
    command += given_reading(arguments)
    command += given_limits(arguments)
    command += ["--", str(arguments.capture)] if arguments.capture is not None else []
    return command
