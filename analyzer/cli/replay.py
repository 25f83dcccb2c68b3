"""`rtuscope replay`: a capture again, in its own time: into the view of `sniff`, or onto a port."""

from __future__ import annotations

import argparse
from argparse import ArgumentTypeError
from typing import TYPE_CHECKING

from ..languages import tr
from .commands import DONE, NO_FRAME, UsageError
from .inputs import (
    add_capture_arguments,
    add_limit_arguments,
    chosen_limits,
    load_functions,
    open_capture,
    tell_damage,
)
from .keyboard import keys
from .livetui import check_interface, show_interface
from .outlets import add_outlet_arguments, outlets_of
from .terminal import tell_user
from .watching import Watch, add_view_arguments, ended_from_outside

if TYPE_CHECKING:
    from captures import Capture

    from ..live.replaying import Replay

EXAMPLE = """\
rtuscope simulate bus.jsonl --transactions 20
rtuscope replay bus.jsonl --speed 10
rtuscope replay bus.jsonl --speed max --filter 'exception'"""

_KEYS = "keys: space pauses, . steps, + and - change the speed, q quits"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument(
        "--speed",
        type=_speed,
        default=1.0,
        metavar="X",
        help="speed factor, or max (1); on a terminal, " + _KEYS.partition(": ")[2],
    )
    port = parser.add_argument_group("to a port (this transmits), with the capture's line settings or those given")
    port.add_argument("--to", metavar="PORT", help="send the bytes to this port instead of showing them")
    port.add_argument("--only", choices=("requests", "responses"), help="only frames of this direction")
    add_view_arguments(parser)
    add_outlet_arguments(parser)
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Play it."""
    load_functions(arguments)
    capture = open_capture(arguments)
    if arguments.to is not None:
        return _onto_port(arguments, capture)
    if arguments.only is not None:
        raise UsageError("--only works with --to PORT; to show one direction, use --filter request")
    check_interface(arguments)
    from ..live.replaying import Replay
    from ..live.session import Session

    replay = Replay(capture, arguments.speed)
    session = Session(replay, options=chosen_limits(arguments), outlets=outlets_of(arguments, tell_user))
    if arguments.tui:
        return show_interface(arguments, session, arguments.capture)
    watch = Watch(arguments, session, extra=lambda: _how(replay))
    with keys(lambda key: _press(replay, key)) as keyboard:
        if keyboard:
            tell_user(_KEYS)
        with session, ended_from_outside(session.stop, arguments.duration) as begun:
            status = watch.run(begun)
    tell_damage(arguments.capture, capture)
    return status


def _onto_port(arguments: argparse.Namespace, capture: Capture) -> int:
    from captures.live.settings import PortSettings

    from ..live.replaying import play

    line = capture.line
    if (line.parity or "N") not in ("N", "E", "O"):
        raise UsageError(f"--to cannot send parity {line.parity}: use --parity N, E or O")
    port = PortSettings(arguments.to, line.baud, line.parity or "N", line.stop_bits or 1, arguments.bits or 8)
    ended: list[bool] = []

    def opened() -> None:
        tell_user(f"transmitting on {port.url}, {port}")

    with ended_from_outside(lambda: ended.append(True), arguments.duration):
        sent = play(capture, port, speed=arguments.speed, only=arguments.only, stop=lambda: bool(ended), opened=opened)
    tell_user(f"{sent:,} bytes sent")
    return DONE if sent else NO_FRAME


def _press(replay: Replay, key: str) -> None:
    if key == " ":
        replay.pause()
    elif key in (".", "s", "\r", "\n"):
        replay.step()
    elif key == "q":
        replay.close()
    elif key in ("+", "-", "=") and replay.speed is not None:
        replay.set_speed(replay.speed * (0.5 if key == "-" else 2.0))


def _how(replay: Replay) -> str:
    speed = "max" if replay.speed is None else f"x{replay.speed:g}"
    return f"{speed}  {tr('PAUSED')}" if replay.paused else speed


def _speed(text: str) -> float | None:
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0.001 <= speed <= 1e6:
        raise ArgumentTypeError(f"{text!r} is neither max nor a number from 0.001 to 1000000")
    return speed
