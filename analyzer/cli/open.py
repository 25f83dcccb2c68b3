"""`rtuscope open`: a capture in the terminal interface; without one, a prompt to paste bytes at. `--web`: in a browser.

Whoever reaches the page reads the screen and types on it, so it is for whoever was given its address alone: every path
begins with a random token, the Host must be one that this server goes by (no name that a stranger made point here), and
a request that a browser makes for another page (Origin) is refused. What is in a page of ours loads nothing from
elsewhere. The interface itself, knowing that it runs in a browser, writes no file.

textual-serve brings the terminal for the browser and the process behind each tab; routes are made here, so that none of
its own, unguarded ones is there by accident.
"""

from __future__ import annotations

import argparse
import logging
import os
import secrets
import shlex
import socket
import subprocess
import sys
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from datetime import UTC
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from ..extras import needs
from ..webguard import is_any, is_loopback, refusal
from .commands import DONE, UsageError
from .inputs import (
    CAPTURE_HELP,
    add_functions_argument,
    add_limit_arguments,
    add_map_argument,
    add_reading_arguments,
    capture_as_asked,
    chosen_charts,
    chosen_limits,
    given_limits,
    given_reading,
    load_functions,
    open_capture,
)
from .keyboard import keys_from_terminal
from .terminal import full_screen, tell_user

if TYPE_CHECKING:
    from aiohttp import web

    from captures import Capture
    from dissectors.maps.files import UnitMaps

    from ..options import Options

_TITLE: Final = "rtuscope"
_ENDING_S: Final = 2  # that tabs have to end, when the server does
_HEADERS: Final = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self' 'unsafe-inline'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data:; font-src 'self'; connect-src 'self' {socket}; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


def serve(command: Sequence[str], host: str, port: int) -> None:
    """Show what `command` shows, one process a tab, until Ctrl-C. UsageError where that cannot be."""
    try:
        from aiohttp.web import run_app
        from textual_serve.server import Server
    except ImportError as error:
        raise UsageError(needs("--web", "textual-serve", "web")) from error
    logging.basicConfig(level=logging.WARNING, handlers=[_TellingHandler()])
    logging.getLogger("asyncio").setLevel(logging.ERROR)  # that a tab's process ends after its loop is no trouble
    sockets = _listening(host, port)
    port = sockets[0].getsockname()[1]
    token = secrets.token_urlsafe(24)
    if not is_loopback(host):
        tell_user(
            f"anyone who can reach {host}:{port} and knows the address below can see this capture; nothing is encrypted"
        )
    shown = socket.gethostname() if is_any(host) else host
    server = Server(shell_command(command), host=host, port=port, title=_TITLE)
    app = guarded(server, host, token)
    with suppress(KeyboardInterrupt):  # pressed before the loop runs, or on Windows
        print(f"http://{f'[{shown}]' if ':' in shown else shown}:{port}/{token}/", flush=True)
        tell_user("open this address in a browser; press Ctrl-C to stop")
        run_app(app, sock=sockets, print=None, access_log=None, shutdown_timeout=_ENDING_S)


def shell_command(arguments: Sequence[str], *, windows: bool = os.name == "nt") -> str:
    """A command line that the system's shell takes apart into these arguments, whatever they hold."""
    if not windows:
        return shlex.join(arguments)
    return " ".join(_for_cmd(argument) for argument in arguments)


def _for_cmd(argument: str) -> str:
    """An argument between quotes, in which cmd.exe leaves all but % alone; those stand outside, behind a caret."""
    # A space makes list2cmdline quote, and double backslashes before a quote: the space is taken away again.
    parts = (subprocess.list2cmdline([f" {part}"]).replace(" ", "", 1) for part in argument.split("%"))
    return "^%".join(parts)


def guarded(server: Any, host: str, token: str) -> web.Application:
    """The web application: `server` (of textual-serve) behind token, Host and Origin."""
    from aiohttp import web

    from ..languages import in_use
    from .webpage import page

    @web.middleware
    async def guard(
        request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        why = refusal(request.headers.get("Host", ""), request.headers.getall("Origin", []), host)
        if why:
            raise web.HTTPForbidden(text=why)
        if not request.path.startswith((f"/{token}/", "/download/")):  # a download's own key is its token
            raise web.HTTPForbidden(text="this address lacks its token: use the one that rtuscope printed")
        return await handler(request)

    async def index(request: web.Request) -> web.Response:
        address = f"{request.host}/{token}"
        text = page(_TITLE, f"ws://{address}/ws", f"/{token}/static/", in_use())
        return web.Response(text=text, content_type="text/html", headers={"Cache-Control": "no-store"})

    async def headers(request: web.Request, response: web.StreamResponse) -> None:
        for name, value in _HEADERS.items():
            response.headers.setdefault(name, value.format(socket=f"ws://{request.host}"))

    app = web.Application(middlewares=[guard])
    app.add_routes(
        [
            web.get(f"/{token}/", index),
            web.get(f"/{token}/ws", server.handle_websocket),
            web.get("/download/{key}", server.handle_download),  # where its script looks for it
            web.static(f"/{token}/static", server.statics_path),
        ]
    )
    app.on_response_prepare.append(headers)
    return app


def _listening(host: str, port: int) -> list[socket.socket]:
    """Sockets that listen there, on all addresses of the name."""
    sockets: list[socket.socket] = []
    trouble = ""
    try:
        for family, *_, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE):
            try:
                sockets.append(socket.create_server(address[:2], family=family))
            except OSError as error:
                trouble = (error.strerror or str(error)).partition(" (")[0].lower()
            if not port:
                break
    except (OSError, OverflowError, UnicodeError) as error:  # no such name, no such port
        trouble = str(error)
    if not sockets:
        raise UsageError(f"cannot listen on {host}:{port}: {trouble}: try another --port or --host")
    return sockets


