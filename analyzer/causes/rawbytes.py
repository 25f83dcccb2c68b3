"""What the bytes of one answer can be: a known request, an answer in Modbus ASCII, bytes sent by other settings.

In ASCII the same knowledge as in RTU has other clothes: a colon, two digits a byte, an LRC, CR and LF. What is known of
an answer from its request is known digit by digit; the LRC tells whether the rest is whole when the first digits are
put right.

What a receiver makes of bytes that were sent by other settings is no chance: the same bytes give the same garbage. As
the first bytes of an answer are known from its request, settings of a sender can be tried until they give the bytes
that were heard.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log2
from typing import Final

from captures.line import LineSettings
from dissectors.crc import crc16, lrc
from dissectors.lengths import Role, pdu_length
from dissectors.limits import OVERHEAD

_HEAD: Final = 3  # bytes
ENDING: Final = 3  # bytes by which a damaged request is known again
_INSIDE: Final = 4  # and within other bytes
_MOST_REQUESTS: Final = 256
LOW_ONCE: Final = frozenset(0xFF << low & 0xFF for low in range(9))  # a line that is low once, from the start bit on
_LOW: Final = 0x00  # all the way: the one of those that is often sent as well


@dataclass(frozen=True, slots=True)
class KnownRequests:
    """Requests of a bus, by their last bytes and their first ones."""

    endings: frozenset[bytes] = frozenset()
    heads: frozenset[bytes] = frozenset()
    within: tuple[bytes, ...] = ()

    @classmethod
    def of(cls, requests: Sequence[bytes]) -> KnownRequests:
        """A request of each poll."""
        endings = frozenset(request[-ENDING:] for request in requests)
        heads = frozenset(request[:_HEAD] for request in requests)
        return cls(endings, heads, tuple({request[-_INSIDE:] for request in requests[:_MOST_REQUESTS]}))

    def end(self, data: bytes) -> bool:
        """Whether these bytes end like one of them."""
        return data[-ENDING:] in self.endings

    def begin(self, data: bytes, unit: int) -> bool:
        """Whether these bytes begin like one of them to another unit than this one."""
        return data[:_HEAD] in self.heads and data[0] != unit

    def asks_and_gets(self, data: bytes) -> bool:
        """Whether these bytes are one of them and its answer, both whole: what a tap held up and handed over in pieces."""
        length = pdu_length(data[1:], Role.REQUEST) or 0
        request, answer = data[: length + OVERHEAD], data[length + OVERHEAD :]
        return (
            data[:_HEAD] in self.heads
            and length > 0
            and crc16(request) == 0
            and crc16(answer) == 0
            and answer[:2] == data[:2]
        )

    def are_in(self, data: bytes, but: bytes = b"") -> bool:
        """Whether one of them ends within these bytes or at their end; `but`: one that may."""
        own = but[-ENDING:]
        return (self.end(data) and data[-ENDING:] != own) or any(
            ending in data for ending in self.within if ending != but[-_INSIDE:]
        )


COLON: Final = b":"
_END: Final = b"\r\n"
_WRITTEN: Final = re.compile(rb":[0-9A-Fa-f]+\r?\n?")
_HEAD_MOST: Final = 12  # characters that may be put right
_LRC_DIGITS: Final = 2


def is_of_line(heard: bytes) -> bool:
    """Whether these bytes are what a line makes that nobody drives: all are low once, or half of them, zeros not counted."""
    once = sum(byte in LOW_ONCE for byte in heard)
    return once == len(heard) or 2 * (once - heard.count(_LOW)) >= len(heard)


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
    count, begins = len(data), known.startswith(data[: len(known)])
    if not header or due < len(known):
        return "whole", count, 0
    if _right(data):
        return ("none" if begins and count == due else "other"), 0, 0
    for lost in range(max(1, due - count), min(len(known), _HEAD_MOST, due - 5) + 1):
        if _right(known[:lost] + data[count - due + lost :]):
            return "head", lost, 0
    if begins and (ending := _cut_tail(data, due)) is not None:
        return "tail", ending, due - ending
    if COLON in data[1:]:
        return "crossed", 1, 0
    if begins and count != due:
        return ("cut", due - count, count) if count < due else ("long", count - due, due)
    if count == due and data[:1] == COLON and data.endswith(_END):
        return "middle", 1, alike(known, data)
    if not begins and data.endswith(_END) and count > due // 2:
        return "head", max(due - count, 1), 0
    return "middle" if begins else "whole", count, 0


def alike(one: bytes, two: bytes) -> int:
    """How many bytes both begin with."""
    return next((i for i, (a, b) in enumerate(zip(one, two, strict=False)) if a != b), min(len(one), len(two)))


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
    body = due - _LRC_DIGITS - len(_END)
    octets = _octets(data[1:body])
    if octets is None or len(data) < body:
        return None
    end = f"{lrc(octets):02X}".encode() + _END
    same = alike(end, data[body:])
    return len(end) - same if same else None


_BAUDS: Final = (1200, 2400, 4800, 9600, 14400, 19200, 28800, 38400, 57600, 115200, 230400)
_FARTHEST: Final = 16.0  # times faster or slower
_FORMATS: Final = ((8, "N", 1), (8, "N", 2), (8, "E", 1), (8, "O", 1), (7, "E", 1), (7, "O", 1), (7, "N", 2))
_DRIFTS: Final = (0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12)
_MANY: Final = 1 << 9  # frames that may have been sent: so many say little, one of them being right
_CHECKED: Final = 16.0
_SAMPLE: Final = 0.5  # of a bit, where a receiver looks at it
_BETWEEN: Final = (0.47, 0.53)  # the same, where that is just between two bits of a sender that is a multiple as fast


@dataclass(frozen=True, slots=True)
class CharacterFormat:
    """How bytes are sent: bit/s, data bits, parity, stop bits."""

    baud: float
    data_bits: int = 8
    parity: str = "N"
    stop_bits: int = 1

    def bits(self, byte: int) -> list[int]:
        """The levels of one character, the line's rest being 1."""
        data = [byte >> i & 1 for i in range(self.data_bits)]
        parity = [] if self.parity == "N" else [(sum(data) + (self.parity == "O")) & 1]
        return [0, *data, *parity, *[1] * self.stop_bits]

    @property
    def words(self) -> str:
        """As people write it: `19200 8E1`."""
        return f"{self.baud:g} {self.data_bits}{self.parity}{self.stop_bits}"


