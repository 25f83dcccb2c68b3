"""`rtuscope watch`: new captures into a lake as they come."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from .amounts import seconds
from .batch import add_fleet_arguments, batch_options, chosen_runner, outdated, shown_progress, tell_result
from .commands import DONE, FAILED, INTERRUPTED
from .terminal import Stop, endable, interruptible, tell_user

if TYPE_CHECKING:
    from ..fleet.sources import SourceFile

EXAMPLE = """\
rtuscope simulate bus.jsonl
rtuscope watch lake --from bus.jsonl --site plant-1 --once"""
_STEP_S = 0.2  # how soon Ctrl-C is heeded


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("lake", metavar="LAKE", help="the lake: a folder or an object store")
    parser.add_argument(
        "--from",
        dest="source",
        metavar="SOURCE",
        action="append",
        required=True,
        help="where captures arrive: a folder, a glob, s3:// ...; repeatable",
    )
    parser.add_argument("--every", type=seconds, default=60.0, metavar="TIME", help="how often to look (60s)")
    parser.add_argument("--once", action="store_true", help="look once and exit")
    add_fleet_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Take them in until Ctrl-C."""
    from ..fleet import FleetError
    from ..fleet.account import refuse_unless_lake
    from ..fleet.batch import run_batch
    from ..fleet.manifest import Manifest
    from ..fleet.sources import lines_of, settled
    from ..fleet.stores import is_remote, store

    lake, options, runner = store(arguments.lake), batch_options(arguments), chosen_runner(arguments)
    told: set[str] = set()
    if not is_remote(lake.root):  # a store that does not answer now may later
        refuse_unless_lake(lake)

    def tell_once(words: str) -> None:
        if words not in told:
            told.add(words)
            tell_user(words)

    if not arguments.once:
        tell_user(f"looking for new captures every {arguments.every:g} s; press Ctrl-C to stop")
    failed, manifest = False, None
    # what a batch began when a signal ends it is left, what it did is kept
    with suppress(KeyboardInterrupt), interruptible() as stop, endable():
        while not stop():
            refused: list[str] = []
            try:
                there = _there(arguments.source, refused, None if arguments.once else tell_once)
                files = settled(there, 0.0 if arguments.once else min(arguments.every, 10.0))
                lines = lines_of(files, arguments.site, arguments.site_from, refused)
                progress = shown_progress("watch")
                manifest = manifest or Manifest(lake)
                result = run_batch(
                    lake,
                    lines,
                    options,
                    runner,
                    redo=arguments.redo,
                    progress=progress,
                    stop=stop,
                    manifest=manifest,
                )
            except FleetError as error:  # a network that is down now is up again later
                if arguments.once:
                    raise
                tell_once(str(error))
            else:
                failed = bool(result.is_flawed or refused)
                result.troubles = [each for each in (*refused, *result.troubles) if each not in told]
                told.update(result.troubles)
                if result.captures or result.troubles or arguments.once:
                    tell_result(result)
                if result.outdated and not arguments.redo:
                    tell_once(outdated(result))
            if arguments.once:
                return FAILED if failed else DONE
            _wait(arguments.every, stop)
    return INTERRUPTED if arguments.once else DONE


def _there(sources: list[str], refused: list[str], tell: Callable[[str], None] | None) -> list[SourceFile]:
    """The captures of all sources. One that names none now is told, if somebody takes that, and the rest taken."""
    from ..fleet import FleetError
    from ..fleet.sources import found

    if tell is None:
        return found(sources, refused)
    files: dict[str, SourceFile] = {}
    for source in sources:
        try:
            files |= {file.url: file for file in found([source], refused)}
        except FleetError as error:
            tell(str(error))
    return [files[url] for url in sorted(files)]


def _wait(period_s: float, stop: Stop) -> None:
    end = time.monotonic() + period_s
    while not stop() and time.monotonic() < end:
        time.sleep(min(_STEP_S, period_s))
