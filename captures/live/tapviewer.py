"""A tap elsewhere, listened to: `tap://HOST[:PORT]`. Its items are those that were heard there, with their times.

A connection that breaks is made again, and goes on where it was: as long as the tap keeps what came meanwhile nothing
is lost, and what is lost is counted and told. What comes is held to be hostile: records are checked (`wire`), times
never decrease, words are cut to a length.
"""

from __future__ import annotations

import queue
import socket
import ssl
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from ..chunks import Block
from ..errors import os_reason
from ..line import LineSettings
from .batching import POSITION
from .tap import WAIT_S, PortError
from .taproom import Visitor
from .tapstream import (
    HELLO_S,
    VERSION,
    NoHelloError,
    Proving,
    TapAddress,
    hear,
    is_nonce,
    new_nonce,
    send_line,
    viewing_context,
)
from .wire import Item, PortEvent, Splitter, Tick, WireError, item_of, json_object

_PIECE: Final = 1 << 16
_RETRY_S: Final = 0.5
_REFUSED_S: Final = 10.0
_SILENT_S: Final = 10.0  # a tap says something twice a second, on a quiet line too
_WORDS: Final = 1000  # characters of what a tap says
_KINDS: Final = frozenset({"opened", "lost", "waiting", "settled", "settings", "seeking", "trying", "clock"})


class RefusedError(PortError):
    """The tap does not want this viewer, or this viewer the tap, which is not the one that it says it is."""


