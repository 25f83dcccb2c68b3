"""`rtuscope sniff`: a bus, as it happens."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, BinaryIO, Final

from .commands import FAILED, INTERRUPTED, UsageError
from .inputs import add_functions_argument, add_limit_arguments, chosen_limits, load_functions
from .livetui import check_interface, show_interface
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
from .watching import Watch, add_view_arguments, ended_from_outside

if TYPE_CHECKING:
    from captures.live.tapviewer import TapViewer
    from captures.recording.recorder import Recorder

    from ..live.betweensource import BetweenSource
    from ..live.session import Session
    from ..live.tapsource import TapSource

    LiveSource = TapSource | TapViewer | BetweenSource

_GRACE_S: Final = 0.2
_DISK_S: Final = 30.0  # for a recording to be closed

EXAMPLE = """\
rtuscope sniff /dev/ttyUSB0
rtuscope sniff /dev/ttyUSB0 --baud 19200 --parity E -o bus.mcap
rtuscope sniff /dev/ttyUSB0 -o - --format pcapng | wireshark -k -i -
rtuscope sniff COM3 --json --filter 'exception' --duration 1h"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_tap_arguments(parser)
    add_viewer_arguments(parser)
    parser.add_argument(
        "--protocol", choices=("auto", "rtu", "ascii"), default="auto", help="protocol on the line (auto)"
    )
    add_view_arguments(parser, format_flag=True)
    add_recording_arguments(parser, needed=False)
    add_outlet_arguments(parser)
    add_limit_arguments(parser)
    add_functions_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Listen and show."""
    check_interface(arguments)
    if arguments.output == "-":
        if arguments.view_format in (None, "text"):
            raise UsageError("-o - writes frames for another program: choose --format pcapng, jsonl or influx")
        arguments.output = None
    if arguments.view_format == "pcapng" and sys.stdout.isatty():
        raise UsageError("pcapng is binary and cannot be shown on a terminal: pipe it, for example | wireshark -k -i -")
    return listen(arguments)


def listen(
    arguments: argparse.Namespace,
    out: BinaryIO | None = None,
    source_of: Callable[[argparse.Namespace], LiveSource] | None = None,
) -> int:
    """Listen, and show it on standard output, or write it to `out`. `source_of` makes what is listened to."""
    from contextlib import closing
    from dataclasses import replace

    from ..live.conditions import TriggeredSink
    from ..live.session import RecordingSink, Session

    load_functions(arguments)
    with Teller() as tell:
        recorders: list[Recorder] = []
        outlets = outlets_of(arguments, tell, recorders)
        recorder = recorder_of(arguments, tell)
        recorders += [] if recorder is None else [recorder]
        sink: RecordingSink | None = recorder
        fire = None
        if recorder is not None and arguments.trigger is not None:
            sink = triggered = TriggeredSink(recorder, int(arguments.before * 1e9), int(arguments.after * 1e9))
            fire = triggered.fire
        with closing((source_of or tap_of)(arguments)) as source:
            session = Session(
                source,
                recorder=sink,
                options=replace(chosen_limits(arguments), protocol=arguments.protocol),
                outlets=outlets,
            )
            if arguments.tui:
                status = show_interface(arguments, session, arguments.port, recorder, fire)
            else:
                watch = Watch(arguments, session, extra=lambda: _recorded(recorder), fire=fire, out=out)
                abandon = partial(_abandon, session, recorder, tell)
                with session, ended_from_outside(session.stop, arguments.duration, abandon=abandon) as begun:
                    status = watch.run(begun)
        if recorder is not None and recorder.lost:
            tell(recorder.result)
            return FAILED
        if source.lost:
            tell(lost_words(source.lost))
            return FAILED
    return status


def _recorded(recorder: Recorder | None) -> str:
    """Words for the status line."""
    if recorder is None:
        return ""
    from ..live.status import recording_words

    return recording_words(recorder.bytes, paused=recorder.paused)


def _abandon(session: Session, recorder: Recorder | None, tell: Teller) -> None:
    """End the process: what was recorded is closed, what was not shown is told."""
    closed = session.close(_GRACE_S if recorder is None else _DISK_S)
    text = "ended before all was shown"
    if session.waiting:
        text += f", and {session.waiting:,} bytes of the line analysed"
    if recorder is not None:
        state = f"{recorder.bytes:,} bytes are recorded" if closed else "the recording is NOT closed, it opens as it is"
        text += f"; {state}"
    tell(text)
    tell.close()
    os._exit(INTERRUPTED)
