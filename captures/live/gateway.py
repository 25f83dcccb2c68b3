"""Ports behind a network: a gateway's socket, the bytes of a line in raw TCP; and a serial port behind a port server.

Nothing is sent on a gateway's socket. The connection is watched by TCP's own keep-alive, since a gateway that lost its
power says nothing: without it a recorder would wait for ever, and call it a quiet line.

RFC 2217 lets a client set a port server's port: rate, parity, flow control, RTS and DTR, and purge its buffers. A tap
does none of that unasked. It asks what the settings are, and says if RTS or DTR are high there; it sets what its user
gave, or what a search for settings tries that its user allowed. Nothing else leaves for the server but telnet's own
answers.
"""

from __future__ import annotations

import select
import socket
import struct
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final
from urllib.parse import urlsplit

from ..errors import os_reason
from .settings import PortSettings
from .tap import READ_BYTES, WAIT_S, PortError, PortGoneError, Tap, high_line_words

CONNECT_S: Final = 5.0
_ALIVE: Final = {"TCP_KEEPIDLE": 10, "TCP_KEEPALIVE": 10, "TCP_KEEPINTVL": 5, "TCP_KEEPCNT": 3}  # s, s, s, times


class SocketTap(Tap):
    """A connection to `SCHEME://HOST:PORT`, whose bytes are those of the line."""

    def __init__(self, settings: PortSettings, *, blocking: bool = False) -> None:
        """Connect; PortError says in one line why it can't be done. `blocking`: `read` waits."""
        super().__init__(settings, settings.url.partition("://")[0])
        self._socket = connected(settings.url)
        self._socket.setblocking(False)
        self.descriptor = None if blocking else self._socket.fileno()

    def read(self) -> tuple[bytes, list[int]]:
        """See `Tap`."""
        try:
            if self.descriptor is None and not select.select([self._socket], [], [], WAIT_S)[0]:
                return b"", []
            data = self._socket.recv(READ_BYTES)
        except BlockingIOError:
            return b"", []
        except (OSError, ValueError) as error:  # ValueError: closed by another thread
            raise PortGoneError(os_reason(error) if isinstance(error, OSError) else "closed") from error
        if not data:
            raise PortGoneError("closed by the other end")
        return data, []

    def close(self) -> None:
        """See `Tap`."""
        self.descriptor = None
        self._socket.close()


