"""`rtuscope repair`: a whole file of a recording that was cut."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from .app import DONE, NO_FRAME, UsageError

EXAMPLE = """\
rtuscope simulate bus.mcap --transactions 20
rtuscope repair bus.mcap -o whole.mcap"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("file", metavar="FILE", help="a recording that was cut or damaged; it is left as it is")
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="file to write: by default NAME for NAME.part, else NAME.repaired.mcap",
    )
    parser.add_argument("--overwrite", action="store_true", help="even if OUT is there already")


def run(arguments: argparse.Namespace) -> int:
    """Write it."""
    from captures.recording.mcapfile import PART
    from captures.recording.repair import repair

    source = Path(arguments.file)
    if arguments.output is not None:
        target = Path(arguments.output)
    elif source.name.endswith(PART):
        target = source.with_name(source.name.removesuffix(PART))
    else:
        target = source.with_name(f"{source.stem}.repaired.mcap")
    if target.exists() and not arguments.overwrite:
        raise UsageError(f"{target}: is there already: give another name with -o, or --overwrite")
    if target.exists() and target.samefile(source):
        raise UsageError(f"{target}: is the file to repair: give another name with -o")
    done = repair(source, target)
    for loss in done.damage:
        print(f"rtuscope: {source}: {loss}", file=sys.stderr)
    print(f"{target}: {done.chunks:,} reads, {done.bytes:,} bytes of the line")
    return DONE if done.bytes else NO_FRAME
