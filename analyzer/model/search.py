"""Looking for bytes, text or a value from a row on, in either direction. Slow ones ask `stop` often."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.wording import ENGLISH

from ..languages import tr, wording
from ..languages.retelling import error_words
from ..tables.columns import decode
from .bus import Bus
from .selection import Test
from .table import PIECE

_AT_ONCE: Final = 1 << 12  # rows
_CLOSE: Final = 1e-6  # of a float: it was typed with few digits
_Rows = NDArray[np.int64]
Hits = Callable[[Bus, int, int], _Rows]  # rows of [first, last) that match


_BYTES: Final = re.compile(r"(?:0x|\\x)?[0-9a-f]{2}(?:(?:[\s,:-]+(?:0x)?|\\x)?[0-9a-f]{2})*", re.IGNORECASE)
_NUMBER: Final = re.compile(r"[+-]?(?:0x[0-9a-f]{1,4}|\d+(?:\.\d+)?(?:e[+-]?\d+)?)", re.IGNORECASE)
_KINDS: Final = ("bytes", "text", "value")


class SearchError(ValueError):
    """What was typed cannot be looked for; the message says why."""


class Wanted(NamedTuple):
    """What is looked for: in words, how rows with it are found, and the bytes where those are what is meant."""

    words: str
    hits: Hits
    data: bytes = b""


def wanted(text: str) -> Wanted:
    """What a text asks for: bytes as hex, a value, or else text. `bytes:`, `value:`, `text:` or quotes say which.

    Raises SearchError.
    """
    text = text.strip()
    kind, colon, rest = text.partition(":")
    if colon and kind.strip().lower() in _KINDS:
        return _as(kind.strip().lower(), rest.strip())
    if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"":
        return _as("text", text[1:-1])
    if _NUMBER.fullmatch(text) and not (text[:1] == "0" and text[1:].isdecimal()):
        return _as("value", text)
    return _as("bytes" if _BYTES.fullmatch(text) else "text", text)


def _as(kind: str, text: str) -> Wanted:
    if kind == "bytes":
        data = _octets(text)
        return Wanted(tr("the bytes {hex}", hex=data.hex(" ").upper()), for_bytes(text), data)
    if kind == "value":
        whole = "." not in text and "e" not in text.lower().removeprefix("0x")
        where = tr("a register, or a bit") if whole else tr("a float")
        return Wanted(tr("the value {text} of {where}", text=text, where=where), for_value(text))
    return Wanted(tr('the text "{text}"', text=text), for_text(text), text.encode())


def _octets(text: str) -> bytes:
    from captures.errors import HexError
    from captures.hexwords import read_text

    try:
        return b"".join(words.data for words in read_text(text))
    except HexError as error:
        raise SearchError(error_words(error)) from error


def for_bytes(text: str) -> Hits:
    """Rows that hold these bytes (`03 02`, `0x03,0x02`) in one stretch."""
    pattern = re.compile(re.escape(_octets(text)), re.DOTALL)
    return lambda bus, first, last: _holding(bus, pattern, first, last)


def for_text(text: str) -> Hits:
    """Rows whose bytes, as characters, or whose words in the list hold this text; case does not matter."""
    if not text.strip():
        raise SearchError(tr("nothing to look for"))
    pattern = re.compile(re.escape(text.encode()), re.IGNORECASE)
    folded, wordings = text.casefold(), {ENGLISH, wording()}

    def hits(bus: Bus, first: int, last: int) -> _Rows:
        rows = set(_holding(bus, pattern, first, last).tolist())
        for row in range(first, last):
            if row not in rows and not bus.is_noise(row):
                frame = bus.frame(row)
                if any(folded in frame.summary(each).casefold() for each in wordings):
                    rows.add(row)
        return np.array(sorted(rows), np.int64)

    return hits


def for_value(text: str) -> Hits:
    """Rows that carry this value: a register, signed or not, or a float of two registers in any byte order."""
    try:
        number = int(text, 0)
    except ValueError:
        return _for_float(text)
    if not -0x8000 <= number <= 0xFFFF:
        raise SearchError(f"{number} fits in no register: -32768 to 65535, or a float such as 230.5")

    def hits(bus: Bus, first: int, last: int) -> _Rows:
        return _with_values(bus, first, last, lambda values: values == number & 0xFFFF)

    return hits


def for_test(test: Test) -> Hits:
    """Rows that pass a test, such as a filter's."""

    def hits(bus: Bus, first: int, last: int) -> _Rows:
        passed = [
            np.flatnonzero(test(bus, number, low, high)) + number * PIECE + low
            for number, low, high in bus.table.slices(first, last)
        ]
        return np.concatenate([np.zeros(0, np.int64), *passed])

    return hits