def formats_of(line: LineSettings) -> tuple[CharacterFormat, ...]:
    """The formats that a receiver with these settings may have."""
    if not line.baud:
        return ()
    if line.parity in ("N", "E", "O"):
        stop_bits = int(line.stop_bits or 1)
        of_seven = line.char_bits == 1 + 7 + (line.parity != "N") + stop_bits  # as ASCII mode has them
        return (CharacterFormat(line.baud, 7 if of_seven else 8, line.parity, stop_bits),)
    if line.char_bits == 10:
        return (CharacterFormat(line.baud, 8, "N", 1), CharacterFormat(line.baud, 7, "E", 1))
    return *(CharacterFormat(line.baud, 8, parity, 1) for parity in "EO"), CharacterFormat(line.baud, 8, "N", 2)


def other_formats(line: CharacterFormat) -> Iterator[tuple[CharacterFormat, float]]:
    """Formats that a sender may have by mistake, and by how much its clock is off."""
    for baud in _BAUDS:
        if 1 / _FARTHEST <= baud / line.baud <= _FARTHEST:
            for data_bits, parity, stop_bits in _FORMATS:
                yield CharacterFormat(baud, data_bits, parity, stop_bits), 0.0
    for drift in _DRIFTS:
        for sign in (1, -1):
            yield (
                CharacterFormat(line.baud * (1 + sign * drift), line.data_bits, line.parity, line.stop_bits),
                sign * drift,
            )


@lru_cache(maxsize=1 << 14)
def misread(data: bytes, sender: CharacterFormat, receiver: CharacterFormat, sample: float = _SAMPLE) -> bytes:
    """What the receiver makes of the beginning of these bytes: as much as hangs on them alone."""
    return _received(_levels(data, sender), sender.baud / receiver.baud, receiver, sample)


@lru_cache(maxsize=1 << 10)
def _levels(data: bytes, sender: CharacterFormat) -> bytes:
    return bytes(bit for byte in data for bit in sender.bits(byte))


def samples(sender: CharacterFormat, receiver: CharacterFormat) -> tuple[float, ...]:
    """Where in a bit the receiver may look, as far as it makes a difference."""
    return _BETWEEN if sender.baud > 1.5 * receiver.baud else (_SAMPLE,)


@lru_cache(maxsize=1 << 14)
def beheaded(data: bytes, lost_bits: int, receiver: CharacterFormat) -> bytes:
    """What a receiver makes of the beginning of these bytes, whose sender drives the line so many bits too late."""
    levels = _levels(data, receiver)[lost_bits:]
    return _received(b"\1" * lost_bits + levels, 1.0, receiver) if levels else b""


def _received(levels: bytes, ratio: float, receiver: CharacterFormat, sample: float = _SAMPLE) -> bytes:
    """The bytes of levels, one a bit of their sender, `ratio` of which last as long as a bit of the receiver."""
    line, found, at = b"\1" + levels + b"\1", bytearray(), 0.0  # it rests before and behind
    while (start := line.find(b"\1\0", ceil(at))) >= 0:
        at = start + (receiver.data_bits + (receiver.parity != "N") + 1 + sample) * ratio
        if at >= len(levels):
            break
        value = 0
        for i in range(receiver.data_bits):
            value |= levels[int(start + (i + 1 + sample) * ratio)] << i
        found.append(value)
        if not levels[int(at)]:  # out of step: it waits for the line to rest
            at = line.find(b"\1", int(at) + 1) - 1
    return bytes(found)


def drifts(receiver: CharacterFormat) -> Iterator[tuple[CharacterFormat, float]]:
    """The receiver's own format by a clock that is off."""
    return ((sender, drift) for sender, drift in other_formats(receiver) if drift)


@lru_cache(maxsize=256)
def _sources(sender: CharacterFormat, receiver: CharacterFormat) -> tuple[tuple[int, ...], ...]:
    """The bytes that may have been sent for each byte received, behind which the line rests or goes on."""
    found: list[list[int]] = [[] for _ in range(256)]
    for byte in range(256):
        for heard in misread(bytes((byte, 0xFF)), sender, receiver)[:1]:
            found[heard].append(byte)
    return tuple(map(tuple, found))


def whole_by_another_clock(heard: bytes, header: bytes, sender: CharacterFormat, receiver: CharacterFormat) -> float:
    """Bits for a frame whose check value is right, had it been sent so, with this header: less for each byte that may
    have been several; 0 where it is not."""
    sources = _sources(sender, receiver)
    residues = {crc16(heard)}
    for at, byte in enumerate(heard):
        behind = bytes(len(heard) - at - 1)
        may_be = [sent for sent in sources[byte] if at >= len(header) or sent == header[at]]
        steps = [crc16(bytes((byte ^ sent,)) + behind, 0) for sent in may_be]
        residues = {residue ^ step for residue in residues for step in steps}
        if not residues or len(residues) > _MANY:
            return 0.0
    return _CHECKED - log2(len(residues)) if 0 in residues else 0.0
