"""`rtuscope export`: the frames of a capture, for other programs."""

from __future__ import annotations

import argparse
import sys

from .app import DONE, FAILED, INTERRUPTED, NO_FRAME
from .inputs import (
    add_capture_arguments,
    add_check_argument,
    add_filter_argument,
    add_limit_arguments,
    chosen_filter,
    chosen_limits,
    load_functions,
    open_capture,
    tell_damage,
)
from .terminal import Progress, interruptible

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope export bus.jsonl -o frames.csv
rtuscope export bus.jsonl --filter 'exception or crc_ok == false'
rtuscope export bus.jsonl --noise --explain"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument(
        "-o", "--output", metavar="OUT", default="-", help="file to write; - is standard output (default)"
    )
    parser.add_argument(
        "--format", metavar="F", help="jsonl, csv, mcap, parquet or pcapng; by default OUT's suffix tells, else jsonl"
    )
    add_filter_argument(parser)
    parser.add_argument(
        "--noise", action="store_true", help="write the bytes between frames too, so that all bytes are there"
    )
    parser.add_argument("--explain", action="store_true", help="tell why each frame's boundaries stand where they do")
    add_check_argument(parser)
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write it."""
    from analyzer.exports import ExportOptions, export

    load_functions(arguments)
    limits = chosen_limits(arguments)
    capture = open_capture(arguments)
    chosen = chosen_filter(arguments, capture.line)
    progress = Progress(f"export {arguments.capture}")
    with interruptible() as stop:
        done = export(
            capture,
            arguments.output,
            name=arguments.format,
            options=ExportOptions(explain=arguments.explain, noise=arguments.noise, filter=chosen),
            limits=limits,
            progress=progress,
            stop=stop,
        )
    progress.clear()
    tell_damage(arguments.capture, capture)
    if done.partial:
        print("rtuscope: stopped by Ctrl-C; what was done is kept, and partial", file=sys.stderr)
        return INTERRUPTED
    if chosen is not None and not done.bytes:
        print(f"rtuscope: {arguments.capture}: nothing passes the filter", file=sys.stderr)
        return NO_FRAME
    if not done.frames and not (chosen is not None and "noise" in chosen.fields):
        print(f"rtuscope: {arguments.capture}: no Modbus frame found in {done.bytes:,} bytes", file=sys.stderr)
        return NO_FRAME
    if arguments.check and done.errors:
        print(f"rtuscope: {arguments.capture}: {done.errors:,} findings of severity error", file=sys.stderr)
        return FAILED
    return DONE
