"""`rtuscope sniff`: a bus, as it happens."""

from __future__ import annotations

import argparse

from .inputs import add_functions_argument, add_limit_arguments, chosen_limits, load_functions
from .taps import add_recording_arguments, add_tap_arguments, recorder_of, tap_of
from .watching import Watch, add_view_arguments, ended_by_signals

EXAMPLE = """\
rtuscope sniff /dev/ttyUSB0
rtuscope sniff /dev/ttyUSB0 --baud 19200 --parity E -o bus.mcap
rtuscope sniff COM3 --json --filter 'exception' --duration 1h"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_tap_arguments(parser)
    parser.add_argument(
        "--protocol", choices=("auto", "rtu", "ascii"), default="auto", help="what the line speaks (auto)"
    )
    add_view_arguments(parser)
    add_recording_arguments(parser, needed=False)
    add_limit_arguments(parser)
    add_functions_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Listen and show."""
    from dataclasses import replace

    from analyzer.live.session import Session, Sink
    from analyzer.live.window import TriggeredSink

    load_functions(arguments)
    recorder = recorder_of(arguments)
    sink: Sink | None = recorder
    fire = None
    if recorder is not None and arguments.trigger is not None:
        sink = triggered = TriggeredSink(recorder, int(arguments.before * 1e9), int(arguments.after * 1e9))
        fire = triggered.fire
    session = Session(
        tap_of(arguments),
        recorder=sink,
        options=replace(chosen_limits(arguments), protocol=arguments.protocol),
    )

    def recorded() -> str:
        if recorder is None:
            return ""
        paused = "  RECORDING PAUSED" if recorder.paused else ""
        return f"  recorded {recorder.bytes / 1e6:,.1f} MB of the line{paused}"

    if arguments.tui:
        from analyzer.live.view import show

        return show(session, arguments.port)
    watch = Watch(arguments, session, extra=recorded, fire=fire)
    with session, ended_by_signals(session.stop):
        return watch.run()
