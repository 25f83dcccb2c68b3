"""Bytes as text to paste elsewhere: a way is an entry here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple


class Way(NamedTuple):
    """A way to write bytes: its key in the menu, what it is, and how."""

    key: str
    name: str
    write: Callable[[bytes], str]


def _c_array(data: bytes) -> str:
    return f"const uint8_t frame[{len(data)}] = {{ {', '.join(f'0x{octet:02X}' for octet in data)} }};"


WAYS: Final = (
    Way("h", "hex: 11 03 00 6B", lambda data: data.hex(" ").upper()),
    Way("c", "C array: { 0x11, 0x03 }", _c_array),
    Way("p", 'Python: bytes.fromhex("1103006b")', lambda data: f'bytes.fromhex("{data.hex()}")'),
    Way("r", "command: rtuscope parse 11 03", lambda data: f"rtuscope parse {data.hex(' ').upper()}"),
)
