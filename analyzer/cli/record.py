"""`rtuscope record`: only records, unattended, for days."""

from __future__ import annotations

import argparse
import time

from .app import DONE, FAILED
from .inputs import add_limit_arguments
from .quantities import seconds
from .taps import add_recording_arguments, add_tap_arguments, recorder_of, tap_of
from .telling import Teller
from .watching import ended_by_signals

EXAMPLE = """\
rtuscope record /dev/ttyUSB0 --baud 19200 --parity E -o bus.mcap
rtuscope record /dev/ttyUSB0 -o /var/lib/rtuscope/bus.mcap --rotate-every 1h --keep 7d --keep 2GB --wait"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_tap_arguments(parser)
    add_recording_arguments(parser, needed=True)
    add_limit_arguments(parser, only="--idle-ms")
    parser.add_argument("--duration", type=seconds, metavar="TIME", help="stop after this time: 90s, 15min, 12h")


def run(arguments: argparse.Namespace) -> int:
    """Listen and record: no analysis but what finding the line's settings takes."""
    from captures.chunks import Block
    from captures.live.wire import PortEvent
    from captures.recording.notes import Note

    with Teller() as tell:
        recorder = recorder_of(arguments, tell)
        assert recorder is not None  # -o is needed
        begun = time.monotonic()
        heard = 0
        try:
            source = tap_of(arguments, watched=False)
            with ended_by_signals(source.close):
                for item in source.items():
                    if isinstance(item, Block):
                        recorder.write(item)
                        heard += len(item.data)
                    elif isinstance(item, PortEvent):
                        if item.kind == "settled":
                            recorder.settings(source.line)
                        if item.kind != "settings":
                            tell(item.text)
                            recorder.note(Note(item.t_ns, item.kind, item.text))
                    recorder.tick()
                    paused = "  PAUSED" if recorder.paused else ""
                    tell.status(f"{heard:,} bytes heard, {recorder.bytes:,} on the disk{paused}")
                    if arguments.duration and time.monotonic() - begun >= arguments.duration:
                        source.close()
        finally:
            recorder.close()
        tell(recorder.result)
    return FAILED if recorder.lost else DONE
