"""Twins on a port or a socket: bytes in, answers out, each after its delay."""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Final, Protocol

from captures.errors import CaptureError, os_reason
from captures.live.pace import sleep_until
from captures.live.settings import FALLBACK_BAUD, PortSettings
from captures.live.tap import GONE, refusal
from dissectors.crc import crc_bytes
from dissectors.lengths import Role, adu_end
from dissectors.limits import BROADCAST, MAX_ADU

from .faults import FaultyAnswers
from .memory import TwinAnswer, TwinUnit

_WAIT_S: Final = 0.1  # after which it looks whether it should end
_QUIET_NS: Final = 50_000_000  # what is no frame by then is none
_ECHO_NS: Final = 20_000_000  # after an answer went out
_PIECE: Final = 4096
_HEADER: Final = 6  # bytes of an MBAP header before the unit ([3] 3.1.3)
_MOST_BODY: Final = 254  # unit and PDU


class TwinLine(Protocol):
    """A serial line. `may_echo`: what is sent may be heard again."""

    may_echo: bool

    def read(self, wait_s: float) -> bytes: ...

    def write(self, data: bytes) -> None: ...


class TwinsOnALine:
    """Units that answer, whoever asks; may be asked by several threads. `asked` and `answered` count; `faults` are what
    goes wrong on purpose."""

    def __init__(self, units: Mapping[int, TwinUnit], faults: FaultyAnswers | None = None) -> None:
        self._units = units
        self.faults = faults or FaultyAnswers(())
        self._lock = threading.Lock()
        self.asked = self.answered = 0

    def answer(self, unit: int, pdu: bytes) -> TwinAnswer | None:
        """What a unit says to a request; None: nothing."""
        with self._lock:
            if unit == BROADCAST:
                for each in self._units.values():
                    with suppress(ValueError):
                        each.broadcast(pdu)
                return None
            twin = self._units.get(unit)
            if twin is None:
                return None
            self.asked += 1
            answer = self._answer(twin, unit, pdu)
            self.answered += answer is not None
            return answer

    def _answer(self, twin: TwinUnit, unit: int, pdu: bytes) -> TwinAnswer | None:
        fault = self.faults.due(unit)
        if fault is not None and fault.kind.instead is not None:
            return twin.refusal(fault.kind.instead(pdu, fault.value))
        answer = twin.answer(pdu)
        return answer if fault is None or answer is None else self.faults.spoilt(fault, answer)


class _OwnEcho:
    """An adapter may hear what it sends: that is no request. Whether it does shows by the first answer to a read; the
    echo of a write is its request once more, which a client hardly sends within 20 ms of its answer."""

    def __init__(self, may_echo: bool) -> None:
        self._echoes: bool | None = None if may_echo else False
        self._sent, self._repeats, self._at_ns = b"", False, 0

    def sent(self, frame: bytes, request: bytes) -> None:
        """An answer went out."""
        self._sent, self._repeats, self._at_ns = frame, frame == request, time.monotonic_ns()

    def heard(self, frame: bytes, now: int) -> bool:
        """Whether a frame is an echo."""
        sent, self._sent = self._sent, b""
        if not sent or self._echoes is False:
            return False
        same = frame == sent
        if not self._repeats:
            self._echoes = same
        return same and (self._echoes is True or now - self._at_ns < _ECHO_NS)


def serve_line(twins: TwinsOnALine, line: TwinLine, stop: Callable[[], bool]) -> None:
    """Answer RTU requests until `stop`. CaptureError where the line is gone."""
    held, last, echo = b"", 0, _OwnEcho(line.may_echo)
    while not stop():
        data = line.read(_WAIT_S)
        now = time.monotonic_ns()
        if held and now - last > _QUIET_NS:
            held = b""
        if not data:
            continue
        held, last = held + data, now
        while end := adu_end(held, Role.REQUEST):
            frame, held = held[:end], held[end:]
            answer = None if echo.heard(frame, now) else twins.answer(frame[0], frame[1:-2])
            if answer is not None:
                body = _named(answer, frame[:1]) + answer.pdu
                adu = answer.spoil(body + crc_bytes(body))
                sleep_until(now + answer.delay_ns, stop)
                line.write(adu)
                echo.sent(adu, frame)
        held = held[-MAX_ADU:]


