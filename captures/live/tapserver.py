"""A tap for viewers elsewhere: what it heard, with the times at which it heard it, to whoever asks and may.

What was heard is kept, up to a limit, so that a viewer whose connection broke goes on where it was. Each viewer has a
thread, which takes from what is kept at its own pace; whoever feeds the tap waits for none of them. A viewer says one
line and is not listened to any more: nothing that it sends goes anywhere. Who has not proved that it knows the token
has no place, and none of those who did (`taproom`).
"""

from __future__ import annotations

import secrets
import socket
import ssl
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any, Final

from ..chunks import Block
from ..errors import os_reason
from ..line import LineSettings
from .batching import position_record
from .gateway import keep_alive
from .taproom import PLACES, STRANGERS, TOO_SLOW, Rooms, SparingLog, Visitor
from .tapstream import HELLO_S, VERSION, Proving, TapSetupError, hear, is_nonce, new_nonce, send_line
from .wire import Item, PortEvent, WireError, records_of

KEEP_BYTES: Final = 64 << 20
_COST: Final = 180  # bytes of memory that a kept record costs besides its own
_STUCK_S: Final = 20.0  # a viewer that takes nothing for so long is let go
_AT_ONCE: Final = 256  # records
_END_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class _Kept:
    record: bytes
    heard: int  # bytes of the line before it
    t_ns: int  # of what was before it
    line: dict[str, object] | None  # settings before it


class KeptStream:
    """Records in order, numbered from 0, the oldest given up for want of room. Threads may use it at once."""

    def __init__(self, keep_bytes: int = KEEP_BYTES) -> None:
        self._keep = keep_bytes
        self._kept: deque[_Kept] = deque()
        self._size = 0
        self._first = 0  # the number of the oldest
        self._heard = 0
        self._t_ns = time.time_ns()  # of the newest read or tick
        self._line: dict[str, object] | None = None
        self._changed = threading.Condition()
        self.over = False

    def add(self, item: Item, line: LineSettings) -> None:
        """Keep an item. `line`: as it is known by then."""
        if isinstance(item, PortEvent) and item.kind == "settled":
            item = PortEvent(item.t_ns, item.port, item.kind, item.text, {"line": line.to_header()})
        with self._changed:
            for record, octets in records_of(item):
                self._kept.append(_Kept(record, self._heard, self._t_ns, self._line))
                self._size += len(record) + _COST
                self._heard += octets
            if isinstance(item, Block):
                self._t_ns = int(item.t_ns[-1])
            elif not isinstance(item, PortEvent):  # whose times may be ahead of reads that come behind them
                self._t_ns = item.t_ns
            elif item.kind == "settled":
                self._line = line.to_header()
            while self._size > self._keep and len(self._kept) > 1:
                self._size -= len(self._kept.popleft().record) + _COST
                self._first += 1
            self._changed.notify_all()

    def end(self) -> None:
        """No more comes."""
        with self._changed:
            self.over = True
            self._changed.notify_all()

    @property
    def next(self) -> int:
        """The number of the record that comes next."""
        return self._first + len(self._kept)

    def position(self, number: int | None) -> tuple[int, bytes]:
        """Where a viewer begins who wants this record next (None: the newest), and the record that tells it."""
        with self._changed:
            number = self.next if number is None or number > self.next else max(number, self._first)
            state = (self._heard, self._t_ns, self._line)
            if number < self.next:
                kept = self._kept[number - self._first]
                state = (kept.heard, kept.t_ns, kept.line)
            heard, t_ns, line = state
        return number, position_record(t_ns, {"next": number, "heard": heard, "line": line})

    def take_records(self, number: int, wait_s: float) -> list[bytes] | None:
        """Some records from this number on, none where none comes in time; None where it is not kept any more."""
        with self._changed:
            if number == self.next and not self.over:
                self._changed.wait(wait_s)
            if number < self._first:
                return None
            begin = number - self._first
            return [kept.record for kept in islice(self._kept, begin, begin + _AT_ONCE)]


