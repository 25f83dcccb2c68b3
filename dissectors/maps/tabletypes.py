"""Types and word orders as tables name them: `INT16U`, `unsigned 32 bits`, `UDINT`, `Float (CDAB)`, `целое со знаком`.

A name is read by its parts, wherever they stand in it: what is held, of how many bits, with a sign or without.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

_WIDTH: Final = re.compile(r"(?<![\d.])(8|16|24|32|48|64)(?!\d)[ -]?(?:bits?\b|бит\w*)?")
_PARTS: Final = re.compile(r"\b([24])\s*[x×*]\s*(?:u?int)?16(?!\d)|\b([1248])[ -]?(?:bytes?|octets?|байт\w*)\b")
_HELD: Final = (
    ("f64", r"double(?! word)|lreal"),
    ("f32", r"float|(?<![a-z])real|single|ieee|(?<![a-z])fp?(?![a-z])|плав|вещ|gleitkomma"),
    ("bcd16", r"(?<!a)bcd"),
    ("bits", r"bit ?(field|map|mask|string|s\b)|flags?\b|битов\w*|маска|\bbits\b"),
    ("bool", r"bool|\bbit\b|\bcoil|\bбит\b|discrete"),
    ("text", r"\bstr(ing)?\b|string|text|(?<!unsigned )(?<!signed )\bchar|ascii|utf-?8|строк|текст|zeichen"),
    ("enum", r"enum|перечисл|\blist\b"),
)
_UNSIGNED: Final = re.compile(
    r"unsigned|беззнак|без знака|ohne vorz|vorzeichenlos|(?<![a-z])u[ _-]?[sdl]?(int|short|long|\d)"
    r"|u?int[ _-]?\d+[ _-]?u\b|(?<![a-z])usign|(?<![a-z])(d|q|l)?word|слово"
)
_SIGNED: Final = re.compile(
    r"(?<!un)signed|со знаком|(?<!без)знаков|complement|(?<![a-z])[si][ _-]?\d|int|short|long|целое|ganzzahl"
)
_CLEARLY_SIGNED: Final = re.compile(r"(?<!un)signed|со знаком|(?<!без)знаков")
_WORDS_OF: Final = (
    (4, r"[qlуч]word|long long|u?lint\b|quad"),
    (2, r"dword|double word|u?dint\b|long|двойн"),
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
