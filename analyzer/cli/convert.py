"""`rtuscope convert`: convert captures: change format, cut, merge, correct clocks."""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext, suppress
from itertools import chain
from typing import TYPE_CHECKING, Final

from dissectors.values import harmless

from ..meant import did_you_mean
from .amounts import moment, time_span
from .commands import DONE, INTERRUPTED, NO_FRAME, UsageError
from .inputs import (
    CAPTURE_HELP,
    add_functions_argument,
    add_reading_arguments,
    capture_format,
    load_functions,
    opened_capture,
    tell_damage,
)
from .lineoptions import add_kept_names
from .terminal import (
    Progress,
    add_overwrite_argument,
    captured_words,
    interruptible,
    tell_partial,
    tell_user,
    to_be_overwritten,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from captures import Block, Capture
    from captures.formats import Format

_SECONDS: Final = 5.0
_MOST_SECONDS: Final = 1e6
_OPTIONS: Final = {"baud": "--baud", "char_bits": "--bits", "parity": "--parity", "stop_bits": "--stop"}
EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope convert bus.jsonl -o bus.mcap
rtuscope convert bus.jsonl -o part.jsonl --frames 100..200
rtuscope convert bus.jsonl -o near.jsonl --around 'crc_ok == false' --seconds 1
rtuscope convert bus.jsonl bus.mcap -o both.jsonl --port-name plc --port-name meter --shift 2=+250ms"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("captures", nargs="+", metavar="IN", help=f"{CAPTURE_HELP}; several are merged by time")
    parser.add_argument(
        "-o", "-w", "--output", metavar="OUT", required=True, help="file to write; - is standard output"
    )
    add_overwrite_argument(parser, "OUT")
    parser.add_argument(
        "--to-format",
        type=capture_format,
        metavar="F",
        help="serial-chunks, mcap, pcapng, bin or text; default: from OUT's suffix, else serial-chunks",
    )
    cut = parser.add_argument_group("what to keep (default: everything)")
    begin = cut.add_argument(
        "--start",
        dest="begin",
        metavar="T",
        help="from this time on: 12.5s after the first byte, 08:30:00, 2026-01-31T08:30Z",
    )
    end = cut.add_argument("--end", dest="end", metavar="T", help="up to this time")
    add_kept_names(cut, begin, "--from")
    add_kept_names(cut, end, "--to")
    cut.add_argument(
        "--frames", metavar="A..B", help="these frames, by their numbers in an export, and everything between them"
    )
    cut.add_argument("--around", metavar="FILTER", help="everything near matching frames, such as 'exception'")
    cut.add_argument("--seconds", type=float, metavar="S", help="with --around: seconds before and after (5)")
    merge = parser.add_argument_group("merging")
    names = merge.add_argument(
        "--port-name",
        dest="names",
        action="append",
        default=[],
        metavar="NAME",
        help="name of the ports of the next IN",
    )
    add_kept_names(merge, names, "--port")
    merge.add_argument(
        "--shift",
        action="append",
        default=[],
        metavar="[N=]T",
        help="add to the times of IN number N, else of all: --shift 2=+1.5s, --shift=-250ms",
    )
    add_reading_arguments(parser)
    add_functions_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write it."""
    import captures
    from captures.editing import unlike_settings
    from captures.files import Unfinished, replacing

    from ..core import observed

    load_functions(arguments)
    paths: list[str] = arguments.captures
    if len(arguments.names) > len(paths):
        raise UsageError(f"--port-name is given {len(arguments.names)} times for {len(paths)} captures")
    if arguments.seconds is not None and arguments.around is None:
        raise UsageError("--seconds needs --around")
    chosen = _format(arguments)
    opened = [opened_capture(path, arguments) for path in paths]
    for capture in opened:
        to_be_overwritten(arguments.output, overwrite=arguments.overwrite, source=capture.path)
    progress = Progress(f"convert {paths[0]}", "reads")
    written = _Written(progress)
    with interruptible() as stop:
        unfinished = Unfinished(stop)
        merged = _merged(opened, arguments)
        edited = _cut(merged, arguments)
        kept = observed(edited, look=written.count, stop=stop)
        to_stdout, nothing = arguments.output == "-", ""
        out = (
            nullcontext(sys.stdout.buffer)
            if to_stdout
            else replacing(arguments.output, private=True, unfinished=unfinished)
        )
        with suppress(_NothingKeptError), out as file:
            captures.write(file, kept, format=chosen.name)
            if not (written.bytes or edited is merged or to_stdout):
                nothing = _nothing_of(merged)
                raise _NothingKeptError
        stopped = stop()
    progress.clear()
    for path, capture in zip(paths, opened, strict=True):
        tell_damage(path, capture)
    if nothing:
        tell_user(f"{arguments.output}: not written: {nothing}")
        return INTERRUPTED if stopped else NO_FRAME
    if lost := _lost(edited, chosen, written):
        tell_user(f"{arguments.output}: this format cannot store {', '.join(lost)}")
    if unlike := [_OPTIONS[name] for name in unlike_settings(opened) if name in _OPTIONS]:
        tell_user(f"{arguments.output}: the captures differ in {', '.join(unlike)}; give these where you read it")
    line = f"{unfinished.where(arguments.output)}: {captured_words(written.reads, written.bytes)}"
    print(harmless(line), file=sys.stderr if to_stdout else sys.stdout)
    if stopped:
        tell_partial(unfinished.path)
        return INTERRUPTED
    return DONE if written.bytes else NO_FRAME


class _NothingKeptError(Exception):
    """Whatever was to be kept, there is none of it: what has the output's name stays."""


def _nothing_of(capture: Capture) -> str:
    """That nothing of a capture is kept, and when its bytes came."""
    from ..words import duration, is_clock, moment

    if not capture.timed:
        return "nothing is kept of the capture"
    times = [*_times(capture)]
    first, last = min(times, default=0), max(times, default=0)
    begin = moment(first) if is_clock(first) else duration(first)
    return f"nothing is kept of the capture, which lasts {duration(last - first)} from {begin}"


def _times(capture: Capture) -> Iterator[int]:
    """When the bytes of each block began and ended, ns."""
    return chain.from_iterable(block.t_ns[[0, -1]].tolist() for block in filter(len, capture.blocks()))


class _Written:
    """How much was written, told as it grows."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self.reads = self.bytes = 0
        self.ports = self.errors = False

    def count(self, block: Block) -> None:
        """One more block."""
        self.reads += len(block)
        self.bytes += len(block.data)
        self.ports = self.ports or bool(block.port.any())
        self.errors = self.errors or bool(len(block.errors))
        self._progress(self.reads, self.bytes)


def _format(arguments: argparse.Namespace) -> Format:
    from pathlib import Path

    from captures import CaptureError
    from captures.formats import by_name, for_writing, written_suffixes

    if arguments.to_format is None and arguments.output != "-":
        path = Path(arguments.output)
        try:
            return for_writing(path)
        except CaptureError:
            near = did_you_mean(path.suffix, written_suffixes())
            if not near:
                raise
            raise UsageError(f"{path}: no format writes the suffix {path.suffix!r}{near}") from None
    chosen = by_name(arguments.to_format or "serial-chunks")
    if chosen.write is None:
        raise UsageError(f"--to-format {chosen.name}: this format can be read, but not written")
    return chosen


def _lost(capture: Capture, chosen: Format, written: _Written) -> list[str]:
    """What the format cannot hold."""
    from captures.io import keeps_notes

    lost = []
    if chosen.name == "bin" and capture.timed:
        lost.append("times and direction marks")
    if chosen.name in ("bin", "text"):
        lost += ["the line's settings"] if capture.line.baud is not None else []
        lost += ["ports"] if written.ports else []
        lost += ["marks of wrong bytes"] if written.errors else []
    if not keeps_notes(chosen) and capture.notes():
        lost.append("notes")
    return lost


def _merged(opened: list[Capture], arguments: argparse.Namespace) -> Capture:
    from captures.editing import merged, shifted

    shifts = [0] * len(opened)
    for text in arguments.shift:
        number, sign, words = text.rpartition("=")
        if sign and not (number.isdecimal() and 1 <= int(number) <= len(opened)):
            raise UsageError(f"--shift {text}: the number before = must be that of an IN, 1 to {len(opened)}")
        for i in [int(number) - 1] if sign else range(len(opened)):
            shifts[i] += time_span(words, "--shift")
    for capture, shift in zip(opened, shifts, strict=True):
        if shift and not capture.timed:
            raise UsageError(f"--shift: {capture.path or 'the capture'} has no timestamps")
    moved = [shifted(capture, shift) if shift else capture for capture, shift in zip(opened, shifts, strict=True)]
    return merged(moved, arguments.names)


def _cut(capture: Capture, arguments: argparse.Namespace) -> Capture:
    """What is asked for of it; each way of cutting narrows what the ones before have left."""
    from captures.editing import cut_to_times

    if arguments.begin is not None or arguments.end is not None:
        from captures.io import time_zone

        first = next(_times(capture), 0)
        zone = None if arguments.tz is None else time_zone(arguments.tz)
        begin = -(1 << 62) if arguments.begin is None else moment(arguments.begin, "--start", first, zone)
        end = 1 << 62 if arguments.end is None else moment(arguments.end, "--end", first, zone)
        if begin > end:
            raise UsageError(f"--start {arguments.begin} is later than --end {arguments.end}")
        capture = cut_to_times(capture, [(begin, end)])
    if arguments.frames is not None:
        from ..exports.running import frames_only

        low, dots, high = arguments.frames.partition("..")
        if not (low.isdecimal() and (high.isdecimal() if dots else True)) or int(low) > int(high or low):
            raise UsageError(f"--frames {arguments.frames}: give a number, or two as in 100..200")
        capture = frames_only(capture, int(low), int(high or low))
    if arguments.around is not None:
        capture = _around(capture, arguments)
    return capture


def _around(capture: Capture, arguments: argparse.Namespace) -> Capture:
    from ..exports.running import around
    from ..filters import FilterError, compile_filter

    seconds = _SECONDS if arguments.seconds is None else arguments.seconds
    if not 0 <= seconds <= _MOST_SECONDS:
        raise UsageError(f"--seconds {seconds:g}: must be 0 to {_MOST_SECONDS:g}")
    try:
        capture, count = around(capture, compile_filter(arguments.around, capture.line), seconds)
    except FilterError as error:
        raise UsageError(f"--around: {error}") from error
    if not count:
        tell_user("--around: nothing matches the filter")
    return capture
