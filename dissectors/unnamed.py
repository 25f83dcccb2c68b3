"""Bytes that are frames of nothing known: whether they are those of a protocol that nobody has described, and whether a
frame of Modbus among them is chance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Final, NamedTuple

from .crc import ALGORITHMS, Algorithm
from .limits import CRC_SIZE

CHANCE: Final = 1 << 12  # bytes in which one frame of a predicted length may be chance
_SEVERAL_FRAMES: Final = 128  # bytes in no frame, among which a frame is none
_MOSTLY: Final = 0.5
_PIECES: Final = 8  # of a line that tell a protocol of its own,
_LENGTHS: Final = 3  # and different lengths among them
_MARKS: Final = 3  # the commonest bytes, any of which may begin frames
_CUT: Final = 4  # of all bytes one in so many at most may be a frame that is cut
_RECORDS: Final = range(4, 65)  # bytes of a record
_DMX_BAUD: Final = 250_000  # bit/s (ANSI E1.11)
_NEARLY_ALL: Final = 0.9
_PLACES, _MORE = range(7), range(-1, 13)  # where a frame says its length, and what that leaves out
_CRCS: Final = tuple(
    {(one.polynomial, one.reflected): one for one in ALGORITHMS if isinstance(one, Algorithm)}.values()
)


class TrafficSoFar(NamedTuple):
    """What was heard: frames of predicted lengths, bytes, and how many of these are in frames."""

    legal: int
    octets: int
    framed: int

    def is_chance(self, size: int, kin: int) -> bool:
        """Whether a frame that nothing but its check value shows is chance, as now and then among bytes of anything.

        It is one of those heard, of so many bytes. `kin`: how many more of its unit and function are right, of which
        chance may give one: bytes of anything repeat themselves.
        """
        loose = self.octets - (self.framed - size)
        chances = self.octets // CHANCE
        may_be = self.legal <= chances and kin <= chances + 1
        return may_be and loose > max(_SEVERAL_FRAMES, _MOSTLY * self.octets)


def is_of_its_own(pieces: Sequence[bytes], baud: int | None) -> bool:
    """Whether pieces of a line are frames of some protocol that nobody knows.

    Each begins with the same byte and says how long it is, in one place; or they are of one length, and a check value
    closes each; or the line, at `baud` bit/s, is as fast as DMX512 alone is, and begins as its packets do. What a UART
    makes that is set wrongly does none of it. Frames may begin anywhere in a piece.
    """
    if baud == _DMX_BAUD and pieces and pieces[0][:1] == b"\0":
        return True
    marks = {piece[0] for piece in pieces} | {octet for octet, _ in Counter(b"".join(pieces)).most_common(_MARKS)}
    if any(_says_lengths(pieces, bytes((mark,)), at, more) for mark in marks for at in _PLACES for more in _MORE):
        return True
    return any(_are_closed(piece) for piece in pieces)


def _says_lengths(pieces: Sequence[bytes], mark: bytes, place: int, more: int) -> bool:
    """Whether the byte at a place behind a mark is the length of a frame, less so many bytes, frames end to end."""
    lengths: list[int] = []
    covered = over = 0
    for piece in pieces:
        at = piece.find(mark)
        while 0 <= at < len(piece) - place:
            size = piece[at + place] + more
            if size > len(piece) - at:  # cut, or none
                over += len(piece) - at
                break
            if size > place and piece[at + size : at + size + 1] in (mark, b""):
                lengths.append(size)
                covered, at = covered + size, at + size
            else:
                at = piece.find(mark, at + 1)
    several = len(lengths) >= _PIECES and len(set(lengths)) >= _LENGTHS
    total = sum(map(len, pieces))
    return several and covered >= _NEARLY_ALL * (total - min(over, total // _CUT))


def _are_closed(piece: bytes) -> bool:
    """Whether these bytes are records of one length, whichever it is, that a check value of their own closes."""
    alike = {size: sum(map(int.__eq__, piece, piece[size:])) for size in _RECORDS if _PIECES * size < len(piece)}
    size = max(alike, key=lambda one: (alike[one], -one), default=0)
    for phase in range(size):
        records = {piece[at : at + size] for at in range(phase, len(piece) - size + 1, size)}
        if len(records) >= _PIECES and _has_check_value(sorted(records)):
            return True
    return False


def _has_check_value(records: Sequence[bytes]) -> bool:
    """Whether different records of one length end in check values of one kind, whatever of a record it is over.

    Sums and parities of all bytes stay the same, whatever stands before them; of two records that differ by
    some bits, CRCs differ by the CRC of those bits alone.
    """
    first, *others = records
    sums: tuple[Callable[[bytes], int], ...] = (
        lambda record: sum(record) & 0xFF,
        lambda record: sum(record[:-1]) - record[-1] & 0xFF,
        lambda record: int.from_bytes(record[-1:]) ^ reduce(int.__xor__, record[:-1]),
    )
    if any(all(one(record) == one(first) for record in others) for one in sums):
        return True
    differences = [bytes(map(int.__xor__, record, first)) for record in others]
    nothing = bytes(len(first) - CRC_SIZE)
    for algorithm in _CRCS:
        base = algorithm(nothing)
        made = ((algorithm(each[:-CRC_SIZE]) ^ base, each[-CRC_SIZE:]) for each in differences)
        if all(crc in (int.from_bytes(sent, "big"), int.from_bytes(sent, "little")) for crc, sent in made):
            return True
    return False
