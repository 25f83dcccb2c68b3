"""Who may talk to a server of ours: what `open --web`, `--metrics` and `--foxglove` ask before they answer.

A browser on this machine, or on the network of the plant, can be made to ask any address by a page from elsewhere. It
always says for which page it asks (Origin) and by which name (Host): a page of another origin is refused, and a name
that a stranger can make point here.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Collection, Sequence
from string import ascii_lowercase, digits
from typing import Final
from urllib.parse import urlsplit

_LOOPBACK: Final = ("127.0.0.1", "localhost", "::1")
# Of a name without a dot: nobody registers one, it is of this network, or of containers.
_UNQUALIFIED: Final = frozenset(f"{ascii_lowercase}{digits}_-")
_OF_THE_WEB: Final = ("http", "https", "null", "")  # schemes of origins; others, as file, are of programs


def refusal(
    named: str, origins: Sequence[str], listening: str, *, also: Collection[str] = (), programs: bool = False
) -> str:
    """Why a request is refused that was made to the Host `named`, from pages of `origins`; empty where it is not.

    `listening`: the host that the server was told to listen at. `also`: other origins that are let in; `programs`:
    those that are no page of the web, as a desktop program's `file://`, too.
    """
    name = _name(named)
    if not name or not _goes_by(name, listening.lower()):
        return "this server does not go by that name"
    for origin in origins:
        program = programs and urlsplit(origin).scheme not in _OF_THE_WEB
        if origin != f"http://{named}" and origin not in also and not program:
            return "pages of other origins have no business here"
    return ""


def is_loopback(host: str) -> bool:
    """Whether only programs of this machine reach this address."""
    return host == "localhost" or (_is_address(host) and ipaddress.ip_address(host).is_loopback)


def is_any(host: str) -> bool:
    """Whether this stands for all addresses of the machine."""
    return _is_address(host) and ipaddress.ip_address(host).is_unspecified


def _name(host: str) -> str:
    """The name or address in a Host header, without its port; empty where a bracket is never closed."""
    if host.startswith("["):
        address, closed, _ = host[1:].partition("]")
        return address.lower() if closed else ""
    return host.rpartition(":")[0].lower() if host.count(":") == 1 else host.lower()


def _goes_by(name: str, listening: str) -> bool:
    """Whether a server that listens there goes by this name: an address says where a browser really went."""
    if is_loopback(listening):
        return name in _LOOPBACK or is_loopback(name)
    own = name in (listening, *_LOOPBACK, socket.gethostname().lower())
    return own or _is_address(name) or _UNQUALIFIED.issuperset(name or ".")


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
