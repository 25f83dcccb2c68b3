"""What became of an answer in Modbus ASCII, read from its characters as `signatures` reads one in RTU.

The same knowledge, in other clothes: a colon, two digits a byte, an LRC, CR and LF. What is known of an answer from its
request is known digit by digit; the LRC tells whether the rest is whole when the first digits are put right.
"""

from __future__ import annotations

import re
from typing import Final

from dissectors.crc import lrc

COLON: Final = b":"
_END: Final = b"\r\n"
_WRITTEN: Final = re.compile(rb":[0-9A-Fa-f]+\r?\n?")
_HEAD_MOST: Final = 12  # characters that may be put right
_LRC_DIGITS: Final = 2


def is_in_ascii(request: bytes) -> bool:
    """Whether a request is in ASCII mode: a colon alone is unit 58 in RTU."""
    return _WRITTEN.fullmatch(bytes(byte & 0x7F for byte in request)) is not None


def ascii_due(due: int) -> int:
    """Characters of an answer whose RTU ADU has so many bytes."""
    return 2 * due + 1 if due else 0


def read_ascii(data: bytes, due: int, header: bytes) -> tuple[str, int, int]:
    """Kind of damage (a value of `Damage`), how many characters, and the first of them (-1 unknown).

    `due` characters were to come, which begin with the digits of `header`.
    """
    known = COLON + header.hex().upper().encode()
    if not header or due < len(known):
        return "whole", len(data), 0
    if _right(data):
        return ("none" if data.startswith(known) and len(data) == due else "other"), 0, 0
    for lost in range(1, min(len(known), _HEAD_MOST, due - 5) + 1):
        if len(data) >= due - lost and _right(known[:lost] + data[len(data) - due + lost :]):
            return "head", lost, 0
    begins = data.startswith(known) if len(data) >= len(known) else known.startswith(data)
    if begins and (ending := _cut_tail(data, due)) is not None:
        return "tail", ending, due - ending
    if COLON in data[1:]:
        return "crossed", 1, 0
    if begins and len(data) < due:
        return "cut", due - len(data), len(data)
    if begins and len(data) > due:
        return "long", len(data) - due, due
    if len(data) == due and data[:1] == COLON and data.endswith(_END):
        wrong = next((i for i, (one, two) in enumerate(zip(known, data, strict=False)) if one != two), len(known))
        return "middle", 1, wrong
    if not begins and data.endswith(_END) and len(data) > due // 2:
        return "head", max(due - len(data), 1), 0
    return "middle" if begins else "whole", len(data), 0


def _right(data: bytes) -> bool:
    """Whether this is a whole frame."""
    if data[:1] != COLON or not data.endswith(_END):
        return False
    octets = _octets(data[1 : -len(_END)])
    return octets is not None and len(octets) > 2 and lrc(octets[:-1]) == octets[-1]


def _octets(digits: bytes) -> bytes | None:
    try:
        return bytes.fromhex(digits.decode("ascii"))
    except ValueError:
        return None


def _cut_tail(data: bytes, due: int) -> int | None:
    """How many of the last characters (LRC, CR, LF) are lost or wrong, where all before them is right."""
    body = data[1 : due - _LRC_DIGITS - len(_END)]
    octets = _octets(body)
    if octets is None or len(data) < due - _LRC_DIGITS - len(_END):
        return None
    end = f"{lrc(octets):02X}".encode() + _END
    rest = data[1 + len(body) :]
    same = next(
        (i for i, (one, two) in enumerate(zip(end, rest, strict=False)) if one != two), min(len(end), len(rest))
    )
    return len(end) - same if same else None