def connected(url: str) -> socket.socket:
    """A connection that notices when its other end is gone. PortError where there is none within 5 s."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise PortError(f"{url}: not an address: expected {url.partition('://')[0]}://HOST:PORT")
    try:
        connection = socket.create_connection((host, port), timeout=CONNECT_S)
    except (OSError, UnicodeError) as error:
        reason = os_reason(error) if isinstance(error, OSError) else str(error)
        raise PortError(f"{url}: cannot be opened: {reason}") from error
    keep_alive(connection)
    return connection


def keep_alive(connection: socket.socket) -> None:
    """Have the system notice when the other end is gone."""
    with suppress(OSError):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _ALIVE.items():
            if hasattr(socket, name):
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


_SE, _SB, _WILL, _WONT, _DO, _DONT, _IAC = 240, 250, 251, 252, 253, 254, 255
_BINARY, _GO_AHEAD, _COM_PORT = 0, 3, 44
_OPTIONS: Final = frozenset({_BINARY, _GO_AHEAD, _COM_PORT})  # that are agreed to
_REPLY_BYTES: Final = 4096  # that wait for a server at most
_OPTION_BYTES: Final = 64  # of a subnegotiation that are looked at
_SERVER: Final = 100  # a server's answer to command n is 100 + n
_CONTROL: Final = 5
_ASK_DTR, _DTR_HIGH, _DTR_LOW, _ASK_RTS, _RTS_HIGH, _RTS_LOW = 7, 8, 9, 10, 11, 12
_LINES: Final = {_DTR_HIGH: ("DTR", True), _DTR_LOW: ("DTR", False), _RTS_HIGH: ("RTS", True), _RTS_LOW: ("RTS", False)}
_COMMANDS: Final = {"baud": 1, "data_bits": 2, "parity": 3, "stop_bits": 4}  # RFC 2217, value 0 asks
_PARITIES: Final = {1: "N", 2: "O", 3: "E"}
_STOP_BITS: Final = {1: 1.0, 2: 2.0, 3: 1.5}
_NEGOTIATION_S: Final = 3.0
_ANSWERS_S: Final = 1.5


class TelnetReceiver:
    """What a port server sends, taken apart: the line's bytes, and its answers. Nothing is sent here: see `replies`."""

    def __init__(self) -> None:
        self.replies = bytearray(bytes([_IAC, _WILL, _COM_PORT, _IAC, _DO, _BINARY]))  # to be sent
        self.sets_ports: bool | None = None  # whether the server speaks RFC 2217; None: not known yet
        self.answers: dict[int, bytes] = {}  # the newest value by command
        self.lines: dict[str, bool] = {}  # RTS and DTR: whether high
        self._agreed = {(_WILL, _COM_PORT), (_DO, _BINARY)}  # what was sent of each option
        self._rest = b""  # of a command that a read has cut
        self._option: bytearray | None = None  # the subnegotiation that is being received

    def feed(self, received: bytes) -> bytes:
        """The line's bytes among these."""
        received, self._rest = self._rest + received, b""
        data, at = bytearray(), 0
        while (mark := received.find(_IAC, at)) >= 0:
            self._take(received[at:mark], data)
            size = 3 if received[mark + 1 : mark + 2] and received[mark + 1] in (_WILL, _WONT, _DO, _DONT) else 2
            if mark + size > len(received):
                self._rest = received[mark:]
                return bytes(data)
            self._command(received[mark + 1 : mark + size], data)
            at = mark + size
        self._take(received[at:], data)
        return bytes(data)

    def ask(self, setting: str, value: bytes) -> None:
        """Send a command with a value; zeros ask for the one in force."""
        self.answers.pop(_COMMANDS[setting], None)
        self._send(_COMMANDS[setting], value)

    def ask_lines(self) -> None:
        """Ask whether RTS and DTR are high."""
        self._send(_CONTROL, bytes([_ASK_DTR]))
        self._send(_CONTROL, bytes([_ASK_RTS]))

    def answered(self, setting: str) -> bool:
        """Whether the newest question was answered."""
        return _COMMANDS[setting] in self.answers

    def values(self) -> dict[str, Any]:
        """The settings in force, as far as the server reported them."""
        reported: dict[str, Any] = {}
        baud = self.answers.get(_COMMANDS["baud"], b"")
        if len(baud) == 4 and (rate := int.from_bytes(baud)):
            reported["baud"] = rate
        for setting, meanings in (("parity", _PARITIES), ("stop_bits", _STOP_BITS), ("data_bits", {7: 7, 8: 8})):
            answer = self.answers.get(_COMMANDS[setting], b"")
            if len(answer) == 1 and answer[0] in meanings:
                reported[setting] = meanings[answer[0]]
        return reported

    def _take(self, part: bytes, data: bytearray) -> None:
        """Bytes between commands: the line's, or those of a subnegotiation."""
        if self._option is None:
            data += part
        else:
            self._option += part[: _OPTION_BYTES - len(self._option)]

    def _command(self, command: bytes, data: bytearray) -> None:
        kind = command[0]
        if kind == _IAC:
            self._take(command, data)
        elif kind == _SB:
            self._option = bytearray()
        elif kind == _SE:
            self._answer(bytes(self._option or b""))
            self._option = None
        elif len(command) == 2:
            self._agree(kind, command[1])

    def _agree(self, kind: int, option: int) -> None:
        """Telnet's negotiation (RFC 854): an answer is sent once, never to what only confirms."""
        yes, no = (_WILL, _WONT) if kind in (_DO, _DONT) else (_DO, _DONT)
        if option == _COM_PORT and kind != _WONT:
            self.sets_ports = kind != _DONT
        if kind in (_DO, _WILL):
            self._reply(yes if option in _OPTIONS else no, option)
        elif (yes, option) in self._agreed:
            self._agreed.discard((yes, option))
            self._reply(no, option)

    def _reply(self, kind: int, option: int) -> None:
        if (kind, option) not in self._agreed and len(self.replies) < _REPLY_BYTES:
            self._agreed.add((kind, option))
            self.replies += bytes([_IAC, kind, option])

    def _answer(self, option: bytes) -> None:
        if len(option) < 2 or option[0] != _COM_PORT:
            return
        command, value = option[1] - _SERVER, option[2:]
        if command == _CONTROL and value and value[0] in _LINES:
            line, high = _LINES[value[0]]
            self.lines[line] = high
        elif command in _COMMANDS.values():
            self.answers[command] = value

    def _send(self, command: int, value: bytes) -> None:
        escaped = value.replace(b"\xff", b"\xff\xff")
        self.replies += bytes([_IAC, _SB, _COM_PORT, command]) + escaped + bytes([_IAC, _SE])


