"""`rtuscope watch`: new captures into a lake as they come."""

from __future__ import annotations

import argparse
import time

from .batch import add_fleet_arguments, batch_options, chosen_runner, outdated, shown_progress, tell_result
from .exits import DONE, FAILED
from .quantities import seconds
from .terminal import Stop, interruptible, tell

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
        help="where captures come: a folder, a glob, s3:// ...; may be given again",
    )
    parser.add_argument("--every", type=seconds, default=60.0, metavar="TIME", help="how often to look (60s)")
    parser.add_argument("--once", action="store_true", help="look once and end")
    add_fleet_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Take them in until Ctrl-C."""
    from ..fleet.batch import run_batch
    from ..fleet.errors import FleetError
    from ..fleet.sources import found, lines_of, settled
    from ..fleet.stores import store

    lake, options, runner = store(arguments.lake), batch_options(arguments), chosen_runner(arguments)
    told: set[str] = set()

    def tell_once(words: str) -> None:
        if words not in told:
            told.add(words)
            tell(words)

    if not arguments.once:
        tell(f"looks for new captures every {arguments.every:g} s, until Ctrl-C")
    failed = False
    with interruptible() as stop:
        while not stop():
            refused: list[str] = []
            try:
                files = settled(found(arguments.source, refused), 0.0 if arguments.once else min(arguments.every, 10.0))
                lines = lines_of(files, arguments.site, arguments.site_from, refused)
                progress = shown_progress("watch")
                result = run_batch(lake, lines, options, runner, redo=arguments.redo, progress=progress, stop=stop)
            except FleetError as error:  # a network that is down now is up again later
                if arguments.once:
                    raise
                tell_once(str(error))
            else:
                failed = bool(result.failed or result.damaged or refused)
                result.troubles = [each for each in (*refused, *result.troubles) if each not in told]
                told.update(result.troubles)
                if result.captures or result.troubles or arguments.once:
                    tell_result(result)
                if result.outdated and not arguments.redo:
                    tell_once(outdated(result))
            if arguments.once:
                return FAILED if failed else DONE
            _wait(arguments.every, stop)
    return DONE


def _wait(period_s: float, stop: Stop) -> None:
    end = time.monotonic() + period_s
    while not stop() and time.monotonic() < end:
        time.sleep(min(_STEP_S, period_s))