class TapServer:
    """Viewers served from a thread each. `feed` what is heard; `close` when no more comes."""

    def __init__(
        self,
        host: str,
        port: int,
        *,
        tell: Callable[[str], None],
        token: str | None = None,
        tls: ssl.SSLContext | None = None,
        keep_bytes: int = KEEP_BYTES,
    ) -> None:
        """Listen for viewers. `tell` says a line and waits for nobody. TapSetupError where it cannot be."""
        self._history = KeptStream(keep_bytes)
        self._session = secrets.token_hex(8)
        self._token, self._tls, self._tell = token, tls, tell
        self._complain = SparingLog(tell)
        self._rooms = Rooms()
        self._threads: set[threading.Thread] = set()  # one a connection
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._listener = socket.create_server((host, port), family=family, backlog=PLACES + STRANGERS)
        except (OSError, OverflowError) as error:
            reason = os_reason(error) if isinstance(error, OSError) else str(error)
            raise TapSetupError(f"cannot listen for viewers on {host} port {port}: {reason}") from error
        self.port: int = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def feed(self, item: Item, line: LineSettings) -> None:
        """What was heard; waits for no viewer."""
        self._history.add(item, line)

    @property
    def viewers(self) -> int:
        """How many there are now; who has proved nothing is none."""
        return self._rooms.viewers

    def close(self) -> None:
        """Let viewers have what is kept, for a moment, then hang up."""
        self._history.end()
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)  # else the thread that accepts stays in it
        self._listener.close()
        until = time.monotonic() + _END_S
        for thread in (self._thread, *list(self._threads)):
            thread.join(max(0.0, until - time.monotonic()))

    def _accept(self) -> None:
        while not self._history.over:
            try:
                connection, address = self._listener.accept()
            except OSError:
                if self._history.over:
                    return
                continue  # of one connection, gone before it was taken
            visitor = Visitor(connection, str(address[0]))
            self._rooms.enter(visitor)
            thread = threading.Thread(target=self._view, args=(visitor,), daemon=True)
            self._threads.add(thread)
            thread.start()

    def _view(self, visitor: Visitor) -> None:
        begun = False
        patience = threading.Timer(HELLO_S, visitor.turn_out, (TOO_SLOW,))  # also for a byte now and then
        patience.start()
        try:
            number = self._greeted(visitor)
            patience.cancel()
            begun = True
            self._tell(f"viewer at {visitor.address}: connected")
            visitor.connection.settimeout(_STUCK_S)
            self._stream(visitor.connection, number)
        except (OSError, ValueError, WireError) as error:
            reason = os_reason(error) if isinstance(error, OSError) else str(error)
            if begun:
                self._tell(f"viewer at {visitor.address}: disconnected ({reason})")
            else:
                self._turned_away(visitor, visitor.why or reason)
        finally:
            patience.cancel()
            self._rooms.leave(visitor)
            self._threads.discard(threading.current_thread())
            with suppress(OSError):
                visitor.connection.close()

    def _turned_away(self, visitor: Visitor, why: str) -> None:
        """The log and the viewer are told why; who is not there any more needs no words."""
        self._complain(visitor.address, f"refused: {why}")
        with suppress(OSError, ValueError):
            visitor.connection.settimeout(HELLO_S)
            send_line(visitor.connection, {"refused": why})

    def _greeted(self, visitor: Visitor) -> int:
        """Where the viewer begins, who has proved that it may; WireError where it may not."""
        visitor.connection.settimeout(HELLO_S)
        keep_alive(visitor.connection)
        if self._tls is not None:
            visitor.connection = self._tls.wrap_socket(
                visitor.connection, server_side=True, do_handshake_on_connect=False
            )
            if not visitor.why:
                visitor.connection.do_handshake()
        connection, nonce = visitor.connection, new_nonce()
        send_line(connection, {"rtuscope_tap": VERSION, "nonce": nonce})
        asked, _ = hear(connection)
        theirs, session = asked.get("nonce"), asked.get("session", "")
        if not is_nonce(theirs) or not isinstance(session, str):
            raise WireError("the client is not a viewer of this version")
        proving = Proving(self._token, nonce, theirs)
        if self._token is not None and not proving.proved(asked.get("proof"), "viewer", session):
            raise WireError("this tap needs another token than the one given")
        if not self._rooms.admit(visitor):
            raise WireError(visitor.why or f"all {PLACES} viewer slots of this tap are taken")
        send_line(connection, {"session": self._session, "proof": proving.proof("tap", self._session)})
        number = None
        if session:  # it comes back: to this tap as it was, or as it began anew
            number = _position_asked(asked) if session == self._session else 0
        number, position = self._history.position(number)
        connection.sendall(position)
        return number

    def _stream(self, connection: socket.socket, number: int) -> None:
        while True:
            records = self._history.take_records(number, _END_S)
            if records is None:
                number, position = self._history.position(number)
                records = [position]
            else:
                number += len(records)
            if records:
                connection.sendall(b"".join(records))
            elif self._history.over:
                return


def _position_asked(asked: dict[str, Any]) -> int | None:
    number = asked.get("next")
    return number if isinstance(number, int) and not isinstance(number, bool) and number >= 0 else None
