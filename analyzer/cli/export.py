"""`rtuscope export`: the frames of a capture, for other programs."""

from __future__ import annotations

import argparse
import sys

from .app import DONE, INTERRUPTED, NO_FRAME
from .inputs import add_capture_arguments, load_functions, open_capture, tell_damage
from .terminal import Progress, interruptible

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope export bus.jsonl -o frames.csv
rtuscope export bus.jsonl --noise --explain"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument(
        "-o", "--output", metavar="OUT", default="-", help="file to write; - is standard output (default)"
    )
    parser.add_argument(
        "--format", metavar="F", help="jsonl, csv, mcap or pcapng; by default OUT's suffix tells, else jsonl"
    )
    parser.add_argument(
        "--noise", action="store_true", help="write the bytes between frames too, so that all bytes are there"
    )
    parser.add_argument("--explain", action="store_true", help="tell why each frame's boundaries stand where they do")


def run(arguments: argparse.Namespace) -> int:
    """Write it."""
    from analyzer.exports import ExportOptions, export

    load_functions(arguments)
    capture = open_capture(arguments)
    progress = Progress(f"export {arguments.capture}")
    with interruptible() as stop:
        done = export(
            capture,
            arguments.output,
            name=arguments.format,
            options=ExportOptions(explain=arguments.explain, noise=arguments.noise),
            progress=progress,
            stop=stop,
        )
    progress.clear()
    tell_damage(arguments.capture, capture)
    if done.partial:
        print("rtuscope: stopped by Ctrl-C; what was done is kept, and partial", file=sys.stderr)
        return INTERRUPTED
    if not done.frames:
        print(f"rtuscope: {arguments.capture}: no Modbus frame found in {done.bytes:,} bytes", file=sys.stderr)
        return NO_FRAME
    return DONE
