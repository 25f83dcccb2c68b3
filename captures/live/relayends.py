"""The ends between which a relay passes bytes on: the client's pseudo-terminal, the line's port, sockets of gateways.

Needs POSIX: import it where there are pseudo-terminals.
"""

from __future__ import annotations

import fcntl
import os
import select
import socket
import struct
import sys
import termios
import tty
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import serial

from ..errors import os_reason
from .gateway import connected
from .settings import FALLBACK_BAUD, PortSettings
from .tap import GONE, READ_BYTES, PortError, PortGoneError, make_prompt, port_kind, programs_using, refusal

_PIECE: Final = 1 << 16
_FLUSH_READ: Final = 1  # of a packet's head: what waits for the client is to be forgotten (ioctl_tty(2), TIOCPKT)
_GET_EXACT: Final = 0x802C542A  # TCGETS2 of Linux: modes, line discipline, control characters, rates as numbers
_EXACT: Final = struct.Struct("4IB19s2I")
_EXACT_ROOM: Final = bytes(_EXACT.size)
_RATES: Final = {
    getattr(termios, name): int(name[1:]) for name in dir(termios) if name[:1] == "B" and name[1:].isdecimal()
}


class End:
    """One end. `descriptor` can be waited on; nothing here waits."""

    descriptor: int
    pressed = True  # bytes that it does not take may wait where they come from

    def read(self) -> bytes:
        """What has come; nothing where nothing has. PortGoneError where nothing can come any more."""
        try:
            data = os.read(self.descriptor, READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise PortGoneError(os_reason(error)) from error
        if not data:
            raise PortGoneError(GONE)
        return data

    def write(self, data: bytes | bytearray) -> int:
        """How many of the bytes it took. PortGoneError."""
        try:
            return os.write(self.descriptor, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise PortGoneError(os_reason(error)) from error

    def end(self) -> None:
        """Nothing more will be written."""

    def close(self) -> None:
        """Let go of it."""


class ClientTerminal(End):
    """A pseudo-terminal for the client's program, which opens `name` as its serial port.

    In packet mode, so that a client that empties its port does not get what came before. A pseudo-terminal keeps rate
    and stop bits that a client sets; of the parity Linux keeps odd alone, and refuses even.
    """

    def __init__(self, settings: PortSettings) -> None:
        """`settings`: what a client finds there, as `settings` gives them while it changes nothing."""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.name = os.ttyname(self._slave)
        self.descriptor = self._master
        os.set_blocking(self._master, False)
        fcntl.ioctl(self._master, termios.TIOCPKT, struct.pack("i", 1))
        self._settings = self._given = settings
        modes = termios.tcgetattr(self._slave)
        modes[4] = modes[5] = getattr(termios, f"B{settings.baud or FALLBACK_BAUD}", termios.B9600)
        modes[2] = modes[2] | termios.CSTOPB if settings.stop_bits > 1 else modes[2] & ~termios.CSTOPB
        termios.tcsetattr(self._slave, termios.TCSANOW, modes)
        self._raw = self._raw_modes()
        self._first = _line_of(self._raw)
        self.emptied = False  # by the client, since this was last looked at

    def read(self) -> bytes:
        """See `End`."""
        packet = super().read()
        if packet[0]:
            self.emptied = self.emptied or bool(packet[0] & _FLUSH_READ)
            return b""
        return packet[1:]

    @property
    def settings(self) -> PortSettings:
        """As the client has set it; as given while it has not. The same object while nothing changes."""
        raw = self._raw_modes()
        if raw != self._raw:
            self._raw = raw
            self._settings = self._as_set(*_line_of(raw))
        return self._settings

    def _as_set(self, baud: int | None, two: bool, odd: bool) -> PortSettings:
        if (baud, two, odd) == self._first:
            return self._given
        parity = "O" if odd else "N" if self._given.parity == "O" else self._given.parity
        return replace(self._given, baud=baud or self._given.baud, stop_bits=2 if two else 1, parity=parity)

    @property
    def in_use(self) -> bool:
        """Whether a program has it open."""
        os.close(self._slave)
        poll = select.poll()
        poll.register(self._master, 0)
        hung_up = any(events & select.POLLHUP for _, events in poll.poll(0))
        self._slave = os.open(self.name, os.O_RDWR | os.O_NOCTTY)
        return not hung_up

    def close(self) -> None:
        """See `End`."""
        os.close(self._master)
        os.close(self._slave)

    def _raw_modes(self) -> bytes | list[Any]:
        """All that the client can set, to be compared."""
        if sys.platform == "linux":
            try:
                return fcntl.ioctl(self._slave, _GET_EXACT, _EXACT_ROOM)
            except OSError:  # a kernel that lays them out otherwise
                pass
        return termios.tcgetattr(self._slave)


def _line_of(raw: bytes | list[Any]) -> tuple[int | None, bool, bool]:
    """Rate (bit/s; None: unknown), two stop bits, odd parity."""
    if isinstance(raw, bytes):
        _, _, modes, *_, rate = _EXACT.unpack(raw)
    else:
        modes, rate = raw[2], _RATES.get(raw[5])
    return rate, bool(modes & termios.CSTOPB), bool(modes & termios.PARODD)


class DevicePort(End):
    """A serial device of this machine, open for both."""

    def __init__(self, settings: PortSettings) -> None:
        """Open it; PortError says in one line why it can't be."""
        self.kind = port_kind(settings)
        self.pressed = self.kind == "pty"
        if self.pressed:
            settings = replace(settings, parity="N")  # there is no line
        elif users := programs_using(settings.url):
            raise PortError(
                f"{settings.url}: in use by {', '.join(users)}: close it, and point it at the port named here"
            )
        self._port = _opened(settings)
        self.descriptor = self._port.fileno()
        self.notices = make_prompt(self._port, settings.url)
        self._wait_for_bytes()

    def change(self, settings: PortSettings) -> None:
        """Other line settings. PortGoneError; ValueError where the driver refuses them, in words."""
        try:
            self._port.apply_settings(
                {
                    "baudrate": settings.baud or FALLBACK_BAUD,
                    "stopbits": settings.stop_bits,
                    "parity": "N" if self.kind == "pty" else settings.parity,
                }
            )
            self._wait_for_bytes()
        except (OSError, serial.SerialException) as error:
            raise PortGoneError(str(error)) from error
        except Exception as error:  # termios.error is none of these
            raise ValueError(f"{settings.url}: {settings} is refused: {error}") from error

    def close(self) -> None:
        """See `End`."""
        with suppress(Exception):  # an unplugged one complains in many ways
            self._port.close()

    def _wait_for_bytes(self) -> None:
        modes = termios.tcgetattr(self.descriptor)
        modes[6][termios.VMIN] = 1  # a read of no bytes means that the port is gone
        termios.tcsetattr(self.descriptor, termios.TCSANOW, modes)


def _opened(settings: PortSettings) -> Any:
    """pyserial's port, open."""
    try:
        return serial.Serial(
            settings.url,
            settings.baud or FALLBACK_BAUD,
            bytesize=settings.data_bits,
            parity=settings.parity,
            stopbits=settings.stop_bits,
            timeout=0,
            exclusive=True,
        )
    except (serial.SerialException, OSError) as error:
        raise PortError(refusal(settings.url, error)) from error
    except Exception as error:  # termios.error, ValueError
        raise PortError(f"{settings.url}: cannot be opened: {error}") from error


Place = tuple[socket.AddressFamily, Any]


def place_of(host: str, port: int) -> Place:
    """Where a name leads; PortError."""
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError) as error:
        raise PortError(f"{host}:{port}: {os_reason(error) if isinstance(error, OSError) else error}") from error
    return family, address


def listener_at(host: str, port: int) -> socket.socket:
    """A socket that takes connections; PortError."""
    family, address = place_of(host, port)
    try:
        return socket.create_server(address[:2], family=family, backlog=16)
    except OSError as error:
        raise PortError(f"{host}:{port}: {os_reason(error)}") from error


class SocketEnd(End):
    """A connection, perhaps still being made."""

    kind = "tcp"

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        connection.setblocking(False)
        with suppress(OSError):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.descriptor = connection.fileno()
        self.notices: list[str] = []

    @classmethod
    def to(cls, place: Place) -> SocketEnd:
        """Begin to connect; what goes wrong is told by the first read."""
        family, address = place
        connection = socket.socket(family, socket.SOCK_STREAM)
        connection.setblocking(False)
        connection.connect_ex(address)
        return cls(connection)

    @classmethod
    def at(cls, url: str) -> SocketEnd:
        """Connected to `socket://HOST:PORT`; PortError."""
        return cls(connected(url))

    def read(self) -> bytes:
        """See `End`; a read of no bytes is the other side's end."""
        try:
            data = self._socket.recv(_PIECE)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise PortGoneError(os_reason(error)) from error
        if not data:
            raise PortGoneError("")
        return data

    def write(self, data: bytes | bytearray) -> int:
        """See `End`."""
        try:
            return self._socket.send(data)
        except (BlockingIOError, InterruptedError):
            return 0
        except OSError as error:
            raise PortGoneError(os_reason(error)) from error

    def change(self, settings: PortSettings) -> None:
        """The gateway has settings of its own."""

    def end(self) -> None:
        """See `End`."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        """See `End`."""
        self._socket.close()


def line_end(settings: PortSettings) -> DevicePort | SocketEnd:
    """The line's own end, open; PortError."""
    if settings.is_device:
        return DevicePort(settings)
    if settings.url.lower().startswith("socket://"):
        return SocketEnd.at(settings.url)
    raise PortError(f"{settings.url}: bytes are passed on to serial devices and socket://HOST:PORT")