def _for_float(text: str) -> Hits:
    try:
        number = float(text)
    except ValueError as error:
        raise SearchError(f"{text!r} is no number") from error
    if not math.isfinite(number):
        raise SearchError(f"{text!r} is no finite number")
    low, high = sorted((number * (1 - _CLOSE), number * (1 + _CLOSE)))

    def test(values: NDArray[np.uint16]) -> NDArray[np.bool_]:
        passed = np.zeros(len(values), np.bool_)
        first, second = values[:-1].astype(np.uint32), values[1:].astype(np.uint32)
        for high_word, low_word in ((first, second), (second, first)):
            for swap in (False, True):
                pair = [word >> 8 | (word & 0xFF) << 8 if swap else word for word in (high_word, low_word)]
                with np.errstate(all="ignore"):
                    read = (pair[0] << 16 | pair[1]).view(np.float32).astype(np.float64)
                    passed[:-1] |= (read >= low) & (read <= high)
        return passed

    return lambda bus, first, last: _with_values(bus, first, last, test)


def find(bus: Bus, hits: Hits, row: int, *, back: bool = False, stop: Callable[[], bool] = lambda: False) -> int | None:
    """The next row behind `row` (before it with `back`) that matches; None for none, or where `stop` ended it."""
    at = row - 1 if back else row + 1
    while 0 <= at < bus.count and not stop():
        first, last = (max(0, at + 1 - _AT_ONCE), at + 1) if back else (at, min(bus.count, at + _AT_ONCE))
        rows = hits(bus, first, last)
        if len(rows):
            return int(rows.max() if back else rows.min())
        at = first - 1 if back else last
    return None


def _holding(bus: Bus, pattern: re.Pattern[bytes], first: int, last: int) -> _Rows:
    rows = []
    for number, low, high in bus.table.slices(first, last):
        begins = bus.table.column(number, "at")[low:high].astype(np.int64)
        ends = begins + bus.table.column(number, "length")[low:high]
        data = bus.store.get(int(begins[0]), int(ends[-1] - begins[0])).tobytes()
        at, spans = 0, []
        while match := pattern.search(data, at):
            spans.append((match.start(), match.end()))
            at = match.start() + 1
        if spans:
            spots = np.array(spans, np.int64) + begins[0]
            row = np.searchsorted(begins, spots[:, 0], side="right") - 1
            inside = spots[:, 1] <= ends[row]
            rows.append(np.unique(row[inside]) + number * PIECE + low)
    return np.concatenate([np.zeros(0, np.int64), *rows])


def _with_values(bus: Bus, first: int, last: int, test: Callable[[NDArray[np.uint16]], NDArray[np.bool_]]) -> _Rows:
    rows = [np.zeros(0, np.int64)]
    for begin, batch in bus.batches(first, last):
        decoded = decode(batch)
        if len(decoded.values):
            indices = np.flatnonzero(test(decoded.values))
            rows.append(np.unique(np.searchsorted(decoded.offsets, indices, side="right") - 1) + begin)
    return np.concatenate(rows)
