"""Where one answer is damaged, and how, read from its bytes.

The request says how the answer must begin (unit, function, byte count; all of an echo) and how long it is; a good
answer to the same poll says about what it holds. With so much known the check value can be asked what the bytes
themselves do not tell: whether the rest is whole when the first ones are put right, or only the last one is wrong.
"""

from __future__ import annotations

import builtins
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from itertools import takewhile
from typing import Final

from dissectors.crc import byte_between, crc16, crc_bytes, flipped_bit, matching, needed, registers
from dissectors.limits import EXCEPTION_ADU

_HEAD_MOST: Final = 12  # bytes that may be put right
LEAST: Final = 4
_LOST: Final = 2  # bytes of a head
_NO_CHECK: Final = bytes(2)
_HEAD: Final = 3  # bytes: of an answer the third is its byte count
_TAIL_BITS: Final = 2  # bits of a byte that must have come before its driver let go
_LOCAL: Final = 0.55  # share of bytes like those of a good answer: the damage is somewhere, not everywhere


class AnswerDamage(Enum):
    """What happened to an answer."""

    NONE = "none"
    HEAD = "head"  # the first bytes, the rest is whole
    TAIL = "tail"  # the last bytes
    CUT = "cut"  # it begins well and ends early
    BITS = "bits"  # one byte has flipped bits
    MIDDLE = "middle"  # it begins well, and some of it is wrong
    LONG = "long"  # it begins well, and is longer than it may be
    CONVENTION = "convention"  # whole, by another check value
    COUNT = "count"  # whole, but its byte count is wrong
    CROSSED = "crossed"  # the next request comes into it
    OTHER = "other"  # a right frame, and not the answer
    WHOLE = "whole"  # nothing of it is right


@dataclass(frozen=True, slots=True)
class DamageRead:
    """What happened, how many bytes are damaged or lost, the first of them (-1 unknown), its wrong bits, a name."""

    damage: AnswerDamage
    bytes: int = 0
    at: int = -1
    flips: tuple[int, ...] = ()
    detail: str = ""


@dataclass(frozen=True, slots=True)
class HeardAnswer:
    """The bytes of an answer and what is known of the right one: `due` bytes (0 unknown), `header` the first of them,
    `refused` those of a refusal, `usual` a good one (empty: none). `pieces` they came in; `other`: whether one of these is
    a right answer; `asked`: whether a request is in the bytes, but for one that is the right answer."""

    data: builtins.bytes
    due: int
    header: builtins.bytes
    refused: builtins.bytes
    usual: builtins.bytes
    pieces: int
    other: bool
    asked: Callable[[builtins.bytes], bool]

    @property
    def known(self) -> builtins.bytes:
        """The first bytes of the right answer, check value included where it is an echo."""
        return self.header + crc_bytes(self.header) if len(self.header) == self.due - 2 else self.header

    @property
    def begins(self) -> bool:
        """Whether it begins as it should."""
        return self.data.startswith(self.known[: min(len(self.data), _HEAD)])

    @property
    def right(self) -> bool:
        """Whether its check value is."""
        return crc16(self.data) == 0


def read_damage(heard: HeardAnswer) -> DamageRead:
    """The first reading that fits."""
    return next(found for read in _READINGS for found in read(heard))


_Reading = Iterator[DamageRead]


def _counted(heard: HeardAnswer) -> _Reading:
    """It is right but for its length."""
    if heard.right and len(heard.data) > LEAST and heard.data[:2] == heard.header[:2]:
        held_back = heard.pieces > 1 and len(heard.data) == heard.due
        yield DamageRead(AnswerDamage.NONE if held_back else AnswerDamage.COUNT, 1, 2)


def _another(heard: HeardAnswer) -> _Reading:
    if heard.other:
        yield DamageRead(AnswerDamage.OTHER, at=0)


def _refusal(heard: HeardAnswer) -> _Reading:
    if heard.right and len(heard.data) == EXCEPTION_ADU and heard.data.startswith(heard.refused):
        yield DamageRead(AnswerDamage.NONE)


def _of_unknown_length(heard: HeardAnswer) -> _Reading:
    """By its check value, if only its head is wrong."""
    if heard.due >= LEAST and len(heard.header) >= 2:
        return
    if heard.due < LEAST <= len(heard.header):
        for lost in range(_LOST + 1):
            yield from _of_length(heard, len(heard.data) + lost, heard.header)
    yield DamageRead(AnswerDamage.WHOLE, len(heard.data), 0)


def _of_known_length(heard: HeardAnswer) -> _Reading:
    yield from _of_length(heard, heard.due, heard.known)
    yield from _of_length(heard, EXCEPTION_ADU, heard.refused)


def _crossed(heard: HeardAnswer) -> _Reading:
    if heard.asked(heard.known):
        yield DamageRead(AnswerDamage.CROSSED, 1, 0)


def _ends_otherwise(heard: HeardAnswer) -> _Reading:
    """It begins well and is shorter or longer than is due."""
    more = len(heard.data) - heard.due
    if heard.begins and more == -1:
        yield DamageRead(AnswerDamage.MIDDLE, 1, _HEAD)  # the check value is there, so it is lost inside
    elif heard.begins and more < 0:
        yield DamageRead(AnswerDamage.CUT, -more, len(heard.data))
    elif heard.begins and more > 2:
        yield DamageRead(AnswerDamage.LONG, more, heard.due)


