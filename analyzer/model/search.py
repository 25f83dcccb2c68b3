"""Rows that are looked for: by number, time, a step in time or a share of the capture; by bytes, text or a value.

The latter from a row on, in either direction; slow searches ask `stop` often.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from datetime import UTC, tzinfo
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.fields import ENGLISH
from dissectors.maps.files import UnitMaps

from ..languages import error_words, tr, wording
from ..registers.readings import mapped_columns
from ..tables.columns import decode
from ..tables.findings import described
from ..tables.schema import Kind
from ..words import UNITS_NS
from .bus import Bus
from .selection import ListRows, Test
from .table import PIECE
from .times import DIGITS, FORMS, UNIT, GotoError, is_clock_text, moment, time_ns

_FRAME: Final = re.compile(r"#?\d{1,18}")
_SHARE: Final = re.compile(rf"({DIGITS})\s*%")
_STEP: Final = re.compile(rf"([+-]?)({DIGITS})\s*({UNIT})?")


def is_place(text: str) -> bool:
    """Whether a text has the form of a place, wherever that may be."""
    text = text.strip().lower()
    return bool(_FRAME.fullmatch(text) or _SHARE.fullmatch(text) or _stepped(text)) or is_clock_text(text)


def _stepped(text: str) -> tuple[str, int] | None:
    """The sign and the size (ns) of a step."""
    match = _STEP.fullmatch(text)
    ns = None if match is None or match[3] is None else time_ns(match[2], match[3])
    return None if match is None or ns is None else (match[1], ns)


def _in_lists(text: str) -> float | None:
    """Seconds as lists show them, under whose head the unit stands: with a fraction, or it is a frame's number."""
    match = _STEP.fullmatch(text)
    if match is None or match[3] is not None or match[1] == "+" or match[2].isdecimal():
        return None
    return float(text.replace(",", "."))


def row_named(text: str, bus: Bus, row: int, zone: tzinfo = UTC, zero_ns: int | None = None) -> int:
    """The row that `text` names, seen from `row`; times of day are those of `zone`, and seconds as lists show them are
    those since `zero_ns` (None: the start). Raises GotoError.
    """
    text = text.strip().lower()
    if not bus.count:
        raise GotoError(tr("no frames yet"))
    if _FRAME.fullmatch(text):
        target = bus.table.row_of_frame(int(text.lstrip("#")))
        if target < 0:
            words = tr("no frame {text}: frames are 0 to {last:,}", text=text, last=bus.frames - 1)
            raise GotoError(words if bus.whole else tr("{words} so far", words=words))
        return target
    if match := _SHARE.fullmatch(text):
        return min(bus.count - 1, int(bus.count * float(match[1].replace(",", ".")) / 100))
    if not bus.timed:
        raise GotoError(tr("this capture has no timestamps: go to a frame number or a share such as 50%"))
    if step := _stepped(text):
        sign, ns = step
        if not sign:
            return bus.table.row_at_time(bus.t_first + ns)
        return bus.table.row_at_time(bus.table.value("t_start_ns", row) + (ns if sign == "+" else -ns))
    if (since := _in_lists(text)) is not None:
        return bus.table.row_at_time((bus.t_first if zero_ns is None else zero_ns) + round(since * UNITS_NS["s"]))
    if is_clock_text(text):
        return bus.table.row_at_time(moment(text, bus, zone))
    raise GotoError(tr("{text!r} is not a place: {forms}", text=text[:40], forms=tr(FORMS)))


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
    """What is looked for: in words, how rows with it are found, and the bytes or the name or number of a value where
    those are what is meant."""

    words: str
    hits: Hits
    data: bytes = b""
    value: str = ""


def wanted(text: str, charts: UnitMaps | None = None) -> Wanted:
    """What a text asks for: bytes as hex, a value, or else text. `bytes:`, `value:`, `text:` or quotes say which.

    `charts` say what registers mean: a number is also the value that some of them make, a text the name of a value.
    Raises SearchError.
    """
    text, charts = text.strip(), charts or UnitMaps()
    kind, colon, rest = text.partition(":")
    if colon and kind.strip().lower() in _KINDS:
        return _as(kind.strip().lower(), rest.strip(), charts)
    if len(text) > 1 and text[0] == text[-1] and text[0] in "'\"":
        return _as("text", text[1:-1], charts)
    if _NUMBER.fullmatch(text) and not (text[:1] == "0" and text[1:].isdecimal()):
        return _as("value", text, charts)
    return _as("bytes" if _BYTES.fullmatch(text) else "text", text, charts)


def _as(kind: str, text: str, charts: UnitMaps) -> Wanted:
    if kind == "bytes":
        data = _bytes_of_text(text)
        return Wanted(tr("the bytes {hex}", hex=data.hex(" ").upper()), for_bytes(text), data)
    if kind == "value":
        whole = "." not in text and "e" not in text.lower().removeprefix("0x")
        where = tr("a register, or a bit") if whole else tr("a float")
        return Wanted(tr("the value {text} of {where}", text=text, where=where), for_value(text, charts), value=text)
    hits, folded = for_text(text), text.casefold()
    if any(folded in row.name.casefold() for chart in charts.all for row in chart.rows):
        hits = _either(hits, lambda bus, first, last: _with_named(bus, first, last, charts, folded))
    return Wanted(tr('the text "{text}"', text=text), hits, text.encode(), text)


def _either(one: Hits, other: Hits) -> Hits:
    """Rows that match either."""
    return lambda bus, first, last: np.union1d(one(bus, first, last), other(bus, first, last))


