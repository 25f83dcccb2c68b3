"""Hostile inputs: good ones, spoilt. The same seed gives the same bytes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random
from typing import Final

LARGEST: Final = 1 << 16  # bytes of an input
_LIMITS: Final = (
    LARGEST,
    4096,
    512,
)  # most inputs are small, as most of what goes wrong is; a few are as large as can be
_WEIGHTS: Final = (2, 10, 88)
_NUMBERS: Final = (
    0,
    1,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    1 << 31,
    (1 << 32) - 1,
    1 << 62,
    (1 << 63) - 1,
    (1 << 64) - 1,
)
_WORDS: Final = (
    b"",
    b"\0",
    b"\n",
    b"\r\n",
    b"\x1b]52;c;aGk=\x07",
    b"\x1b[2J",
    b"\xef\xbb\xbf",
    b"\xff\xfe",
    b"\xc3\x28",
    b"[red]",
    b"NaN",
    b"-1",
    b"1e999",
    b"Infinity",
    b"9" * 40,
    b"0" * 5000,
    b"\xe2\x80\xae",
    "Ⅻ".encode(),
    b"'",
    b'"',
    b"\\",
    b"{}",
    b"[" * 600,
)


def spoilt(chance: Random, seeds: Sequence[bytes], tokens: Sequence[bytes] = ()) -> bytes:
    """One of the seeds, changed a little or a lot; now and then nothing but noise.

    A seed's own length is always let stand.
    """
    if chance.random() < 0.02:
        return chance.randbytes(chance.choice((0, 1, 7, 100, 4000)))
    data = bytearray(chance.choice(seeds))
    limit = max(len(data), *chance.choices(_LIMITS, _WEIGHTS))
    for _ in range(chance.choice((1, 1, 1, 2, 3, 8, 30))):
        chance.choice(_CHANGES)(chance, data, seeds, tokens)
    return bytes(data[:limit])


def _place(chance: Random, data: bytearray) -> int:
    return chance.randrange(len(data) + 1)


def _flip(chance: Random, data: bytearray, *_: object) -> None:
    if data:
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def _noise(chance: Random, data: bytearray, *_: object) -> None:
    at = _place(chance, data)
    size = chance.choice((1, 4, 40, 512))
    data[at : at + size] = chance.randbytes(size)


def _cut(chance: Random, data: bytearray, *_: object) -> None:
    del data[_place(chance, data) :]


def _drop(chance: Random, data: bytearray, *_: object) -> None:
    at = _place(chance, data)
    del data[at : at + chance.choice((1, 2, 9, 60, 1000))]


def _double(chance: Random, data: bytearray, *_: object) -> None:
    at = _place(chance, data)
    piece = data[at : at + chance.choice((1, 5, 30, 200))]
    times = chance.choice((1, 1, 2, 50, LARGEST // max(1, len(piece))))
    data[at:at] = (piece * times)[:LARGEST]


def _word(chance: Random, data: bytearray, _: object, tokens: Sequence[bytes]) -> None:
    at = _place(chance, data)
    data[at : at + chance.choice((0, 0, 1, 4))] = chance.choice((*_WORDS, *tokens, *tokens))


def _number(chance: Random, data: bytearray, *_: object) -> None:
    at, size = _place(chance, data), chance.choice((1, 2, 4, 8))
    data[at : at + size] = (chance.choice(_NUMBERS) & ((1 << 8 * size) - 1)).to_bytes(
        size, chance.choice(("little", "big"))
    )


def _splice(chance: Random, data: bytearray, seeds: Sequence[bytes], _: object) -> None:
    other = chance.choice(seeds)
    begin = chance.randrange(len(other) + 1)
    at = _place(chance, data)
    data[at : at + chance.choice((0, 10, 1000))] = other[begin : begin + chance.choice((3, 30, 3000))]


_CHANGES: Final[tuple[Callable[..., None], ...]] = (_flip, _noise, _cut, _drop, _double, _word, _word, _number, _splice)