class _TellingHandler(logging.Handler):
    """What goes wrong in the server, in one line."""

    def emit(self, record: logging.LogRecord) -> None:
        tell_user(record.getMessage())


EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope open bus.jsonl
rtuscope open"""
_PORT = 8000
_MOST_PORT = 65535


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "capture",
        nargs="?",
        metavar="CAPTURE",
        help=f"{CAPTURE_HELP}; none: paste bytes",
    )
    parser.add_argument("--light", action="store_true", help="light theme (D toggles)")
    parser.add_argument("--plain", action="store_true", help="print plain lines for a screen reader")
    parser.add_argument("-Y", "--filter", metavar="FILTER", default="", help="with --plain: only matching rows")
    parser.add_argument("--against", metavar="CAPTURE", help="with --plain: show what differs from this capture")
    parser.add_argument("--web", action="store_true", help="serve it to a browser on this machine instead")
    parser.add_argument("--host", default="127.0.0.1", help="with --web: address to listen at (127.0.0.1)")
    parser.add_argument("--port", type=port, default=_PORT, help=f"with --web: port to listen at ({_PORT})")
    add_reading_arguments(parser)
    add_functions_argument(parser)
    add_map_argument(parser)
    add_limit_arguments(parser)


def port(text: str) -> int:
    """A TCP port; 0 is any that is free; for argparse."""
    if not text.isdecimal() or int(text) > _MOST_PORT:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port (0 to {_MOST_PORT})")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Show it."""
    load_functions(arguments)
    limits = chosen_limits(arguments)
    charts = chosen_charts(arguments)
    capture = None if arguments.capture is None else open_capture(arguments)
    if arguments.web:
        serve(in_a_browser(arguments), arguments.host, arguments.port)
        return DONE
    if arguments.plain:
        return read_out(arguments, capture, limits, charts)
    if arguments.capture == "-":
        keys_from_terminal()
    needs_a_terminal("open")
    from captures.io import time_zone

    from ..model.source import CaptureSource, Nothing
    from ..tui import run as show

    if capture is None:
        show(Nothing(), view="paste", light=arguments.light)
    else:
        name = capture.path.name if capture.path else "capture"
        shown_in = UTC if arguments.tz is None else time_zone(arguments.tz)

        def again(path: Path) -> CaptureSource:
            return CaptureSource(capture_as_asked(str(path), arguments), path.name, limits)

        source = CaptureSource(capture, name, limits)
        show(source, light=arguments.light, zone=shown_in, charts=charts.of, reader=again)
    return DONE


def read_out(arguments: argparse.Namespace, capture: Capture | None, limits: Options, charts: UnitMaps) -> int:
    """The capture in plain lines."""
    if capture is None:
        raise UsageError("--plain needs a capture: name a FILE")
    from captures.io import time_zone

    from ..filters import FilterError
    from ..model.source import CaptureSource
    from ..model.spoken import spoken

    name = capture.path.name if capture.path else "capture"
    try:
        zone = UTC if arguments.tz is None else time_zone(arguments.tz)
        then = None
        if arguments.against is not None:
            earlier = capture_as_asked(arguments.against, arguments)
            then = CaptureSource(earlier, earlier.path.name if earlier.path else "capture", limits)
        source = CaptureSource(capture, name, limits)
        for line in spoken(source, arguments.filter, zone, charts=charts, then=then):
            print(line)
    except FilterError as error:
        raise UsageError(f"--filter: {error}") from error
    return DONE


def needs_a_terminal(command: str, instead: str = "use rtuscope report, export or parse") -> None:
    """UsageError where there is none; a browser will do."""
    if "TEXTUAL_DRIVER" not in os.environ and not full_screen():
        raise UsageError(f"{command} needs a terminal; in a pipe or with TERM=dumb, {instead}")


def in_a_browser(arguments: argparse.Namespace) -> list[str]:
    """The command that shows the same to a browser: no module of the folder that it is started in gets into it (-P)."""
    command = [sys.executable, "-P", "-m", "analyzer.cli", "open"]
    command += ["--light"] if arguments.light else []
    command += [f"--lang={arguments.lang}"] if arguments.lang else []
    command += [f"--functions={path}" for path in arguments.functions]
    command += [f"--map={name}" for name in arguments.map]
    command += given_reading(arguments)
    command += given_limits(arguments)
    command += ["--", str(arguments.capture)] if arguments.capture is not None else []
    return command
