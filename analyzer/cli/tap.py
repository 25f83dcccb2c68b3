"""`rtuscope tap`: a port that others listen to over the network, with the times at which its bytes came."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Final

from .amounts import size_in_bytes
from .commands import DONE, UsageError
from .inputs import add_functions_argument, add_limit_arguments, load_functions
from .outlets import address, shown_host
from .taps import Teller, add_tap_arguments, add_token_argument, tap_of, token_of
from .watching import add_duration_argument, ended_from_outside

if TYPE_CHECKING:
    from captures.live.tapserver import TapServer

EXAMPLE = """\
rtuscope tap /dev/ttyUSB0
rtuscope tap /dev/ttyUSB0 --baud 19200 --parity E --listen 0.0.0.0:9616 --token-file token
rtuscope sniff tap://192.168.1.7 --token-file token"""

_LEAST: Final = 10**6


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_tap_arguments(parser)
    viewers = parser.add_argument_group("the viewers: `rtuscope sniff tap://HOST`, also record")
    viewers.add_argument(
        "--listen", metavar="[HOST:]PORT", type=address, default="9616", help="address to listen on (127.0.0.1:9616)"
    )
    add_token_argument(viewers)
    viewers.add_argument("--tls-cert", metavar="FILE", help="serve taps:// with this certificate (PEM)")
    viewers.add_argument("--tls-key", metavar="FILE", help="its key, if not in the same file")
    viewers.add_argument(
        "--buffer",
        metavar="SIZE",
        type=size_in_bytes,
        default="64MB",
        help="memory kept for viewers that reconnect (64MB: 40 min of a saturated line)",
    )
    add_limit_arguments(parser, only="--idle-ms")
    add_functions_argument(parser)
    add_duration_argument(parser)


def run(arguments: argparse.Namespace) -> int:
    """Listen, and let others have it."""
    from captures.live.tapstream import is_tap_url

    if is_tap_url(arguments.port):
        raise UsageError("this is a tap already: viewers can connect to it directly")
    load_functions(arguments)
    with Teller() as tell:
        server, address = _server(arguments, tell)
        try:
            heard = _serve(arguments, server, address, tell)
        finally:
            server.close()
        tell(f"{heard:,} bytes received")
    return DONE


def _server(arguments: argparse.Namespace, tell: Teller) -> tuple[TapServer, str]:
    """It, and what viewers give as their port."""
    from captures.live.tapserver import TapServer
    from captures.live.tapstream import is_local, serving_context

    host, port = arguments.listen
    token = token_of(arguments)
    if token is None and not is_local(host):
        raise UsageError(
            f"--listen {host} is open to other machines: give --token-file FILE (`(umask 77; openssl rand -hex 16 > "
            "FILE)`), or keep 127.0.0.1 and connect through ssh -L"
        )
    if arguments.tls_key and not arguments.tls_cert:
        raise UsageError("--tls-key needs --tls-cert")
    if arguments.buffer < _LEAST:
        raise UsageError("--buffer must be at least 1MB")
    tls = serving_context(arguments.tls_cert, arguments.tls_key) if arguments.tls_cert else None
    server = TapServer(host, port, tell=tell, token=token, tls=tls, keep_bytes=arguments.buffer)
    scheme = "tap" if tls is None else "taps"
    return server, f"{scheme}://{shown_host(host)}:{server.port}"


def _serve(arguments: argparse.Namespace, server: TapServer, address: str, tell: Teller) -> int:
    """Until the end; the bytes that were heard."""
    from captures.chunks import Block
    from captures.live.wire import PortEvent

    from ..languages import counted, tr

    heard = 0
    source = tap_of(arguments)
    with ended_from_outside(source.close, arguments.duration) as begun:
        for number, item in enumerate(source.items()):
            begun()
            if not number:  # the port is there, or waited for: who comes will hear something
                tell(f"to view: rtuscope sniff {address}")
            server.feed(item, source.line)
            if isinstance(item, Block):
                heard += len(item.data)
            elif isinstance(item, PortEvent) and item.kind != "settings":
                tell(item.text)
            octets = counted(heard, "byte", "bytes")
            tell.status(tr("{bytes} received, viewers: {count}", bytes=octets, count=server.viewers))
    return heard
