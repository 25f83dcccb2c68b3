"""What the commands that listen to taps have in common: `sniff`, `record`, `tap`.

What they take: ports, line settings, and the recording. What they tell on standard error: a terminal that is held
(Ctrl-S, a selection in the Windows console) or a pipe that nobody reads blocks whoever writes to it. That must never be
the thread that records, so a `Teller` writes by a thread of its own.
"""

from __future__ import annotations

import argparse
import os
import queue
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from contextvars import copy_context
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from dissectors.values import harmless

from ..terminal_text import ERASE_LINE, terminal_text
from ..version import __version__
from .amounts import seconds, size_in_bytes, time_or_size
from .commands import UsageError
from .lineoptions import LineWords, add_line_arguments
from .terminal import add_overwrite_argument, places, to_be_overwritten
from .twins import TWINS

if TYPE_CHECKING:
    from captures.live.tapviewer import TapViewer
    from captures.recording.recorder import Recorder

    from ..live.tapsource import TapSource

_TOKEN_VARIABLE: Final = "RTUSCOPE_TAP_TOKEN"
_TAP_WORDS: Final = LineWords(
    baud="bit/s, or with its format: 19200-8N1; auto detects it (default)",
    parity="auto detects it with --baud auto, else N",
    bits="7 on some lines in ASCII mode (8)",
    stop="stop bits per character (1)",
    parities=("N", "E", "O"),
    auto=True,
)


def add_tap_arguments(parser: argparse.ArgumentParser) -> None:
    """PORT and how to listen to it."""
    parser.add_argument(
        "port",
        metavar="PORT",
        help="a serial port, socket://HOST:PORT, rfc2217://HOST:PORT, or tap://HOST of `rtuscope tap`; nothing is sent "
        "to it",
    )
    taps = parser.add_argument_group("the tap")
    add_line_arguments(taps, _TAP_WORDS)
    taps.add_argument("--port2", metavar="PORT", help="a second port: PORT hears the client, this one the servers")
    taps.add_argument(
        "--seek-remote",
        action="store_true",
        help="detect the settings of an rfc2217:// port by CHANGING them there; without it, the port keeps its "
        "settings",
    )
    taps.add_argument("--wait", action="store_true", help="wait for a port that does not exist yet")
    taps.add_argument("--blocking-read", action="store_true", help=argparse.SUPPRESS)


def add_token_argument(parser: argparse._ArgumentGroup) -> None:
    """The secret of a tap and its viewers."""
    parser.add_argument(
        "--token-file",
        metavar="FILE",
        help=f"a file with the secret shared by a tap and its viewers (default: {_TOKEN_VARIABLE} from the "
        "environment)",
    )


def add_viewer_arguments(parser: argparse.ArgumentParser) -> None:
    """How to get at a tap elsewhere."""
    group = parser.add_argument_group(
        "a remote tap (tap://HOST[:PORT], taps:// with TLS); it has its own line settings"
    )
    add_token_argument(group)
    group.add_argument("--tls-ca", metavar="FILE", help="trust this certificate (PEM) instead of the system's")


def add_recording_arguments(parser: argparse.ArgumentParser, *, needed: bool) -> None:
    """Where the recording goes, and how much of it is kept."""
    recording = parser.add_argument_group("the recording")
    recording.add_argument(
        "-o",
        "-w",
        "--output",
        metavar="FILE",
        required=needed,
        help=f"record to this .mcap file{'' if needed else '; - needs --format'}",
    )
    add_overwrite_argument(recording, "FILE")
    recording.add_argument("--rotate-every", type=seconds, metavar="TIME", help="start a new file every TIME: 1h, 1d")
    recording.add_argument(
        "--rotate-size", type=size_in_bytes, metavar="SIZE", help="start a new file at this size: 64MB"
    )
    recording.add_argument(
        "--keep",
        type=time_or_size,
        action="append",
        default=[],
        metavar="TIME|SIZE",
        help="keep only files newer than this (7d), or this much in total (2GB); delete older ones",
    )


def token_of(arguments: argparse.Namespace) -> str | None:
    """The secret that was given; None where there is none."""
    from captures.live.tapstream import checked_token, read_token

    if arguments.token_file:
        return read_token(arguments.token_file)
    token = os.environ.get(_TOKEN_VARIABLE)
    return checked_token(token, _TOKEN_VARIABLE) if token else None


def _viewer_of(arguments: argparse.Namespace) -> TapViewer:
    from captures.live.tapviewer import TapViewer

    if arguments.port2 or arguments.seek_remote:
        raise UsageError("a remote tap has its own ports and settings: set --port2 and --seek-remote there")
    return TapViewer(arguments.port, token=token_of(arguments), authority=arguments.tls_ca, wait=arguments.wait)


