"""A tap's stream over a network: what its two ends say before, and how a viewer that comes back finds its place.

    tap     {"rtuscope_tap": 2, "nonce": HEX}                            a line of JSON
    viewer  {"nonce": HEX, "proof": HEX, "session": ID or "", "next": N} a line of JSON; its last word
    tap     {"session": ID, "proof": HEX}  or  {"refused": WHY}          a line of JSON
    tap     a record POSITION, then records of `wire`, which are numbered from `next` of that POSITION on

POSITION (JSON) comes first, and again where a viewer was too slow for what is kept: `next` the number of the record
that follows, `heard` how many bytes of the line were in all records before it, `line` the line's settings as a
capture's header has them, or null while they are sought. Its time is that of the record before.

Each side proves that it knows the token: `proof` is HMAC-SHA256, with the token, of the version, the side that proves,
both nonces and the session it names. So the token never travels, what was overheard proves nothing again, and what one
side sent does not serve the other. The bytes of the line travel in the open, and can be altered underway by who stands
between, unless TLS is used.
"""

from __future__ import annotations

import hmac
import ipaddress
import json
import os
import secrets
import socket
import ssl
import stat
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeGuard
from urllib.parse import urlsplit

from ..errors import CaptureError, os_reason
from .tap import PortError
from .wire import WireError, json_object

VERSION: Final = 2
PORT: Final = 9616  # unless another is named
SCHEMES: Final = ("tap", "taps")  # taps: with TLS
TOKEN_LEAST: Final = 16  # characters: the proof can be tried against guesses by whoever overhears it
HELLO_S: Final = 5.0  # for what is said before
_LINE: Final = 4096  # bytes of a line that is said before
_NONCE: Final = 16  # bytes, at the least


class NoHelloError(WireError):
    """The other side ended before it said anything whole."""


class TapSetupError(CaptureError):
    """A token, certificate or address that cannot be used, in one line."""


@dataclass(frozen=True, slots=True)
class TapAddress:
    """Where a tap is to be found."""

    url: str
    host: str
    port: int
    tls: bool

    @classmethod
    def of(cls, url: str) -> TapAddress:
        """PortError where it is none."""
        try:
            parts = urlsplit(url)
            host, port = parts.hostname, parts.port or PORT
            plain = parts.scheme in SCHEMES and parts.username is None and not (parts.query or parts.fragment)
        except ValueError:
            host, port, plain = None, 0, False
        if not host or not plain or parts.path not in ("", "/"):
            raise PortError(f"{url}: not a tap address: expected tap://HOST[:{PORT}], or taps:// with TLS")
        return cls(url, host, port, parts.scheme == "taps")


def is_tap_url(url: str) -> bool:
    """Whether this names a tap elsewhere, and not a port."""
    return url.partition("://")[0].lower() in SCHEMES and "://" in url


def read_token(file: str) -> str:
    """The secret in a file, which both ends have; TapSetupError."""
    try:
        with Path(file).open("rb") as stream:
            refuse_public(file, os.fstat(stream.fileno()))
            token = stream.read().decode("utf-8").strip()
    except (OSError, UnicodeError) as error:
        reason = os_reason(error) if isinstance(error, OSError) else "not UTF-8"
        raise TapSetupError(f"{file}: cannot be read: {reason}") from error
    return checked_token(token, file)


def refuse_public(file: str, about: os.stat_result) -> None:
    """TapSetupError for a secret that others on this machine may read; another owner's group may, as ssh has it."""
    if os.name != "posix":
        return
    others = 0o077 if about.st_uid == os.getuid() else 0o007
    if stat.S_ISREG(about.st_mode) and about.st_mode & others:
        mode = stat.S_IMODE(about.st_mode)
        raise TapSetupError(f"{file}: others can read it (mode {mode:04o}), so it is not secret: chmod 600 {file}")


def checked_token(token: str, where: str) -> str:
    """The token, if it is hard to guess; TapSetupError."""
    if len(token) < TOKEN_LEAST:
        raise TapSetupError(
            f"{where}: a token needs at least {TOKEN_LEAST} characters: create one with `openssl rand -hex 16`"
        )
    return token


@dataclass(frozen=True, slots=True)
class Proving:
    """What both sides of one connection prove: that they know the token, each by the nonces of both."""

    token: str | None
    tap_nonce: str
    viewer_nonce: str

    def proof(self, side: Literal["tap", "viewer"], session: str) -> str:
        """That this side, which names this session, has the token."""
        words = json.dumps(["rtuscope tap", VERSION, side, self.tap_nonce, self.viewer_nonce, session])
        return hmac.new((self.token or "").encode(), words.encode(), "sha256").hexdigest()

    def proved(self, shown: object, side: Literal["tap", "viewer"], session: str) -> bool:
        """Whether what that side has shown is its proof."""
        right = self.proof(side, session).encode()
        return isinstance(shown, str) and hmac.compare_digest(shown.encode(errors="replace"), right)


def new_nonce() -> str:
    """A nonce, for one connection."""
    return secrets.token_hex(_NONCE)


def is_nonce(value: object) -> TypeGuard[str]:
    """Whether a proof may be made of this."""
    return isinstance(value, str) and 2 * _NONCE <= len(value) <= 256


def is_local(host: str) -> bool:
    """Whether only programs of this machine reach this address."""
    try:
        found = {info[4][0] for info in socket.getaddrinfo(host, None)} if host else set()
    except (OSError, UnicodeError):
        return False
    return bool(found) and all(ipaddress.ip_address(str(each).partition("%")[0]).is_loopback for each in found)


def serving_context(certificate: str, key: str | None) -> ssl.SSLContext:
    """TLS of a tap; TapSetupError."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise TapSetupError(f"{certificate}: not a PEM certificate with its key: {_tls_words(error)}") from error
    return context


def viewing_context(authority: str | None) -> ssl.SSLContext:
    """TLS of a viewer. `authority`: a certificate that is trusted in place of the system's; TapSetupError."""
    try:
        return ssl.create_default_context(cafile=authority)
    except (OSError, ssl.SSLError) as error:
        raise TapSetupError(f"{authority}: not a PEM certificate: {_tls_words(error)}") from error


def _tls_words(error: OSError) -> str:
    return os_reason(error).partition(" (_ssl.c")[0].partition("] ")[2] or os_reason(error)


def send_line(connection: socket.socket, words: dict[str, Any]) -> None:
    """A line of JSON."""
    connection.sendall(json.dumps(words).encode() + b"\n")


def hear(connection: socket.socket) -> tuple[dict[str, Any], bytes]:
    """A line of JSON within HELLO_S, and what came behind it; WireError, TimeoutError."""
    data, until = b"", time.monotonic() + HELLO_S
    while b"\n" not in data:
        left = until - time.monotonic()
        if left <= 0:
            raise TimeoutError("timed out")
        connection.settimeout(left)
        more = connection.recv(_LINE)
        data += more
        if not more or len(data) > _LINE + len(more):
            if not more:
                raise NoHelloError("it closed before identifying itself")
            raise WireError("its first line never ends")
    line, _, rest = data.partition(b"\n")
    return json_object(line), rest
