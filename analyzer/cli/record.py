"""`rtuscope record`: only records, unattended, for days."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .commands import DONE, FAILED
from .inputs import add_functions_argument, add_limit_arguments, add_map_argument, load_functions
from .outlets import add_outlet_arguments, outlets_of
from .taps import (
    Teller,
    add_recording_arguments,
    add_tap_arguments,
    add_viewer_arguments,
    lost_words,
    recorder_of,
    tap_of,
)
from .watching import add_duration_argument, ended_from_outside

if TYPE_CHECKING:
    from captures.live.tapviewer import TapViewer
    from captures.recording.recorder import Recorder

    from ..live.outlets import Outlet
    from ..live.tapsource import TapSource

EXAMPLE = """\
rtuscope record /dev/ttyUSB0 --baud 19200 --parity E -o bus.mcap
rtuscope record /dev/ttyUSB0 -o /var/lib/rtuscope/bus.mcap --rotate-every 1h --keep 7d --keep 2GB --wait
rtuscope record /dev/ttyUSB0 -o bus.mcap --metrics 9617 --mqtt mqtt://localhost --map meter.csv@17"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_tap_arguments(parser)
    add_viewer_arguments(parser)
    add_recording_arguments(parser, needed=True)
    add_limit_arguments(parser, only="--idle-ms")
    add_outlet_arguments(parser)
    add_map_argument(parser)
    add_functions_argument(parser)
    add_duration_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Listen and record: no analysis but what finding the line's settings takes, unless something is to leave."""
    recorders: list[Recorder] = []
    with Teller() as tell:
        load_functions(arguments)
        outlets = outlets_of(arguments, tell, recorders)
        recorder = recorder_of(arguments, tell)
        assert recorder is not None  # -o is needed
        recorders.append(recorder)
        source = tap_of(arguments, watched=False)
        if outlets:
            _analysed(arguments, source, recorder, outlets, tell)
        else:
            _plain(arguments, source, recorder, tell)
        tell(recorder.result)
        if source.lost:
            tell(lost_words(source.lost))
    return FAILED if recorder.lost or source.lost else DONE


def _plain(arguments: argparse.Namespace, source: TapSource | TapViewer, recorder: Recorder, tell: Teller) -> None:
    from captures.chunks import Block
    from captures.live.wire import PortEvent, heard_until
    from captures.recording.notes import Note

    heard, heard_ns = 0, None
    try:
        with ended_from_outside(source.close, arguments.duration) as begun:
            for item in source.items():
                begun()
                heard_ns = heard_until(item)
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
                tell.status(_status(heard, recorder))
    finally:
        recorder.close(heard_ns)


def _analysed(
    arguments: argparse.Namespace,
    source: TapSource | TapViewer,
    recorder: Recorder,
    outlets: Sequence[Outlet],
    tell: Teller,
) -> None:
    """The same through a session, whose other thread records whatever the analysis does."""
    from ..live.session import Session
    from ..live.status import not_analysed

    session = Session(source, recorder=recorder, outlets=outlets)
    heard = missed = 0
    with session, ended_from_outside(session.stop, arguments.duration) as begun:
        for step in session.steps():
            begun()
            heard += step.heard
            missed += step.missed
            for event in step.events:
                if event.kind != "settings":
                    tell(event.text)
            tell.status("  ".join(filter(None, (_status(heard, recorder), not_analysed(missed)))))


def _status(heard: int, recorder: Recorder) -> str:
    from ..languages import counted, grouped, tr

    octets = counted(heard, "byte", "bytes")
    words = tr("{bytes} received, {kept} on disk", bytes=octets, kept=grouped(recorder.bytes))
    return f"{words}  {tr('RECORDING PAUSED')}" if recorder.paused else words
