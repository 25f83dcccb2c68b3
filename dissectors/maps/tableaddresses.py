"""Addresses as manuals print them: 40001-40002, 0x10, 001Fh, 1A, 4x108, 1 000, 40012.3."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

_BARE_HEX: Final = re.compile(r"[0-9A-Fa-f]{1,4}([hH])?")
_NUMBER: Final = re.compile(
    r"0[xX][0-9A-Fa-f]+|[0134][xX]\d+|\b[0-9][0-9A-Fa-f]*[hH]\b|\b[A-Fa-f][0-9A-Fa-f]*[hH]\b|\d+"
)
_BIT: Final = re.compile(r"(?P<place>.*[0-9A-Fa-f][hH]?)\s*[.:]\s*(?:bit\s*)?(?P<bit>\d|0\d|1[0-5])", re.IGNORECASE)
_AREA_APART: Final = re.compile(r"([0134]) (?=\d{4,5}(?!\d))")  # 4 0001
_THOUSANDS: Final = re.compile("(?<=\\d)[ \u00a0\u202f'](?=\\d{3}(?!\\d))")


@dataclass(frozen=True, slots=True)
class AddressForm:
    """How a column of addresses is written: hexadecimal without a mark, which its heading may say; with bits behind a
    point; all as logical numbers (00001, 10001, 30001, 40001)."""

    is_hex: bool = False
    is_said: bool = False
    has_bits: bool = False
    is_logical: bool = False


@dataclass(frozen=True, slots=True)
class TableAddress:
    """`first` and, of a range, `last`; `text` the first as it is read elsewhere; `prefixed` one such as 4x108."""

    text: str
    first: int
    last: int | None = None
    bit: int | None = None
    prefixed: bool = False


def address_form(heading: str, cells: Sequence[str]) -> AddressForm:
    """The form of a column: by its heading, and by what all of its cells are."""
    cells = [cell for cell in map(together, cells) if cell]
    word = heading.lower()
    declared = re.search(r"hex|шестн|16-?ричн", word) is not None and not re.search(r"dec|дес", word)
    parts = [part for cell in cells for part in re.split(r"\s*(?:-|–|—|…|\.{2,3}|to)\s*", cell)]
    bare = [part for part in parts if _BARE_HEX.fullmatch(part)]
    letters = any(re.search("[A-Fa-f]", part.rstrip("hH")) and re.search(r"\d", part) for part in bare)
    letters = letters and len(bare) > 0.8 * len(parts)
    bits = [match for cell in cells if (match := _BIT.fullmatch(cell))]
    numbers = [part for part in parts if part.isdecimal()]
    logical = all(re.fullmatch(r"[0134]\d{4,5}", part) for part in numbers) and any(p[0] in "34" for p in numbers)
    has_bits = any(int(match["bit"]) for match in bits)
    return AddressForm(declared or letters, declared, has_bits, logical and not (declared or letters))


def address_of(cell: str, form: AddressForm) -> TableAddress | None:
    """The address in a cell; None where there is none."""
    cell, bit = together(cell), None
    if form.has_bits and (match := _BIT.fullmatch(cell)):
        cell, bit = match["place"], int(match["bit"])
    cell = re.sub(r"(?<=\d)\.0+$", "", cell)
    if form.is_hex:
        cell = re.sub(r"(?<![0-9A-Za-z])([0-9A-Fa-f]{1,4})[hH]?(?![0-9A-Za-z])", r"0x\1", cell)
    numbers = _NUMBER.findall(cell)
    if not numbers:
        return None
    values = [_whole(number) for number in numbers[:2]]
    prefixed = re.fullmatch(r"[134]x\d+", numbers[0], re.IGNORECASE) is not None
    last = values[1] if len(numbers) == 2 and values[1] >= values[0] else None
    return TableAddress(numbers[0].lower(), values[0], last, bit, prefixed)


def together(cell: str) -> str:
    """A cell whose numbers have no gaps at their thousands."""
    return _AREA_APART.sub(r"\1", _THOUSANDS.sub("", cell.strip()))


def _whole(text: str) -> int:
    if text[:2] in ("0x", "0X"):
        return int(text, 16)
    if text[-1] in "hH":
        return int(text[:-1], 16)
    return int(re.sub(r"^[0134][xX]", "", text))
