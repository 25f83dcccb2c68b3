"""One request with the exception that answered it: the likely reason, and what to ask instead."""

from __future__ import annotations

from typing import Final, NamedTuple

from dissectors.crc import lrc

from .asked import READS, SWAPPED_WRITES, Request, request_of
from .corrections import Reason, corrected

_UNKNOWN: Final = 1  # exception codes ([1] 7)
_UNKNOWN_REASONS: Final = {  # why a function that is one of two for the same may be refused
    **dict.fromkeys(READS, "read-function"),
    **dict.fromkeys(SWAPPED_WRITES, "write-function"),
}
_ADDRESS_OR_VALUE: Final = (2, 3)


class Advice(NamedTuple):
    """The reason, and requests that the unit may answer; none where nothing is known that it has."""

    reason: Reason
    ask_instead: tuple[Request, ...]


def advice(unit: int, pdu: bytes, exception: int | None = None) -> Advice | None:
    """What the PDU of a request tells of why it fails; `exception`: the code that answered it, None where none did.
    None where the request may well be right."""
    asked = request_of(unit, pdu)
    if asked is None:
        return None
    reason = _reason(asked, exception)
    return None if reason is None else Advice(reason, tuple(corrected(reason, asked, ())))


def _reason(asked: Request, exception: int | None) -> Reason | None:
    if exception == _UNKNOWN:
        return asked.impossible or _UNKNOWN_REASONS.get(asked.function, "function")
    numbered = exception in _ADDRESS_OR_VALUE and asked.numbered is not None
    return asked.impossible or ("register-number" if numbered else None)


def enveloped(request: Request, protocol: str) -> str:
    """A request as it is sent, for people: RTU in hex, ASCII mode from its colon, Modbus TCP with its header."""
    body = bytes((request.unit,)) + request.pdu
    if protocol == "ascii":
        return f":{body.hex().upper()}{lrc(body):02X}"
    if protocol == "tcp":
        return (bytes(4) + len(body).to_bytes(2, "big") + body).hex(" ").upper()
    return request.adu.hex(" ").upper()