class TapViewer:
    """A tap elsewhere, as a source of a session. `lost`: bytes that were heard there and did not come here."""

    waits = False
    more = False  # as far as is known, behind any item

    def __init__(self, url: str, *, token: str | None = None, authority: str | None = None, wait: bool = False) -> None:
        """`authority`: a certificate to trust, for taps://. `wait`: for a tap that is not there yet."""
        self._address = TapAddress.of(url)
        self._token = token
        self._tls = viewing_context(authority) if self._address.tls else None
        self._wait = wait
        self._closing = threading.Event()
        self.line = LineSettings()
        self.lost = 0
        self._session = ""
        self._next: int | None = None  # the number of the record that is wanted next
        self._heard = 0  # bytes of the line before it, by the tap's count
        self._t_ns = 0  # the newest time given
        self._restarted = False  # the tap is another than before
        self._behind_ns = 0  # what is added to the times of a tap that began anew with an earlier clock

    def items(self) -> Iterator[Item]:
        """What the tap heard, until `close`. PortError where it is not there, or refuses."""
        told = ""
        while not self._closing.is_set():
            again = time.monotonic() + _RETRY_S
            try:
                connection, rest = self._connected()
            except PortError as error:
                if not (self._wait or self._session):
                    raise
                if isinstance(error, RefusedError):
                    again += _REFUSED_S
                if str(error) != told:
                    told = str(error)
                    yield self._event("waiting", f"{told}; waiting for it")
            else:
                if connection is None:
                    return
                with connection:
                    told = yield from self._streamed(connection, rest)
            while time.monotonic() < again and not self._closing.wait(WAIT_S):
                if self._t_ns:
                    yield Tick(self._t_ns)  # nothing is known of later

    def judge(self, heard: int, sense: int, line: LineSettings) -> None:
        """The settings are sought at the tap, not here."""

    def close(self) -> None:
        """End soon."""
        self._closing.set()

    def _streamed(self, connection: socket.socket, rest: bytes) -> Generator[Item, None, str]:
        """What one connection brings; returns what was told of its end."""
        records = Splitter()
        connection.settimeout(WAIT_S)
        silent = time.monotonic() + _SILENT_S
        reason = "closed by the other end"
        try:
            while not self._closing.is_set():
                for record in records.feed(rest):
                    yield from self._taken(*record)
                try:
                    rest = connection.recv(_PIECE)
                except (TimeoutError, ssl.SSLWantReadError):
                    rest = b""
                    if time.monotonic() > silent:
                        reason = "it stopped sending"
                        break
                    continue
                silent = time.monotonic() + _SILENT_S
                if not rest:
                    break
        except OSError as error:
            reason = os_reason(error)
        except WireError as error:
            reason = f"its data is not a tap's: {error}"
        if self._closing.is_set():
            return ""
        text = f"{self._address.url}: connection lost ({reason})"
        yield self._event("waiting", f"{text}; connecting again")
        return text

    def _taken(self, kind: int, port: int, t_ns: int, body: bytes) -> Iterator[Item]:
        if kind == POSITION:
            yield from self._placed(t_ns, json_object(body))
            return
        if self._next is None:
            raise WireError("it does not give its start position")
        self._next += 1
        item = item_of(kind, port, t_ns, body)
        if isinstance(item, Block):
            self._heard += len(item.data)
            item = item if not self._behind_ns else replace(item, t_ns=item.t_ns + self._behind_ns)
            self._later(int(item.t_ns[0]))
            self._t_ns = int(item.t_ns[-1])
            yield item
        elif isinstance(item, Tick):
            self._later(item.t_ns + self._behind_ns)
            yield Tick(self._t_ns)
        elif item is not None:
            yield from self._told(item)

    def _told(self, event: PortEvent) -> Iterator[Item]:
        """What happened at the tap; of its own end a viewer is told by the connection."""
        if event.kind in ("ended", "failed"):
            return
        if event.kind == "settled":
            self._set(event.more.get("line"))
        kind = event.kind if event.kind in _KINDS else "notice"
        yield PortEvent(event.t_ns + self._behind_ns, event.port, kind, event.text[:_WORDS], {})

    def _placed(self, t_ns: int, position: dict[str, Any]) -> Iterator[Item]:
        """Where the stream goes on: what is missing before it is counted and told."""
        number, heard = _count(position.get("next")), _count(position.get("heard"))
        url, before, first = self._address.url, self._t_ns, self._next is None
        anew = self._restarted and not first
        missed = heard - self._heard
        self._next, self._heard = number, heard
        if anew:
            self._behind_ns = max(0, before - t_ns)
        self._restarted = False
        self._t_ns = max(before, t_ns + self._behind_ns)
        if first:
            yield PortEvent(self._t_ns, 0, "opened", f"{url}: open", {})
        elif anew or missed > 0:
            self.lost += 0 if anew else missed
            what = "it restarted: bytes in between are unknown" if anew else f"{missed:,} bytes are lost"
            yield PortEvent(before, 0, "lost", f"{url}: lost ({what})", {})
            yield PortEvent(self._t_ns, 0, "opened", f"{url}: is back; {what}", {})
        else:
            yield PortEvent(self._t_ns, 0, "notice", f"{url}: connected again, nothing lost", {})
        if self._set(position.get("line")) or first:
            yield PortEvent(self._t_ns, 0, "settled", f"{url}: listening: {self._line_words()}", {})

    def _set(self, header: object) -> bool:
        """Take the line's settings, where they are told; whether they are others."""
        if not isinstance(header, dict):
            return False
        line, _ = LineSettings.from_header({str(key): value for key, value in header.items()})
        changed, self.line = line != self.line, line
        return changed

    def _line_words(self) -> str:
        line = self.line
        return f"{line.baud} bit/s, parity {line.parity}" if line.baud else "the tap does not know the rate yet"

    def _later(self, t_ns: int) -> None:
        if t_ns < self._t_ns:
            raise WireError(f"its times go back by {(self._t_ns - t_ns) / 1e9:.3f} s")
        self._t_ns = t_ns

    def _event(self, kind: str, text: str) -> PortEvent:
        return PortEvent(self._t_ns, 0, kind, text, {})

    # Connecting: in a thread, so that an end need not wait for it.

    def _connected(self) -> tuple[socket.socket | None, bytes]:
        """A connection to the tap, past its greeting, and what came behind that; None where the end came first."""
        results: queue.SimpleQueue[tuple[socket.socket, str, bytes] | PortError] = queue.SimpleQueue()
        threading.Thread(target=self._attempt, args=(results,), daemon=True).start()
        while not self._closing.is_set():
            try:
                result = results.get(timeout=WAIT_S)
            except queue.Empty:
                continue
            if isinstance(result, PortError):
                raise result
            connection, session, rest = result
            self._restarted = session != self._session
            self._session = session
            return connection, rest
        return None, b""

    def _attempt(self, results: queue.SimpleQueue[tuple[socket.socket, str, bytes] | PortError]) -> None:
        address, tap = self._address, None
        try:
            tap = Visitor(socket.create_connection((address.host, address.port), HELLO_S), address.host)
            patience = threading.Timer(2 * HELLO_S, tap.turn_out, ("timed out",))  # whoever sends a byte now and then
            patience.start()
            try:
                if self._tls is not None:
                    tap.connection = self._tls.wrap_socket(
                        tap.connection, server_hostname=address.host, do_handshake_on_connect=False
                    )
                    tap.connection.do_handshake()
                results.put((tap.connection, *self._greeted(tap.connection)))
            finally:
                patience.cancel()
            return
        except RefusedError as error:
            results.put(error)
        except (OSError, ValueError, WireError) as error:
            reason = os_reason(error) if isinstance(error, OSError) else str(error)
            results.put(PortError(f"{address.url}: no tap there: {reason}{self._remedy(error)}"))
        except Exception as error:  # whoever waits for the result would wait for ever
            results.put(PortError(f"{address.url}: cannot be opened: {type(error).__name__}: {error}"))
        if tap is not None:
            with suppress(OSError):
                tap.connection.close()

    def _remedy(self, error: Exception) -> str:
        """What to say instead, where a connection fails by it."""
        if isinstance(error, ssl.SSLCertVerificationError):
            return "; `--tls-ca FILE` adds one to trust"
        if isinstance(error, ssl.SSLError) and error.reason == "WRONG_VERSION_NUMBER":
            return "; without TLS it is tap://"
        if isinstance(error, NoHelloError) and self._tls is None:
            return "; with TLS it is taps://"
        return ""

    def _greeted(self, connection: socket.socket) -> tuple[str, bytes]:
        try:
            greeting, _ = hear(connection)
        except TimeoutError as error:
            raise NoHelloError("it does not identify itself") from error
        version, theirs = greeting.get("rtuscope_tap"), greeting.get("nonce")
        if version != VERSION and isinstance(version, int) and 0 < version < 1000:
            raise WireError(f"the tap has version {version}, this is version {VERSION}: update the older rtuscope")
        if version != VERSION or not is_nonce(theirs):
            raise WireError("the other end is not a tap of this version")
        proving = Proving(self._token, theirs, new_nonce())
        asked = {"nonce": proving.viewer_nonce, "proof": proving.proof("viewer", self._session)}
        send_line(connection, {**asked, "session": self._session, "next": self._next})
        answer, rest = hear(connection)
        session, url = answer.get("session"), self._address.url
        if not isinstance(session, str) or not 0 < len(session) <= 64:
            why = answer.get("refused")
            raise RefusedError(f"{url}: refused: {str(why)[:_WORDS] if why else 'no reason given'}")
        if not proving.proved(answer.get("proof"), "tap", session):
            raise RefusedError(
                f"{url}: refused: it failed to prove that it knows the token; it is another tap, or was started "
                "without --token-file"
            )
        return session, rest


def _count(value: object) -> int:
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 62:
        return value
    raise WireError("an impossible position in its stream")
