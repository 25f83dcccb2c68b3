"""usbmon's text, as `cat /sys/kernel/debug/usb/usbmon/1u` prints it, put back into a pcap of USB packets.

Its words are those of Documentation/usb/usbmon.rst: tag, time in us, event, address, status or setup, length, data. The
kernel prints at most 32 bytes of a transfer: how many are missing stands in the packet's length.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import BinaryIO, Final

_USBMON: Final = 189  # the link type
_PCAP: Final = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 1 << 18, _USBMON)
_HEADER: Final = struct.Struct("<QBBBBHBBqiiII8s")
_KINDS: Final = {"Z": 0, "I": 1, "C": 2, "B": 3}
_WAYS: Final = {"i": 0x80, "o": 0}
_WRAP_US: Final = 1 << 32  # the time has 32 bits


def usbmon_packets(file: BinaryIO) -> Iterator[bytes]:
    """The packets of a text as a pcap; lines of another form are left out."""
    yield _PCAP
    newest = wraps = 0
    for line in file:
        with suppress(ValueError, LookupError, struct.error):
            tag, shown_us, *words = line.decode("ascii").split()
            us = int(shown_us)
            turns = wraps + (us < newest - _WRAP_US // 2)
            packet = _packet(int(tag, 16), words, us + turns * _WRAP_US)
            newest, wraps = us, turns
            yield packet


def _packet(tag: int, words: Sequence[str], us: int) -> bytes:
    """A line from its event on: `S Bo:1:007:2 -115 8 = 01030064 00068417`."""
    event, address, *rest = words
    kind, *bus, device, end = address.split(":")
    asked = rest[0] == "s"
    asks, rest = (rest[1:6], rest[6:]) if asked else ([], rest[1:])
    # bmRequestType and bRequest are bytes; the three others are printed as numbers, and sent low byte first
    setup = [int(word, 16).to_bytes(1 + (i > 1), "little") for i, word in enumerate(asks)]
    length, shown = int(rest[0]), rest[1:2] == ["="]
    data = bytes.fromhex("".join(rest[2:])) if shown else b""
    head = _HEADER.pack(
        tag, ord(event), _KINDS[kind[0]], int(end) | _WAYS[kind[1]], int(device), int(bus[0] if bus else 0),
        0 if asked else ord("-"), 0 if shown else ord("<"), *divmod(us, 10**6),
        0 if asked else int(words[2].partition(":")[0]), length, len(data), b"".join(setup),
    )  # fmt: skip
    size = len(head) + len(data)
    whole = len(head) + length if shown else size  # else it is what was asked for
    return struct.pack("<IIII", *divmod(us, 10**6), size, max(size, whole)) + head + data
