"""`rtuscope repair`: a whole file of a recording that was cut."""

from __future__ import annotations

import argparse
from pathlib import Path

from dissectors.values import harmless

from ..languages import tr
from .commands import DONE, NO_FRAME
from .terminal import add_overwrite_argument, captured_words, tell_user, to_be_overwritten

EXAMPLE = """\
rtuscope simulate bus.mcap --transactions 20
rtuscope repair bus.mcap -o whole.mcap"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("file", metavar="FILE", help="a recording that was cut off or damaged; it is not changed")
    parser.add_argument(
        "-o",
        "-w",
        "--output",
        metavar="OUT",
        help="file to write (default: NAME for NAME.part, else NAME.repaired.mcap)",
    )
    add_overwrite_argument(parser, "OUT")


def run(arguments: argparse.Namespace) -> int:
    """Write it."""
    from captures.recording.mcapfile import PART, repair

    source = Path(arguments.file)
    named = arguments.output is not None or source.name.endswith(PART)
    if arguments.output is not None:
        target = Path(arguments.output)
    elif named:
        target = source.with_name(source.name.removesuffix(PART))
    else:
        target = source.with_name(f"{source.stem}.repaired.mcap")
    to_be_overwritten(target, overwrite=arguments.overwrite, source=source)
    least = int(not named)
    result = repair(source, target, least=least)
    for loss in result.damage:
        tell_user(f"{source}: {loss}")
    if result.damage_count < least:
        print(harmless(tr("{file}: nothing to repair: it can be read to its end", file=source)))
        return DONE
    print(harmless(f"{target}: {captured_words(result.chunks, result.bytes)}"))
    return DONE if result.bytes else NO_FRAME