class PortServerTap(SocketTap):
    """The port behind a port server. `settings` are those in force there, as far as the server tells them."""

    def __init__(self, settings: PortSettings, *, blocking: bool = False) -> None:
        """Connect and negotiate; PortError says in one line why it can't be done."""
        super().__init__(settings, blocking=blocking)
        self._telnet = TelnetReceiver()
        self._early = bytearray()  # bytes of the line that came meanwhile
        self._unconfirmed: set[str] = set()  # settings that were sent and not answered
        self._until = 0.0
        self._high: list[str] = []
        try:
            self._negotiate(settings)
        except OSError as error:
            self.close()
            raise PortError(
                f"{settings.url}: the port server disconnected while it was asked for its settings"
            ) from error

    def read(self) -> tuple[bytes, list[int]]:
        """See `Tap`; what came while the server had not taken on changed settings yet is left out."""
        if self._early:
            data, self._early = bytes(self._early), bytearray()
            return data, []
        received, _ = super().read()
        data = self._telnet.feed(received)
        self._reply_or_leave()
        self._tell_lines()
        if self._unconfirmed:
            self._confirm()
            return b"", []
        return data, []

    def change(self, settings: PortSettings) -> None:
        """Other settings at the server."""
        super().change(settings)
        self._unconfirmed = set(_COMMANDS)
        self._until = time.monotonic() + _ANSWERS_S
        self._early.clear()
        self._set(settings, self._unconfirmed)
        self._reply_or_leave()

    def _negotiate(self, settings: PortSettings) -> None:
        self._exchange(lambda: self._telnet.sets_ports is not None, _NEGOTIATION_S)
        if not self._telnet.sets_ports:
            lost = f"{', '.join(settings.remote_changes)} cannot be set there, and " if settings.remote_changes else ""
            self.notices.append(f"{settings.url}: does not speak RFC 2217: {lost}its settings are not known")
            self.settings = self._in_force(settings)
            return
        self._set(settings, set(settings.remote_changes))
        for setting in _COMMANDS.keys() - set(settings.remote_changes):
            self._telnet.ask(setting, b"\0\0\0\0" if setting == "baud" else b"\0")
        self._telnet.ask_lines()
        self._exchange(lambda: all(self._telnet.answered(setting) for setting in _COMMANDS), _ANSWERS_S)
        self.settings = self._in_force(settings)
        self._tell_refused(settings, settings.remote_changes)
        self._tell_lines()

    def _in_force(self, wanted: PortSettings) -> PortSettings:
        """What the server reports; where it is silent, what it was told to set."""
        baud = wanted.baud if "baud" in wanted.remote_changes else None
        return replace(wanted, **{"baud": baud, **self._telnet.values()})

    def _set(self, settings: PortSettings, which: set[str]) -> None:
        codes: dict[str, bytes] = {
            "baud": struct.pack(">I", settings.baud or 0),
            "data_bits": bytes([settings.data_bits]),
            "parity": bytes([next(code for code, parity in _PARITIES.items() if parity == settings.parity)]),
            "stop_bits": bytes([next(code for code, bits in _STOP_BITS.items() if bits == settings.stop_bits)]),
        }
        for setting in sorted(which):
            self._telnet.ask(setting, codes[setting])

    def _exchange(self, is_over: Callable[[], bool], patience_s: float) -> None:
        """Talk until this is so, or the time is over."""
        until = time.monotonic() + patience_s
        while not is_over() and (left := until - time.monotonic()) > 0:
            self._socket.settimeout(left)
            try:
                self._reply()
                received = self._socket.recv(READ_BYTES)
            except TimeoutError:
                break
            if not received:
                raise ConnectionResetError
            self._early += self._telnet.feed(received)
        self._socket.setblocking(False)
        self._reply()

    def _reply(self) -> None:
        """Send what telnet has to say; what the socket does not take now goes with the next read."""
        if self._telnet.replies:
            with suppress(BlockingIOError):
                sent = self._socket.send(self._telnet.replies)
                del self._telnet.replies[:sent]

    def _reply_or_leave(self) -> None:
        try:
            self._reply()
        except OSError as error:
            raise PortGoneError(os_reason(error)) from error

    def _confirm(self) -> None:
        """Settings that were changed: in force once the server answered, or said nothing for too long."""
        self._unconfirmed = {setting for setting in self._unconfirmed if not self._telnet.answered(setting)}
        if self._unconfirmed and time.monotonic() < self._until:
            return
        self._tell_refused(self.settings, _COMMANDS)
        self._unconfirmed.clear()

    def _tell_refused(self, wanted: PortSettings, settings: Iterable[str]) -> None:
        """Settings that the server was told to set and did not."""
        reported = self._telnet.values()
        for setting in settings:
            value = getattr(wanted, setting)
            if reported.get(setting) != value:
                instead = f"it is {reported[setting]}" if setting in reported else "the server does not respond"
                self.notices.append(f"{wanted.url}: {setting} {value} is not set there: {instead}")

    def _tell_lines(self) -> None:
        high = [line for line in ("RTS", "DTR") if self._telnet.lines.get(line)]
        if high != self._high:
            self._high = high
            self.notices += [f"{self.settings.url}: {words}" for words in high_line_words(high)]
