"""`rtuscope between`: what a client's own program and its line say to each other, heard between the two."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING, Final

from . import sniff
from .commands import UsageError
from .inputs import add_functions_argument, add_limit_arguments
from .lineoptions import LineWords, add_line_arguments
from .livetui import check_interface
from .outlets import add_outlet_arguments, address, destination, shown_host
from .taps import add_recording_arguments
from .terminal import put
from .watching import add_view_arguments

if TYPE_CHECKING:
    from ..live.betweensource import BetweenSource

EXAMPLE = """\
rtuscope between /dev/ttyUSB0
rtuscope between /dev/ttyUSB0 --baud 19200 --parity E -o bus.mcap
rtuscope between --listen 5020 --to 192.168.1.7:502"""

_BAUD: Final = 9600
_LINE_WORDS: Final = LineWords(
    baud="bit/s, or with its format: 19200-8N1; until your program sets another (9600)",
    parity="parity of the line; for E, set none in your own program (N)",
    bits="7 on some lines in ASCII mode (8)",
    stop="stop bits per character (1)",
    parities=("N", "E", "O"),
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "port",
        metavar="PORT",
        nargs="?",
        help="the line's serial port, or socket://HOST:PORT; the first line printed gives the port for your program",
    )
    line = parser.add_argument_group("the line; rate and stop bits follow what your program sets on its port")
    add_line_arguments(line, _LINE_WORDS)
    line.add_argument("--wait", action="store_true", help="wait for a port that does not exist yet")
    network = parser.add_argument_group("a gateway or server on a network")
    network.add_argument(
        "--listen", type=address, metavar="[HOST:]PORT", help="take your program's connections here; 0: any free port"
    )
    network.add_argument("--to", type=destination, metavar="HOST:PORT", help="pass them on to this gateway")
    parser.add_argument(
        "--protocol", choices=("auto", "rtu", "ascii"), default="auto", help="protocol on the line (auto)"
    )
    add_view_arguments(parser)
    add_recording_arguments(parser, needed=False)
    add_outlet_arguments(parser)
    add_limit_arguments(parser)
    add_functions_argument(parser)
    parser.set_defaults(port2=None)


def run(arguments: argparse.Namespace) -> int:
    """Pass on and show."""
    _check(arguments)
    check_interface(arguments)
    if arguments.to is not None:
        host, port = arguments.to
        arguments.port = f"{shown_host(host)}:{port}"
    return sniff.listen(arguments, source_of=_begun)


def _check(arguments: argparse.Namespace) -> None:
    """UsageError where what is asked for is no relay."""
    if (arguments.listen is None) != (arguments.to is None):
        raise UsageError("use --listen and --to together: where your program connects, and the gateway")
    if (arguments.port is None) == (arguments.to is None):
        raise UsageError("no port given: PORT is a serial port; for a gateway, use --listen PORT --to HOST:PORT")
    if arguments.to is not None and (arguments.baud or arguments.parity or arguments.wait):
        raise UsageError("a gateway has its own line settings: --baud, --parity and --wait go with PORT")
    if os.name != "posix":
        raise UsageError("between needs pseudo-terminals, which this system lacks")


def _begun(arguments: argparse.Namespace) -> BetweenSource:
    """The relay, running; the port for the client's program is told."""
    from captures.live.listening import IDLE_NS
    from captures.live.relaying import Relaying
    from captures.live.settings import PortSettings

    from ..live.betweensource import BetweenSource

    port = None
    if arguments.to is None:
        port = PortSettings(
            arguments.port,
            int(arguments.baud or _BAUD),
            arguments.parity or "N",
            arguments.stop or 1,
            arguments.bits or 8,
        )
    relaying = Relaying(
        port, listen=arguments.listen, to=arguments.to, idle_ns=arguments.idle_ms or IDLE_NS, wait=arguments.wait
    )
    source = BetweenSource(relaying, port)
    put(f"{source.given}\n")
    arguments.port = f"{source.given} - {arguments.port}"
    return source