def tap_of(arguments: argparse.Namespace, *, watched: bool = True) -> TapSource | TapViewer:
    """The tap that was asked for, listening. `watched`: somebody looks, who should not wait."""
    from captures.live.tapstream import is_tap_url

    if is_tap_url(arguments.port):
        return _viewer_of(arguments)
    from captures.live.listening import HOLD_NS, IDLE_NS, RECORD_HOLD_NS
    from captures.live.settings import PortSettings

    from ..live.tapsource import TapSource

    settings = {
        "baud": None if arguments.baud == "auto" else int(arguments.baud),
        "parity": None if arguments.parity == "auto" else arguments.parity,
        "stop_bits": arguments.stop,
        "data_bits": arguments.bits,
    }
    settings = {name: value for name, value in settings.items() if value is not None}
    urls = [arguments.port, *([arguments.port2] if arguments.port2 else [])]
    if any(map(is_tap_url, urls)):
        raise UsageError("a remote tap cannot be combined with another port: set --port2 there")
    if len(set(urls)) < len(urls):
        raise UsageError("--port2 is the same port as PORT")
    ports = [PortSettings(url, **settings, remote_changes=tuple(settings)) for url in urls]
    if arguments.seek_remote and not ports[0].is_port_server:
        raise UsageError("--seek-remote is for rfc2217://HOST:PORT; settings of local ports are detected anyway")
    return TapSource(
        ports,
        hold_ns=HOLD_NS if watched else RECORD_HOLD_NS,
        idle_ns=arguments.idle_ms or IDLE_NS,
        wait=arguments.wait,
        free_parity=arguments.parity == "auto",
        blocking=arguments.blocking_read,
        seek_remote=arguments.seek_remote,
    )


def lost_words(octets: int) -> str:
    """What is said at the end of bytes that were lost between a tap elsewhere and here."""
    return f"LOST on the way: {octets:,} bytes of the line that the tap no longer had"


def recorder_of(arguments: argparse.Namespace, tell: Callable[[str], None]) -> Recorder | None:
    """The recorder that was asked for; None where nothing is recorded. `tell` must not wait for anybody."""
    if arguments.output is None:
        for name in ("rotate_every", "rotate_size", "keep"):
            if getattr(arguments, name):
                raise UsageError(f"--{name.replace('_', '-')} needs -o FILE")
        return None
    if arguments.output == "-":
        raise UsageError("a recording is a file; for another program: rtuscope sniff PORT -o - --format pcapng")
    from captures.line import LineSettings
    from captures.recording.recorder import Recorder
    from captures.recording.ring import RingLimits

    times = [time for time, _ in arguments.keep if time is not None]
    sizes = [size for _, size in arguments.keep if size is not None]
    limits = RingLimits(
        every_s=arguments.rotate_every,
        size=arguments.rotate_size,
        keep_s=min(times, default=None),
        keep_bytes=min(sizes, default=None),
    )
    ports = [arguments.port, *([arguments.port2] if arguments.port2 else [])]
    about = {
        "tool": f"rtuscope {__version__}",
        "ports": ", ".join(ports),
        "time_base": "ns since 1970 by the monotonic clock, set by the wall clock when listening began; "
        "a read's time is when it returned, at or after its last stop bit",
    }
    path = Path(arguments.output)
    overwrite = arguments.overwrite or (not limits.rotates and to_be_overwritten(path, overwrite=False))
    return Recorder(path, LineSettings(), limits=limits, about=about, overwrite=overwrite, tell=tell)


_WAITING: Final = 1000  # lines at most
_PATIENCE_S: Final = 0.3


class Teller:
    """Tells lines, and on a terminal a status line below them, without waiting for anybody. A context manager."""

    def __init__(self) -> None:
        self._shows = places(sys.stderr)
        self._texts: queue.SimpleQueue[Callable[[], str] | None] = queue.SimpleQueue()
        self._left_out = 0
        self._thread = threading.Thread(target=copy_context().run, args=(self._write,), daemon=True)
        self._thread.start()

    def __call__(self, text: str) -> None:
        """A line; left out, and counted, where a thousand wait already."""
        if self._texts.qsize() >= _WAITING:
            self._left_out += 1
            return
        if self._left_out:
            self._texts.put(partial(_line_in_language, f"{self._left_out} lines could not be shown"))
            self._left_out = 0
        self._texts.put(partial(_line_in_language, text))

    def status(self, text: str) -> None:
        """The status line, unless something waits to be shown."""
        if self._shows and self._texts.empty():
            self._texts.put(partial(terminal_text, ERASE_LINE, harmless(text)))

    def close(self) -> None:
        """Take the status line away, and end when all was shown, or soon."""
        if self._shows:
            self._texts.put(partial(terminal_text, ERASE_LINE))
        self._texts.put(None)
        self._thread.join(_PATIENCE_S)

    def __enter__(self) -> Teller:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(self) -> None:
        while (text := self._texts.get()) is not None:
            with suppress(OSError, ValueError):  # nobody listens any more
                _write_unbuffered(text())


def _write_unbuffered(text: str) -> None:
    """Write it past Python's buffer where that goes, whose lock would keep the process from its end."""
    if os.name != "posix":
        sys.stderr.write(text)
        sys.stderr.flush()
        return
    data = memoryview(text.encode(sys.stderr.encoding, TWINS))
    while data:
        data = data[os.write(sys.stderr.fileno(), data) :]


def _line_in_language(text: str) -> str:
    """A line of the program's, in the language in use: words are looked up by the thread that writes."""
    from ..languages import retold

    erase = ERASE_LINE if places(sys.stderr) else ""
    return terminal_text(erase, f"rtuscope: {harmless(retold(text))}\n")