def _with_named(bus: Bus, first: int, last: int, charts: UnitMaps, folded: str) -> _Rows:
    """Rows that carry a value of such a name."""
    rows = [np.zeros(0, np.int64)]
    for begin, batch in bus.batches(first, last):
        columns = mapped_columns(batch, decode(batch), charts, lambda row: folded in row.name.casefold())
        rows += [np.asarray(column.answers, np.int64) + begin for column in columns]
    return np.unique(np.concatenate(rows))


def _with_meant(bus: Bus, first: int, last: int, charts: UnitMaps, number: float) -> _Rows:
    """Rows that carry a value which is this number by what its registers mean."""
    low, high = sorted((number * (1 - _CLOSE), number * (1 + _CLOSE)))
    rows = [np.zeros(0, np.int64)]
    for begin, batch in bus.batches(first, last):
        for column in mapped_columns(batch, decode(batch), charts):
            with np.errstate(invalid="ignore"):
                rows.append(column.answers[(column.values >= low) & (column.values <= high)] + begin)
    return np.unique(np.concatenate(rows))


def is_value(text: str, name: str, worded: str, number: float | None) -> bool:
    """Whether a value of this name, words and number is what a text looks for."""
    try:
        sought = float(int(text, 0)) if text.lower().startswith("0x") else float(text)
    except ValueError:
        return text.casefold() in name.casefold() or text.casefold() in worded.casefold()
    return number is not None and math.isclose(number, sought, rel_tol=_CLOSE)


def _bytes_of_text(text: str) -> bytes:
    from captures.errors import HexError
    from captures.hexwords import read_text

    try:
        return b"".join(words.data for words in read_text(text))
    except HexError as error:
        raise SearchError(error_words(error)) from error


def for_bytes(text: str) -> Hits:
    """Rows that hold these bytes (`03 02`, `0x03,0x02`) in one stretch."""
    pattern = re.compile(re.escape(_bytes_of_text(text)), re.DOTALL)
    return lambda bus, first, last: _holding(bus, pattern, first, last)


def for_text(text: str) -> Hits:
    """Rows whose bytes, as characters, or whose words hold this text, and all of a unit that it names; case does not
    matter. Words are what is said of a frame, what is found of it, and that noise is noise."""
    if not text.strip():
        raise SearchError(tr("nothing to search for"))
    pattern = re.compile(re.escape(text.encode()), re.IGNORECASE)
    folded, wordings = " ".join(text.casefold().split()), {ENGLISH, wording()}
    of_kind = _of_kind_or_unit(folded)

    def hits(bus: Bus, first: int, last: int) -> _Rows:
        rows = set(_holding(bus, pattern, first, last).tolist())
        rows.update(of_kind(bus, first, last).tolist(), _with_found(bus, first, last, folded).tolist())
        for row in range(first, last):
            if row not in rows and not bus.is_noise(row):
                frame = bus.frame(row)
                if any(folded in frame.summary(each).casefold() for each in wordings):
                    rows.add(row)
        return np.array(sorted(rows), np.int64)

    return hits


def _of_kind_or_unit(folded: str) -> Hits:
    """Rows of noise, where a text is in its name, and of the unit that a text names."""
    noise = any(folded in words.casefold() for words in ("noise", tr("noise")))
    named = {words.casefold(): unit for unit in range(256) for words in (f"unit {unit}", tr("unit {unit}", unit=unit))}
    unit = named.get(folded, -1)

    def test(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
        is_noise = bus.table.column(number, "kind")[low:high] == Kind.NOISE
        of_unit = bus.table.column(number, "unit")[low:high] == unit
        return np.where(is_noise, noise, of_unit)

    return for_test(test)


def _with_found(bus: Bus, first: int, last: int, folded: str) -> _Rows:
    """Rows on which a finding stands whose code or words hold a text."""
    rows, found = bus.found.rules(first, last)[0], bus.found.on(np.arange(first, last))
    holds = [folded in each.code or folded in each.text.casefold() for each in described(found)]
    return np.unique(rows[np.array(holds, np.bool_)])


def for_value(text: str, charts: UnitMaps | None = None) -> Hits:
    """Rows that carry this value: a register, signed or not, a float of two registers in any byte order, or what
    registers make by the maps of units."""
    try:
        number: float = int(text, 0)
    except ValueError:
        hits, number = _for_float(text), float(text)
    else:
        hits = _for_register(int(number), may_be_wider=bool(charts))
    return _either(hits, lambda bus, first, last: _with_meant(bus, first, last, charts, number)) if charts else hits


def _for_register(number: int, *, may_be_wider: bool) -> Hits:
    if not -0x8000 <= number <= 0xFFFF:
        if may_be_wider:
            return lambda *_: np.zeros(0, np.int64)
        words = "{number} does not fit into a register: give -32768 to 65535, or a float such as 230.5"
        raise SearchError(tr(words, number=str(number)))
    return lambda bus, first, last: _with_values(bus, first, last, lambda values: values == number & 0xFFFF)


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
        raise SearchError(tr("{text!r} is not a number", text=text)) from error
    if not math.isfinite(number):
        raise SearchError(tr("{text!r} is not a finite number", text=text))
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


def with_findings(shown: ListRows) -> Hits:
    """Rows among those shown that findings stand on."""

    def hits(bus: Bus, first: int, last: int) -> _Rows:
        rows = [np.zeros(0, np.int64)]
        for number, low, high in bus.table.slices(first, last):
            rows.append(np.flatnonzero(bus.table.column(number, "mark")[low:high]) + number * PIECE + low)
        marked = np.concatenate(rows)
        return marked[shown.among(marked)]

    return hits


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
