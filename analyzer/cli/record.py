"""`rtuscope record`: only records, unattended, for days."""

from __future__ import annotations

import argparse
import sys
import time

from .app import DONE
from .inputs import add_limit_arguments
from .quantities import seconds
from .taps import add_recording_arguments, add_tap_arguments, recorder_of, tap_of, tell
from .terminal import places
from .watching import ended_by_signals

EXAMPLE = """\
rtuscope record /dev/ttyUSB0 --baud 19200 --parity E -o bus.mcap
rtuscope record /dev/ttyUSB0 -o /var/lib/rtuscope/bus.mcap --rotate-every 1h --keep 7d --keep 2GB --wait"""

_PERIOD_NS = 1_000_000_000


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_tap_arguments(parser)
    add_recording_arguments(parser, needed=True)
    add_limit_arguments(parser, only="--idle-ms")
    parser.add_argument("--duration", type=seconds, metavar="TIME", help="stop after this time: 90s, 15min, 12h")


def run(arguments: argparse.Namespace) -> int:
    """Listen and record: no analysis but what finding the line's settings takes."""
    from captures.chunks import Block
    from captures.live.wire import Event
    from captures.recording.notes import Note

    recorder = recorder_of(arguments)
    assert recorder is not None  # -o is needed
    begun = time.monotonic()
    heard, shown = 0, places(sys.stderr)
    try:
        source = tap_of(arguments, watched=False)
        with ended_by_signals(source.close):
            for item in source.items():
                if isinstance(item, Block):
                    recorder.write(item)
                    heard += len(item.data)
                elif isinstance(item, Event):
                    if item.kind == "settled":
                        recorder.settings(source.line)
                    if item.kind != "settings":
                        tell(item.text)
                        recorder.note(Note(item.t_ns, item.kind, item.text))
                recorder.tick()
                if shown:
                    paused = "  PAUSED" if recorder.paused else ""
                    sys.stderr.write(f"\r\x1b[K{heard:,} bytes heard, {recorder.bytes:,} on the disk{paused}")
                    sys.stderr.flush()
                if arguments.duration and time.monotonic() - begun >= arguments.duration:
                    source.close()
    finally:
        if shown:
            sys.stderr.write("\r\x1b[K")
        recorder.close()
    tell(f"recorded {recorder.bytes:,} bytes of the line" + (f", lost {recorder.lost:,}" if recorder.lost else ""))
    return DONE
