"""A tap's stream over a network: what its two ends say before, and how a viewer that comes back finds its place.

    tap     {"rtuscope_tap": 1, "nonce": HEX}                            a line of JSON
    viewer  {"proof": HEX, "session": ID or "", "next": N}               a line of JSON; its last word
    tap     {"session": ID}  or  {"refused": WHY}                        a line of JSON
    tap     a record POSITION, then records of `wire`, which are numbered from `next` of that POSITION on

POSITION (JSON) comes first, and again where a viewer was too slow for what is kept: `next` the number of the record
that follows, `heard` how many bytes of the line were in all records before it, `line` the line's settings as a
capture's header has them, or null while they are sought. Its time is that of the record before.

`proof` is HMAC-SHA256 of the nonce with the token, so the token itself never travels; the bytes of the line do, in the
open unless TLS is used.
"""

from __future__ import annotations

import hmac
import ipaddress
import json
import os
import socket
import ssl
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from ..errors import CaptureError, os_reason
from .tap import PortError
from .wire import WireError, json_object

VERSION: Final = 1
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
            raise PortError(f"{url}: not an address of a tap: tap://HOST[:{PORT}] is wanted, taps:// with TLS")
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
        raise TapSetupError(f"{file}: others may read it (mode {mode:04o}), so it is no secret: chmod 600 {file}")


def checked_token(token: str, where: str) -> str:
    """The token, if it is hard to guess; TapSetupError."""
    if len(token) < TOKEN_LEAST:
        raise TapSetupError(f"{where}: a token has {TOKEN_LEAST} characters or more: `openssl rand -hex 16` makes one")
    return token


def proof(token: str | None, nonce: str) -> str:
    """That one has the token."""
    return hmac.new((token or "").encode(), nonce.encode(), "sha256").hexdigest()


def is_nonce(value: object) -> bool:
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
        raise TapSetupError(f"{certificate}: no certificate with its key, in PEM: {_tls_words(error)}") from error
    return context


def viewing_context(authority: str | None) -> ssl.SSLContext:
    """TLS of a viewer. `authority`: a certificate that is trusted in place of the system's; TapSetupError."""
    try:
        return ssl.create_default_context(cafile=authority)
    except (OSError, ssl.SSLError) as error:
        raise TapSetupError(f"{authority}: no certificate in PEM: {_tls_words(error)}") from error


def _tls_words(error: OSError) -> str:
    return os_reason(error).partition(" (_ssl.c")[0].partition("] ")[2] or os_reason(error)


def say(connection: socket.socket, words: dict[str, Any]) -> None:
    """A line of JSON."""
    connection.sendall(json.dumps(words).encode() + b"\n")


def hear(connection: socket.socket) -> tuple[dict[str, Any], bytes]:
    """A line of JSON, and what came behind it; WireError."""
    data = b""
    while b"\n" not in data:
        more = connection.recv(_LINE)
        data += more
        if not more or len(data) > _LINE + len(more):
            if not more:
                raise NoHelloError("it ends before it said what it is")
            raise WireError("its first line does not end")
    line, _, rest = data.partition(b"\n")
    return json_object(line), rest
