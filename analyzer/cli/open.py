"""`rtuscope open`: a capture in the terminal interface; without one, a prompt to paste bytes at."""

from __future__ import annotations

import argparse
import os
import shlex
import sys

from .app import DONE, UsageError
from .inputs import add_functions_argument, add_limit_arguments, chosen_limits, given_limits, load_functions
from .terminal import full_screen

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope open bus.jsonl
rtuscope open"""
_PORT = 8000


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "capture",
        nargs="?",
        metavar="CAPTURE",
        help="a capture: .jsonl, .mcap, .bin, .txt, .log ...; none: paste bytes",
    )
    parser.add_argument("--light", action="store_true", help="dark on light (d switches)")
    parser.add_argument("--web", action="store_true", help="serve it to a browser on this machine instead")
    parser.add_argument("--host", default="127.0.0.1", help="with --web: address to listen at (127.0.0.1)")
    parser.add_argument("--port", type=int, default=_PORT, help=f"with --web: port to listen at ({_PORT})")
    add_functions_argument(parser)
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Show it."""
    import captures

    load_functions(arguments)
    limits = chosen_limits(arguments)
    capture = None if arguments.capture is None else captures.open(arguments.capture)
    if arguments.web:
        serve(arguments)
        return DONE
    needs_a_terminal("open")
    from analyzer.model.source import CaptureSource, Nothing
    from analyzer.tui import run as show

    if capture is None:
        show(Nothing(), view="paste", light=arguments.light)
    else:
        name = capture.path.name if capture.path else "capture"
        show(CaptureSource(capture, name, limits), light=arguments.light)
    return DONE


def needs_a_terminal(command: str) -> None:
    """UsageError where there is none; a browser will do."""
    if "TEXTUAL_DRIVER" not in os.environ and not full_screen():
        raise UsageError(
            f"{command} needs a terminal; on a pipe or with TERM=dumb use rtuscope report, export or parse"
        )


def serve(arguments: argparse.Namespace) -> None:
    """The same in a browser, one process a tab, until Ctrl-C."""
    try:
        from textual_serve.server import Server
    except ImportError as error:
        raise UsageError("--web needs textual-serve: pip install 'rtuscope[web]'") from error
    command = [sys.executable, "-m", "analyzer.cli", "open"]
    command += [str(arguments.capture)] if arguments.capture is not None else []
    command += ["--light"] if arguments.light else []
    for path in arguments.functions:
        command += ["--functions", path]
    command += given_limits(arguments)
    if arguments.host not in ("127.0.0.1", "localhost", "::1"):
        print(
            f"rtuscope: anybody who reaches {arguments.host}:{arguments.port} sees this capture; there is no password",
            file=sys.stderr,
        )
    Server(shlex.join(command), host=arguments.host, port=arguments.port, title="rtuscope").serve()