def _of_length(heard: HeardAnswer, due: int, head: builtins.bytes) -> _Reading:
    """What is right but for its head, its tail, its convention or one bit, if it should have had this length."""
    data, count = heard.data, len(heard.data)
    if count == due and heard.right:
        return  # whole, and something else: a request in two pieces, say
    if count == due and data.startswith(head[:_HEAD]):
        names = [variant.name for variant in matching(data)][:1]
        names += [_NO_CHECK.hex(" ")] if data[-2:] == _NO_CHECK else []
        yield from (DamageRead(AnswerDamage.CONVENTION, 2, due - 2, (), name) for name in names)
    known = head + (heard.usual[len(head) : max(due - 2, 0)] if len(heard.usual) == due else b"")
    for wrong in range(1, min(len(known), _HEAD_MOST, due - 3) + 1):
        rest = due - wrong
        if count >= rest and crc16(known[:wrong] + data[count - rest :]) == 0:
            whole = DamageRead(AnswerDamage.HEAD, wrong, 0)
            yield _headless(data, known[:wrong]) if count == due else whole
    if data.startswith(head[: min(_HEAD, due - 2)]) and count >= due - 1:
        yield from _tail(data, due)


def _headless(data: builtins.bytes, head: builtins.bytes) -> DamageRead:
    """What is wrong with the first bytes of an answer as long as is due: damage at its head begins with its first byte."""
    at, *more = (i for i, (one, two) in enumerate(zip(head, data, strict=False)) if one != two)
    flips = () if more else _bits(data[at] ^ head[at])
    if not at:
        return DamageRead(AnswerDamage.HEAD, len(head), 0, flips if len(head) == 1 else ())
    return DamageRead(AnswerDamage.BITS if flips else AnswerDamage.MIDDLE, 1 + len(more), at, flips)


def _tail(data: builtins.bytes, due: int) -> _Reading:
    """The check value's bytes lost or with high bits set, all before them right."""
    check, rest = crc_bytes(data[: due - 2]), data[due - 2 :]
    right = [one == two for one, two in zip(rest, check, strict=False)]
    let_go = [_let_go(one, two) for one, two in zip(rest, check, strict=False)]
    if right[0] and right[1:] != [True] and all(let_go[1:]):
        yield DamageRead(AnswerDamage.TAIL, 1, due - 1)
    elif not right[0] and let_go[0] and rest[1:2] in (b"", b"\xff"):
        yield DamageRead(AnswerDamage.TAIL, 2, due - 2)


def _let_go(byte: int, sent: int) -> bool:
    """Whether a byte is what is left when its driver lets go: some low bits as sent, then ones."""
    masks = (0, *((1 << count) - 1 for count in range(_TAIL_BITS, 8)))
    return any(byte == (sent & mask) | (0xFF & ~mask) for mask in masks)


def _flipped(heard: HeardAnswer) -> _Reading:
    data, due = heard.data, heard.due
    if len(data) != due:
        return
    if (bit := flipped_bit(crc16(data), due)) is not None:
        yield DamageRead(AnswerDamage.BITS, 1, bit[0], (bit[1],))
    before, after = registers(data), needed(data)
    fits = [(i, byte) for i in range(due) if (byte := byte_between(before[i], after[i + 1])) is not None]
    short = [(i, _bits(byte ^ data[i])) for i, byte in fits]
    runs = [(i, bits) for i, bits in short if bits and bits[-1] - bits[0] < len(bits) + 1]
    if len(runs) == 1:
        yield DamageRead(AnswerDamage.BITS, 1, *runs[0])


def _bits(pattern: int) -> tuple[int, ...]:
    return tuple(i for i in range(8) if pattern >> i & 1)


def _without_example(heard: HeardAnswer) -> _Reading:
    if heard.usual and len(heard.usual) == heard.due:
        return
    if heard.begins:
        yield DamageRead(AnswerDamage.MIDDLE, 1, _HEAD)
    wrong = (i for i, (one, two) in enumerate(zip(heard.header, heard.data, strict=False)) if one != two)
    yield DamageRead(AnswerDamage.WHOLE, len(heard.data), next(wrong, 0))


def _like_usual(heard: HeardAnswer) -> _Reading:
    """How much of it is as in a good answer, from its beginning and from its end."""
    usual, data = heard.usual, heard.data
    body = usual[:-2]
    ahead = [one == two for one, two in zip(body, data, strict=False)]
    aback = [one == two for one, two in zip(reversed(body), reversed(data[:-2]), strict=False)]
    if max(sum(ahead), sum(aback)) / max(len(body), 1) < _LOCAL:
        yield DamageRead(AnswerDamage.WHOLE, len(data), 0)
    elif sum(aback) > sum(ahead) and not heard.begins:
        if not all(aback[: len(aback) // 2]):
            yield DamageRead(AnswerDamage.MIDDLE, 1, 0)
        yield DamageRead(AnswerDamage.HEAD, max(1, len(aback) - len(list(takewhile(bool, aback))) % len(aback)), 0)
    wrong = [i for i, same in enumerate(ahead) if not same]
    at = [*wrong, len(body)][0]
    flips = _bits(usual[at] ^ data[at]) if len(wrong) == 1 and at < min(len(data), _HEAD) else ()
    yield DamageRead(AnswerDamage.MIDDLE, max(len(wrong), 1), at, flips)


_READINGS: Final[tuple[Callable[[HeardAnswer], _Reading], ...]] = (
    *(_counted, _another, _refusal, _of_unknown_length, _of_known_length, _crossed, _ends_otherwise, _flipped),
    *(_without_example, _like_usual),
)
