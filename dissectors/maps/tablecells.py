"""What single cells of tables in manuals say: addresses, types and word orders.

Addresses as they are printed: 40001-40002, 0x10, 001Fh, 1A, 4x108, 1 000, 40012.3. Types and word orders as they are
named: `INT16U`, `unsigned 32 bits`, `UDINT`, `Float (CDAB)`, `целое со знаком`. A name is read by its parts, wherever
they stand in it: what is held, of how many bits, with a sign or without.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

_BARE_HEX: Final = re.compile(r"[0-9A-Fa-f]{1,4}([hH])?")
_NUMBER: Final = re.compile(
    r"0[xX][0-9A-Fa-f]+|[0134][xX]\d+|\b[0-9][0-9A-Fa-f]*[hH]\b|\b[A-Fa-f][0-9A-Fa-f]*[hH]\b|\d+"
)
_BIT: Final = re.compile(r"(?P<place>.*[0-9A-Fa-f][hH]?)\s*[.:]\s*(?:bit\s*)?(?P<bit>\d|0\d|1[0-5])", re.IGNORECASE)
_AREA_APART: Final = re.compile(r"([0134]) (?=\d{4,5}(?!\d))")  # 4 0001
_HEX_APART: Final = re.compile(r"(?<=\b[0-9A-Fa-f]{4}) (?=[hH]\b)")  # 07D0 H
_THOUSANDS: Final = re.compile("(?<=\\d)[ \u00a0\u202f'](?=\\d{3}(?!\\d))")


@dataclass(frozen=True, slots=True)
class AddressForm:
    """How a column of addresses is written: hexadecimal without a mark, which its heading may say; with bits behind a
    point; all as logical numbers (00001, 10001, 30001, 40001), or some as no logical number is (30000, 50001); some
    with the digit of their area before an x (4x0001), so that 0x0005 is a coil; all of five digits, 0 or 1 first."""

    is_hex: bool = False
    is_said: bool = False
    has_bits: bool = False
    is_logical: bool = False
    is_plain: bool = False
    has_prefixes: bool = False
    is_digital: bool = False


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
    declared = re.search(r"hex|шестн|16-?ричн|(?:十六|16)进制", word) is not None and not re.search(
        r"dec|дес|(?<!六)十进制", word
    )
    parts = [part for cell in cells for part in re.split(r"\s*(?:-|–|—|…|\.{2,3}|to|[,;/&])\s*", cell)]
    bare = [part for part in parts if _BARE_HEX.fullmatch(part)]
    letters = any(re.search("[A-Fa-f]", part.rstrip("hH")) and re.search(r"\d", part) for part in bare)
    letters = letters and len(bare) > 0.8 * len(parts)
    bits = [match for cell in cells if (match := _BIT.fullmatch(cell))]
    numbers = [part for part in parts if part.isdecimal()]
    logical = all(re.fullmatch(r"[0134]\d{4,5}", part) for part in numbers) and any(p[0] in "34" for p in numbers)
    has_bits = any(int(match["bit"]) for match in bits)
    plain = any(re.fullmatch(r"[34]0{4}|[256789]\d{4}", part) for part in numbers)
    prefixes = any(re.fullmatch(r"[134][xX]\d+", part) for part in parts)
    is_hex = declared or letters
    digital = bool(numbers) and all(re.fullmatch(r"[01](?!0000)\d{4}", part) for part in numbers) and not is_hex
    return AddressForm(is_hex, declared, has_bits, logical and not (is_hex or plain), plain, prefixes, digital)


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
    prefixed = re.fullmatch(rf"[{'0' * form.has_prefixes}134]x\d+", numbers[0], re.IGNORECASE) is not None
    last = values[1] if len(numbers) == 2 and values[1] >= values[0] else None
    return TableAddress(numbers[0].lower(), values[0], last, bit, prefixed)


def together(cell: str) -> str:
    """A cell whose numbers have no gaps at their thousands."""
    return _HEX_APART.sub("", _AREA_APART.sub(r"\1", _THOUSANDS.sub("", cell.strip())))


def _whole(text: str) -> int:
    if text[:2] in ("0x", "0X"):
        return int(text, 16)
    if text[-1] in "hH":
        return int(text[:-1], 16)
    return int(re.sub(r"^[0134][xX]", "", text))


_WIDTH: Final = re.compile(r"(?<![\d.])(8|16|24|32|48|64)(?!\d)[ -]?(?:bits?\b|бит\w*)?")
_PARTS: Final = re.compile(r"\b([24])\s*[x×*]\s*(?:u?int)?16(?!\d)|\b([1248])[ -]?(?:bytes?|octets?|байт\w*)\b")
_HELD: Final = (
    ("f64", r"double(?! word)|lreal|双精度"),
    (
        "f32",
        r"float|(?<![a-z])real|single|ieee|(?<![a-z])fp?(?![a-z])|плав|вещ|gleitkomma|flottant|flotante|浮点|单精度",
    ),
    ("bcd16", r"(?<!a)bcd"),
    ("bits", r"bit ?(field|map|mask|string|s\b)|flags?\b|битов\w*|маска|\bbits\b|位图"),
    ("bool", r"bool|\bbit\b|\bcoil|\bбит\b|discrete|布尔"),
    (
        "text",
        r"\bstr(ing)?\b|string|text|(?<!unsigned )(?<!signed )\bchar|ascii|utf-?8|строк|текст|zeichen|"
        r"chaîne|cadena|字符",
    ),
    ("enum", r"enum|перечисл|\blist\b"),
)
_UNSIGNED: Final = re.compile(
    r"unsigned|无符号|non sign|sin signo|bez znaku|беззнак|без знака|ohne vorz|vorzeichenlos|"
    r"(?<![a-z])u[ _-]?[sdl]?(int|short|long|\d)"
    r"|u?int[ _-]?\d+[ _-]?u\b|(?<![a-z])usign|(?<![a-z])(d|q|l)?word|слово"
)
_SIGNED: Final = re.compile(
    r"(?<!un)signed|со знаком|(?<!без)знаков|complement|(?<![a-z])[si][ _-]?\d|int|short|long|целое|ganzzahl"
)
_CLEARLY_SIGNED: Final = re.compile(
    r"(?<!un)signed|[有带]符号|(?<!non )signé|con signo|ze znakiem|со знаком|(?<!без)знаков|\bs ?[dq]?word"
)
_WORDS_OF: Final = (
    (4, r"[qlуч]word|long long|u?lint\b|quad"),
    (2, r"dword|double word|u?dint\b|long|двойн|长整"),
)
_ORDER_SAID: Final = re.compile(r"endian|\b[bl]e\b|swap|inver|revers|инверс|обратн|first|впер")


def type_of(text: str, length: int | None) -> tuple[str, int | None]:
    """The type that a cell means, and the registers that it takes, of which another column may speak."""
    word = " ".join(re.sub(r"[_()\[\],]", " ", text.lower()).split())
    width = _width(word)
    bare = _WIDTH.sub(" ", word)
    held = next((kind for kind, pattern in _HELD if re.search(pattern, bare)), None)
    words = max(1, width // 16) if width else length or 0
    if held == "text":
        return "text", length or (max(1, int(digits[0]) // 2) if (digits := re.search(r"\d+", word)) else 1)
    if held in ("f32", "f64"):
        return ("f64" if held == "f64" or words == 4 else "f32"), length
    if held == "bcd16":
        return ("bcd32" if words == 2 else "bcd16"), length
    if held in ("bits", "bool", "enum"):
        return ("bits" if held == "bool" else held), (words if width > 16 else length)
    if not width:
        words = next((count for count, pattern in _WORDS_OF if re.search(pattern, word)), words)
    return f"{'s' if _is_signed(word) else 'u'}{16 * words if words in (2, 4) else 16}", length


def _width(word: str) -> int:
    """Bits that a name speaks of; 0 where it does not."""
    if parts := _PARTS.search(word):
        return 16 * int(parts[1]) if parts[1] else 8 * int(parts[2])
    found = _WIDTH.search(re.sub(r"(?<=[a-z])(?=\d)", " ", word))
    return int(found[1]) if found else 0


def _is_signed(word: str) -> bool:
    if _CLEARLY_SIGNED.search(word):
        return True
    return not _UNSIGNED.search(word) and _SIGNED.search(word) is not None


def order_of(text: str) -> str | None:
    """The word and byte order that a text names; None where it names none, or one that could be several."""
    word = re.sub(r"\b(ab|cd|ba|dc)[ -](ab|cd|ba|dc)\b", r"\1\2", text.lower())
    match = re.search(r"\b(abcd|cdab|badc|dcba)\b", word)
    if match:
        return match[1].upper()
    digits = re.search(r"\b(1234|3412|2143|4321|3210|1032|0123|2301)\b", word)
    if digits:
        return _DIGITS[digits[1]]
    bytes_swapped = re.search(r"byte[ -]?(swap|inver|revers)|swap\w* bytes", word) is not None
    if bytes_swapped:
        return "DCBA" if re.search(r"word", re.sub(r"word ?order", "", word)) else "BADC"
    if re.search(r"(big|msb|msw|high|старш\w*).*(endian|first|впер)", word) and "swap" not in word:
        return "ABCD"
    if re.search(r"(low|lsw|little|младш\w*).*(first|word|swap|впер)|word swap|swapped|words? (rev|inv)", word):
        return "CDAB"
    return "CDAB" if is_inverse(word) else None


def is_inverse(text: str) -> bool:
    """Whether a text only says that its order is turned (`float inverse`), which is taken for turned words."""
    return re.search(r"\b(inver(se|ted)|reversed?|обратн\w*|инверсн\w*)\b", text.lower()) is not None


def says_order(text: str) -> bool:
    """Whether a text speaks of an order at all."""
    return _ORDER_SAID.search(text.lower()) is not None


_DIGITS: Final[Mapping[str, str]] = {
    "1234": "ABCD", "3412": "CDAB", "2143": "BADC", "4321": "DCBA", "3210": "ABCD", "1032": "CDAB", "0123": "DCBA",
    "2301": "BADC",
}  # fmt: skip
