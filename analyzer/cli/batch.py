"""`rtuscope batch`: many captures, analysed into a lake."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from ..languages import counted, tr
from ..words import data_size
from .commands import DONE, FAILED, INTERRUPTED, UsageError
from .inputs import (
    add_functions_argument,
    add_limit_arguments,
    add_reading_arguments,
    chosen_limits,
    load_functions,
    reading_asked,
)
from .terminal import Progress, endable, interruptible, places, say_in_place, tell_user

if TYPE_CHECKING:
    from ..fleet.batch import BatchResult, BatchStep
    from ..fleet.linetask import BatchOptions
    from ..fleet.packs import LakePacking
    from ..fleet.runners import Runner

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope batch bus.jsonl -o lake --site plant-1
rtuscope ask lake worst-units"""
_TOLD = 20  # troubles; the rest are counted


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "source", metavar="SOURCE", nargs="*", help="captures: files, folders, globs, s3://, gs:// ... (needs fsspec)"
    )
    parser.add_argument("-o", "--output", metavar="LAKE", required=True, help="the lake: a folder or an object store")
    parser.add_argument("--resume", action="store_true", help="continue an existing lake; nothing is done twice")
    parser.add_argument(
        "--compact",
        action="store_true",
        help="merge the lake's small files into larger ones, with or without SOURCE (automatic when there are many)",
    )
    add_fleet_arguments(parser)


def add_fleet_arguments(parser: argparse.ArgumentParser) -> None:
    """What `batch` and `watch` have in common."""
    parser.add_argument(
        "--redo",
        action="store_true",
        help="in an existing lake, recompute what was made with other options or rules",
    )
    parser.add_argument("--site", metavar="NAME", help="one site for all captures (default: each capture's folder)")
    parser.add_argument(
        "--site-from",
        metavar="REGEX",
        help="a pattern on paths with groups (?P<site>...) and, if need be, (?P<line>...); or header: the note site in "
        "each capture's own header",
    )
    parser.add_argument(
        "--workers", type=_workers, metavar="N", help="processes of this machine (by default as many as it has cores)"
    )
    parser.add_argument("--scheduler", metavar="ADDRESS", help="a Dask cluster's instead: tcp://HOST:8786")
    parser.add_argument("--noise", action="store_true", help="keep the bytes between frames too")
    add_reading_arguments(parser)
    add_functions_argument(parser)
    add_limit_arguments(parser)


def _workers(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 1024:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of processes (1 to 1024)")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Make it, or go on with it."""
    from ..fleet.batch import compact_lake, run_batch
    from ..fleet.manifest import Manifest
    from ..fleet.sources import found, lines_of
    from ..fleet.stores import store

    lake = store(arguments.output)
    if not arguments.source:
        if not arguments.compact:
            raise UsageError("which captures? SOURCE is a file, a folder, a glob, s3://... (or --compact alone)")
        _tell_packed(compact_lake(lake))
        return DONE
    if not arguments.resume and Manifest(lake).newest:
        raise UsageError(f"{arguments.output}: is a lake already: use --resume to continue it")
    options, refused = batch_options(arguments), list[str]()
    lines = lines_of(found(arguments.source, refused), arguments.site, arguments.site_from, refused)
    try:
        with interruptible() as stop, endable():
            result = run_batch(
                lake,
                lines,
                options,
                chosen_runner(arguments),
                redo=arguments.redo,
                compact=arguments.compact,
                progress=shown_progress("batch"),
                stop=stop,
            )
    except KeyboardInterrupt:
        with suppress(OSError):  # the terminal may be gone
            tell_user("stopped at once; partial output is kept: continue with --resume")
        return INTERRUPTED
    result.troubles = [*refused, *result.troubles]
    tell_result(result)
    if not arguments.redo and result.outdated:
        tell_user(outdated(result))
    if result.partial:
        tell_user("interrupted; partial output is kept: continue with --resume")
        return INTERRUPTED
    return FAILED if result.is_flawed or refused else DONE


def outdated(result: BatchResult) -> str:
    """What is said of lines that are as other rules or options made them."""
    return f"lines made with other rules or options: {result.outdated}; --redo recomputes what they affect"


def batch_options(arguments: argparse.Namespace) -> BatchOptions:
    """How the captures are to be read and analysed, as was asked for. Raises UsageError for what no capture can be."""
    from pathlib import Path

    from captures.line import LineSettings

    from ..fleet.linetask import BatchOptions

    try:
        LineSettings().with_settings(arguments.baud, arguments.parity, arguments.bits, arguments.stop)
    except ValueError as error:
        raise UsageError(str(error)) from error
    load_functions(arguments)
    functions = tuple(str(Path(path).resolve()) for path in arguments.functions)
    return BatchOptions(reading_asked(arguments), chosen_limits(arguments), functions, arguments.noise)


def chosen_runner(arguments: argparse.Namespace) -> Runner:
    """Where the work is done."""
    from ..fleet.runners import ProcessPool, in_this_process

    if arguments.scheduler is not None:
        from ..fleet.runners import DaskCluster

        return DaskCluster(arguments.scheduler)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    workers = arguments.workers or cores
    return in_this_process if workers == 1 else ProcessPool(workers)


def shown_progress(command: str) -> Callable[[BatchStep], None]:
    """What tells how far a command is, on a terminal."""
    progress = Progress(command, octets_of="captures")
    return lambda step: progress(step.frames, step.done, step.done / step.total if step.total else 1.0)


def tell_result(result: BatchResult) -> None:
    """What was done, and what could not be."""
    if places(sys.stderr):
        say_in_place("")
    for trouble in result.troubles[:_TOLD]:
        tell_user(trouble)
    if len(result.troubles) > _TOLD:
        tell_user(f"and {len(result.troubles) - _TOLD:,} more (list the captures: rtuscope ask LAKE damaged)")
    damaged = tr(", {count:,} of them damaged", count=result.damaged) if result.damaged else ""
    skipped = tr(", {count:,} were there already", count=result.skipped) if result.skipped else ""
    print(
        tr(
            "{captures} of {lines} taken in{damaged}{skipped}: {frames}, {size} of the line in {time:,.1f} s",
            captures=counted(result.captures, "capture", "captures"),
            lines=counted(result.lines, "bus line", "bus lines"),
            damaged=damaged,
            skipped=skipped,
            frames=counted(result.frames, "frame", "frames"),
            size=data_size(result.octets),
            time=result.seconds,
        )
    )
    if result.packed.before:
        _tell_packed(result.packed)


def _tell_packed(packed: LakePacking) -> None:
    if packed.before:
        print(tr("{before:,} small files merged into {after:,}", before=packed.before, after=packed.after))
    else:
        print(tr("no small files to be made into larger ones"))
