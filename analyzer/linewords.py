"""How a line is set, in words: one form for the report, the sheets, `info`, the bar and the causes."""

from __future__ import annotations

from typing import Final

from captures.line import LineSettings

from .languages import page_words

_WORDS: Final = {
    "baud": "{baud} bit/s",
    "format": "{format}",
    "bits": "{bits:g}-bit characters",
    "parity": "parity {parity}",
    "tap": "tap {tap}",
}


def line_words(line: LineSettings) -> str:
    """`19200 bit/s, 8E1, tap irq`; how long a character is where its parity is not known."""
    known: dict[str, object] = {"baud": line.baud, "format": line.character_format, "tap": line.tap}
    if known["format"] is None:
        known |= {"bits": line.char_bits, "parity": line.parity}
    parts = [page_words(words, **{name: known[name]}) for name, words in _WORDS.items() if known.get(name)]
    return ", ".join(parts if line.baud else [page_words("baud not known"), *parts])
