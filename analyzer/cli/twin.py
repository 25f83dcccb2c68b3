"""`rtuscope twin`: recorded units that answer as they did."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING, Final

from ..languages import retold
from .commands import DONE, FAILED, UsageError
from .inputs import (
    add_capture_arguments,
    add_limit_arguments,
    chosen_limits,
    load_functions,
    open_capture,
    tell_damage,
    unit_number,
)
from .outlets import address, shown_host
from .terminal import put, tell_user
from .watching import ended_from_outside

if TYPE_CHECKING:
    from collections.abc import Callable

    from captures import Capture
    from captures.live.settings import PortSettings

    from ..twin.faults import Fault
    from ..twin.memory import TwinUnit
    from ..twin.serving import TwinsOnALine

EXAMPLE = """\
rtuscope twin bus.jsonl --unit 17
rtuscope twin bus.jsonl --unit 17 --unit 18 /dev/ttyUSB0
rtuscope twin bus.jsonl --listen 5020
rtuscope twin bus.jsonl --unit 17 --fault silence@5%
rtuscope twin bus.jsonl --unit 17 /dev/ttyUSB0 --client --transmit"""

_HIGHEST: Final = 0xFFFF


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser)
    parser.add_argument(
        "port",
        metavar="PORT",
        nargs="?",
        help="answer on this serial port; without it, on a pseudo-terminal named in the first line printed",
    )
    twin = parser.add_argument_group("the twin: a server on a port of its own, with the capture's line settings")
    twin.add_argument(
        "--unit",
        type=unit_number,
        action="append",
        default=[],
        metavar="N",
        help="answer as this unit (default: all units)",
    )
    twin.add_argument(
        "--listen", type=address, metavar="[HOST:]PORT", help="answer over Modbus TCP on this port; 0: any free port"
    )
    twin.add_argument(
        "--unknown",
        type=_unknown,
        default="exception",
        metavar="VALUE",
        help="value of registers that the capture does not show: a number, or exception for code 02 (exception)",
    )
    twin.add_argument(
        "--fault",
        type=_fault,
        action="append",
        default=[],
        metavar="FAULT",
        help="inject a fault, [UNIT:]NAME[=VALUE][@SHARE]: silence, delay=250@10%%, 17:exception=6@1/5, "
        "wrong-unit, duplicate, corruption, truncation, stray; repeatable (rtuscope help twin)",
    )
    client = parser.add_argument_group("the other side")
    client.add_argument(
        "--client", action="store_true", help="ask a real unit at PORT what the recorded client asked, and compare"
    )
    client.add_argument(
        "--transmit",
        action="store_true",
        help="with --client: confirm that the recorded requests, including writes, are sent",
    )
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Answer, or ask."""
    _check(arguments)
    load_functions(arguments)
    capture = open_capture(arguments)
    if arguments.client:
        return _ask(arguments, capture)
    from ..twin.faults import FaultyAnswers
    from ..twin.record import twins
    from ..twin.serving import TwinsOnALine

    unknown = None if arguments.unknown == "exception" else int(arguments.unknown)
    units = twins(capture, arguments.unit, unknown=unknown, options=chosen_limits(arguments))
    tell_damage(arguments.capture, capture)
    if missing := sorted(set(arguments.unit) - units.keys()):
        raise UsageError(f"unit {missing[0]} answers no request in {arguments.capture}")
    if not units:
        raise UsageError(f"no unit responds in {arguments.capture}")
    answering = TwinsOnALine(units, FaultyAnswers(arguments.fault))
    ended: list[bool] = []
    with ended_from_outside(lambda: ended.append(True)):
        if arguments.listen is not None:
            _on_network(arguments, answering, units, lambda: bool(ended))
        else:
            _on_line(arguments, answering, units, _settings(arguments, capture), lambda: bool(ended))
    tell_user(f"{answering.asked:,} requests, {answering.answered:,} answered")
    if shown := answering.faults.shown:
        tell_user(f"faults on purpose: {', '.join(f'{name} {count:,}' for name, count in sorted(shown.items()))}")
    return DONE


