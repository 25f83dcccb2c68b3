"""What stands around a PDU on the line: RTU's own, or Modbus ASCII's."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from dissectors.crc import crc_bytes, crc_ok, lrc


class WireEnvelope(NamedTuple):
    """How an RTU ADU is put on the line, and what is an RTU ADU again of bytes heard; b"" for what is none."""

    put: Callable[[bytes], bytes]
    take: Callable[[bytes], bytes]


def _to_ascii(adu: bytes) -> bytes:
    body = adu[:-2]
    if not crc_ok(adu):  # spoilt by its sender: so is the LRC
        return b":" + (body + bytes((lrc(body) ^ 0x5A,))).hex().upper().encode() + b"\r\n"
    return b":" + (body + bytes((lrc(body),))).hex().upper().encode() + b"\r\n"


def _from_ascii(data: bytes) -> bytes:
    start = data.rfind(b":")
    if start < 0 or not data.endswith(b"\r\n"):
        return b""
    try:
        body = bytes.fromhex(data[start + 1 : -2].decode("ascii"))
    except ValueError:
        return b""
    return body[:-1] + crc_bytes(body[:-1]) if len(body) > 2 and lrc(body[:-1]) == body[-1] else b""


RTU = WireEnvelope(lambda adu: adu, lambda data: data)
ASCII = WireEnvelope(_to_ascii, _from_ascii)
