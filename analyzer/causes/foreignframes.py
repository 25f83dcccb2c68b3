"""Frames of other protocols among the bytes in no frame, each protocol counted by what its frames show."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Final

import numpy as np

from dissectors.crc import crc_ok
from dissectors.foreign import IN_ANY_BYTES, LOOSE, NAMES, UNCHECKED

from ..deframing.rules import crc_windows
from .samples import READ_REQUEST

if TYPE_CHECKING:
    from .ledger import Ledger

_RTU: Final = "Modbus RTU"
_FOREIGN: Final = 0.005  # of all bytes
_FOREIGN_FRAMES: Final = 3
_FOREIGN_SURE: Final = 10  # rows marked so

_LENGTHS: Final = (7, 8, 9, 10, 11, 14, 22)  # bytes of a meter's frames
_SHORTEST: Final = _LENGTHS[0]
_MOSTLY: Final = 0.5
_SHARE: Final = 0.05  # of the bytes, at the least
_READS: Final = (1, 2, 3, 4)
_MODBUS: Final = (1, 2, 3, 4, 5, 6, 7, 8, 15, 16, 17, 22, 23, 43)


def _serial_number(data: bytes) -> int:
    """Meters with an address of four bytes, a command, and the CRC of Modbus: the same first four bytes, and it checks,
    of frames that differ: garbage that comes again and again checks as often as once."""
    heads: defaultdict[bytes, Counter[bytes]] = defaultdict(Counter)
    crc = crc_windows(np.frombuffer(data, np.uint8))
    for length in _LENGTHS:
        if length <= len(data):
            for at in np.flatnonzero(crc.heads[:-length] == crc.tails[length:]).tolist():
                frame = data[at : at + length]
                if any(frame[-2:]):  # FF FF and zeros check, as long as they last
                    heads[frame[:4]][frame] += 1
    counts = (found.total() for head, found in heads.items() if head[1] & 0x7F not in _MODBUS and len(found) > 1)
    return max((count for count in counts if count >= max(4, _SHARE * len(data) / _SHORTEST)), default=0)


def rtu_frames(stretches: Iterable[bytes]) -> int:
    """Right requests of Modbus RTU to read, where a line is in ASCII mode."""
    return sum(
        stretch[at + 1] in _READS and not any(stretch[at + 4 : at + 5]) and crc_ok(stretch[at : at + READ_REQUEST])
        for stretch in stretches
        for at in range(len(stretch) - READ_REQUEST + 1)
    )


_IN_WORDS: Final = "text, as modems and programs write it"
_WORD: Final = 4  # characters


def _lines_of_text(data: bytes) -> int:
    """Lines of text, as modems and programs that start write them, where most of it is text."""
    lines = [
        line for line in data.splitlines() if len(line) >= _WORD and line.isascii() and line.decode().isprintable()
    ]
    return len(lines) if sum(map(len, lines)) > _MOSTLY * len(data) else 0


def _counted(name: str) -> Callable[[bytes], int]:
    find = IN_ANY_BYTES[name]
    return lambda data: sum(1 for _ in find(data))


PROTOCOLS: Final[Mapping[str, Callable[[bytes], int]]] = {
    **{name: _counted(name) for name in IN_ANY_BYTES if name not in LOOSE},
    "a meter's own protocol with the CRC of Modbus": _serial_number,
    _IN_WORDS: _lines_of_text,
}


def foreign_frames(ledger: Ledger, *, in_ascii: bool) -> tuple[str, int]:
    """The protocol whose frames stand among the bytes of a ledger in no frame, and how many of those looked at; ("", 0).

    The one that rows are marked with comes first, so that the page and its causes name the same. What only characters
    tell is none on a line in ASCII mode (`in_ascii`), where nothing is marked so.
    """
    sure = int(ledger.foreign[1:].max())
    if ledger.noise_bytes <= _FOREIGN * ledger.bytes and sure < _FOREIGN_SURE:
        return "", 0  # so little may be anything
    data = b"".join(octets for _, _, octets in ledger.noise)
    characters = UNCHECKED if in_ascii else frozenset()
    if in_ascii or ledger.noise_bytes == ledger.bytes:
        characters |= {_IN_WORDS}  # there is nothing that text would be beside
    frames = Counter({name: count(data) for name, count in PROTOCOLS.items() if name not in characters})
    if in_ascii:
        frames[_RTU] = rtu_frames(octets for _, _, octets in ledger.noise)
    marked = NAMES[1 + int(ledger.foreign[1:].argmax())]
    frames[marked] = max(frames[marked], sure)
    several = {name: count for name, count in frames.items() if count >= _FOREIGN_FRAMES}
    name = marked if marked in several else max(several, key=several.__getitem__, default="")
    return name, several.get(name, 0)
