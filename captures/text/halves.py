"""Digits that are meant as bytes and do not come in pairs: what is wrong with them, in words."""

from __future__ import annotations

import re
from typing import Final

from .candidates import H

_ODD: Final = "an odd number of hex digits in {!r} at column {}: write each byte with two digits"
_HALVED: Final = (
    (
        re.compile(r'"Buffer"\s*,\s*"data"\s*:\s*\[[\d,\s]*?\b(\d{4,}|2(?:5[6-9]|[6-9]\d)|[3-9]\d\d)\b'),
        "{} is not a byte, in the Buffer at column {}",
    ),
    (re.compile(rf"(?:^|[\s,;:])0[xX]((?:{H}{{2}}){{2,}}{H})\b"), "an odd number of hex digits in 0x{} at column {}"),
    # not `main.rs:42:5`, `12 500 rub`
    (re.compile(rf"(?<!\w:)(?:\b{H}{{2}}[ \t,:-]{{1,2}}){{2,}}({H}|{H}{{3}})(?![0-9A-Za-z_.])"), _ODD),
    (re.compile(rf"^\s*(?!fc|FC){H}{{2}}[ \t,:-]{{1,2}}({H}|{H}{{3}})(?:\s*$|(?:\s+{H}{{1,2}}){{2}})"), _ODD),
    (
        re.compile(rf"\b0[xX]{H}{{1,2}}[\s,;:]{{1,2}}0[xX]({H}{{3}})\b"),
        "an odd number of hex digits in 0x{} at column {}",
    ),
    (re.compile(rf"(?:^|[\s,;:])(?=[a-fA-F]?\d)(?=\d*[a-fA-F])({H}{{5,}})\s*$"), _ODD),
    (re.compile(r"^\s*(\d{5,})\s*$"), _ODD),
    (re.compile(r"(\\x)(?![0-9A-Fa-f]{2}|\{)"), "{} without two hex digits at column {}"),
)
_NAMES: Final = re.compile(r"\b([a-fA-F])0[ ,;\t]+\1?1[ ,;\t]+\1?2\b")  # of columns: `b0,b1,b2,…,b10`


def halves(text: str) -> str | None:
    """What is wrong with digits of this text that are meant as bytes and do not come in pairs; None for others."""
    if _NAMES.search(text):
        return None
    for pattern, words in _HALVED:
        if (match := pattern.search(text)) is not None and not (words is _ODD and len(match[1]) % 2 == 0):
            return words.format(shortened(match[1]), match.start(1) + 1)
    return None


def shortened(word: str) -> str:
    """A word as a message quotes it."""
    return word if len(word) <= 24 else word[:21] + "..."