def _check(arguments: argparse.Namespace) -> None:
    """UsageError where what is asked for contradicts itself."""
    if arguments.port is not None and arguments.listen is not None:
        raise UsageError("give PORT or --listen, not both")
    if arguments.fault and arguments.client:
        raise UsageError("--fault goes with a twin, not with --client")
    on_lines = [fault.name for fault in arguments.fault if fault.kind.of_a_line]
    if arguments.listen is not None and on_lines:
        raise UsageError(f"--fault {on_lines[0]} needs a serial line: Modbus TCP frames arrive whole")
    if arguments.transmit and not arguments.client:
        raise UsageError("--transmit needs --client")
    if arguments.client and not arguments.transmit:
        raise UsageError("--client sends the recorded requests, including writes: confirm with --transmit")
    if arguments.client and (arguments.port is None or not arguments.unit):
        raise UsageError("--client needs a PORT to send to, and the --unit to ask")
    if arguments.port is None and arguments.listen is None and os.name != "posix":
        raise UsageError("no port given: PORT is a serial port; over a network, use --listen PORT")


def _settings(arguments: argparse.Namespace, capture: Capture) -> PortSettings:
    from captures.live.settings import PortSettings

    line = capture.line
    if (line.parity or "N") not in ("N", "E", "O"):
        raise UsageError(f"a port cannot be set to parity {line.parity}: use --parity N, E or O")
    return PortSettings(arguments.port or "", line.baud, line.parity or "N", line.stop_bits or 1, arguments.bits or 8)


def _on_line(
    arguments: argparse.Namespace,
    answering: TwinsOnALine,
    units: dict[int, TwinUnit],
    settings: PortSettings,
    stop: Callable[[], bool],
) -> None:
    from ..twin.serving import SerialLine, TerminalLine, serve_line

    if arguments.port is None:
        terminal = TerminalLine()
        put(f"{terminal.name}\n")
        line: SerialLine | TerminalLine = terminal
    else:
        line = SerialLine(settings)
        put(f"{settings.url}\n")
    _tell_units(units)
    try:
        serve_line(answering, line, stop)
    finally:
        line.close()


def _on_network(
    arguments: argparse.Namespace, answering: TwinsOnALine, units: dict[int, TwinUnit], stop: Callable[[], bool]
) -> None:
    from ..twin.serving import TwinServer

    host, port = arguments.listen
    server = TwinServer(answering, host, port)
    put(f"{shown_host(host)}:{server.port}\n")
    _tell_units(units)
    try:
        server.serve(stop)
    finally:
        server.close()


def _ask(arguments: argparse.Namespace, capture: Capture) -> int:
    from ..twin.client import play_client, script_of
    from ..twin.serving import SerialLine

    settings = _settings(arguments, capture)
    script = script_of(capture, arguments.unit, chosen_limits(arguments))
    tell_damage(arguments.capture, capture)
    if not script.requests:
        raise UsageError(f"{arguments.capture} has no requests to these units")
    line = SerialLine(settings)
    tell_user(
        f"transmitting on {settings.url}, {settings}: {len(script.requests):,} requests, {script.writes:,} of them "
        "not reads"
    )
    ended: list[bool] = []
    try:
        with ended_from_outside(lambda: ended.append(True)):
            played = play_client(script, line, lambda: bool(ended))
    finally:
        line.close()
    words = f"{played.sent:,} requests: {played.same:,} answered as recorded, {played.other:,} otherwise"
    put(f"{retold(f'{words}, {played.silent:,} not answered')}\n")
    return FAILED if played.other or played.silent else DONE


def _tell_units(units: dict[int, TwinUnit]) -> None:
    for number, unit in units.items():
        tell_user(f"unit {number}: different requests {unit.requests:,}, registers and coils {unit.registers:,}")


def _fault(text: str) -> Fault:
    from ..twin.faults import FaultError, fault_of

    try:
        return fault_of(text)
    except FaultError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _unknown(text: str) -> str:
    if text != "exception" and not (text.isdecimal() and int(text) <= _HIGHEST):
        raise argparse.ArgumentTypeError(f"{text!r} is neither exception nor a number up to {_HIGHEST}")
    return text