def _named(answer: TwinAnswer, asked: bytes) -> bytes:
    """The unit in whose name an answer is, as the byte of a frame."""
    return asked if answer.as_unit is None else bytes((answer.as_unit,))


class SerialLine:
    """A serial port of this machine, or a socket:// or rfc2217:// one: what pyserial opens."""

    may_echo = True

    def __init__(self, settings: PortSettings) -> None:
        """CaptureError says in one line why it can't be opened."""
        import serial

        self._name = settings.url
        try:
            self._port: Any = serial.serial_for_url(
                settings.url,
                baudrate=settings.baud or FALLBACK_BAUD,
                parity=settings.parity,
                stopbits=settings.stop_bits,
                timeout=_WAIT_S,
            )
        except (OSError, ValueError) as error:
            raise CaptureError(refusal(settings.url, error)) from error
        except Exception as error:  # termios.error
            raise CaptureError(f"{settings.url}: cannot be opened: {error}") from error

    def read(self, wait_s: float) -> bytes:
        """What has come, after a wait at most."""
        try:
            self._port.timeout = wait_s
            data: bytes = self._port.read(1)
            return data + self._port.read(self._port.in_waiting) if data else b""
        except Exception as error:  # an unplugged one complains in many ways
            raise CaptureError(f"{self._name}: {GONE}") from error

    def write(self, data: bytes) -> None:
        """Send it."""
        try:
            self._port.write(data)
            self._port.flush()
        except Exception as error:
            raise CaptureError(f"{self._name}: {GONE}") from error

    def close(self) -> None:
        """Let go of it."""
        with suppress(Exception):
            self._port.close()


class TerminalLine:
    """A pseudo-terminal, whose `name` is the port for a client's program. Needs POSIX."""

    may_echo = False

    def __init__(self) -> None:
        import tty

        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.name = os.ttyname(self._slave)

    def read(self, wait_s: float) -> bytes:
        """See `SerialLine`."""
        ready, _, _ = select.select([self._master], [], [], wait_s)
        return os.read(self._master, _PIECE) if ready else b""

    def write(self, data: bytes) -> None:
        """Send it; what nobody takes is lost, as on a line."""
        _, ready, _ = select.select([], [self._master], [], _WAIT_S)
        if ready:
            os.write(self._master, data)

    def close(self) -> None:
        """Let go of it."""
        os.close(self._master)
        os.close(self._slave)


class TwinServer:
    """Modbus TCP: a thread a connection. A context manager; `port` is where it listens."""

    def __init__(self, twins: TwinsOnALine, host: str, port: int) -> None:
        """CaptureError where it can't listen."""
        self._twins = twins
        self._ended = threading.Event()
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._socket = socket.create_server((host, port), family=family)
        except OSError as error:
            raise CaptureError(f"{host}:{port}: {os_reason(error)}") from error
        self._socket.settimeout(_WAIT_S)
        self.port: int = self._socket.getsockname()[1]

    def serve(self, stop: Callable[[], bool]) -> None:
        """Take connections until `stop`."""
        while not stop():
            try:
                connection, _ = self._socket.accept()
            except TimeoutError:
                continue
            connection.settimeout(_WAIT_S)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=self._answer, args=(connection,), daemon=True).start()

    def close(self) -> None:
        """End all connections."""
        self._ended.set()
        self._socket.close()

    def _answer(self, connection: socket.socket) -> None:
        held = b""
        with connection, suppress(OSError):
            while not self._ended.is_set():
                try:
                    data = connection.recv(_PIECE)
                except TimeoutError:
                    continue
                if not data:
                    return
                now, held = time.monotonic_ns(), held + data
                while len(held) >= _HEADER:
                    size = int.from_bytes(held[4:_HEADER], "big")
                    if held[2:4] != b"\0\0" or not 2 <= size <= _MOST_BODY:
                        return  # no Modbus TCP: nothing after it can be told apart
                    if len(held) < _HEADER + size:
                        break
                    head, body, held = held[:4], held[_HEADER : _HEADER + size], held[_HEADER + size :]
                    answer = self._twins.answer(body[0], body[1:])
                    if answer is not None:
                        sleep_until(now + answer.delay_ns, self._ended.is_set)
                        length = (1 + len(answer.pdu)).to_bytes(2, "big")
                        connection.sendall(answer.spoil(head + length + _named(answer, body[:1]) + answer.pdu))
