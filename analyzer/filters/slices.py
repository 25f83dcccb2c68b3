"""What rows hold in one field, and which of them hold what is wanted: the one place where values are compared.

A comparison is true of a row if any of its values is as wanted. Nothing that a row does not have is ever as wanted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..tables.batch import Batch
from ..tables.columns import Decoded, HeldValues, decode
from ..tables.schema import Kind
from ..tables.schema import Protocol as Envelope
from .table import FilterTable, RowOctets
from .tree import BytesWanted, Span, Spans, TextPart, TextWanted, Wanted

Mask = NDArray[np.bool_]
_NOWHERE: Final = -(1 << 60)  # below all addresses, whatever is added to it
_READ_ALONE: Final = 0.25  # of the rows: fewer are read one by one
_FEW: Final = 8  # spans: beyond, single numbers are looked up together


class FieldSlice(Protocol):
    """One field of some rows."""

    def valid(self) -> Mask:
        """Which rows have it."""
        ...

    def passing(self, wanted: Wanted) -> Mask:
        """Which rows have it with a wanted value."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class ValueSlice:
    """A value a row; `has` says which rows have one (None: all of them).

    With `last` a value is a stretch of numbers, from `values` to there; `areas` are their AreaCodes.
    """

    values: NDArray[Any]
    has: Mask | None = None
    last: NDArray[Any] | None = None
    areas: NDArray[np.uint8] | None = None

    def valid(self) -> Mask:
        return np.ones(len(self.values), np.bool_) if self.has is None else self.has

    def passing(self, wanted: Wanted) -> Mask:
        assert isinstance(wanted, Spans)
        good = self._any(wanted.spans)
        return good if self.has is None else good & self.has

    def _any(self, spans: Sequence[Span]) -> Mask:
        good: Mask | None = None
        if len(spans) > _FEW and self.last is None and self.areas is None:
            numbers = np.array([span.low for span in spans if span.low == span.high])
            kind = self.values.dtype if self.values.dtype.kind == "f" else numbers.dtype
            good = np.isin(self.values, numbers.astype(kind))
            spans = [span for span in spans if span.low != span.high]
        for span in spans:
            more = self._in(span)
            good = more if good is None else np.logical_or(good, more, out=good)
        return np.zeros(len(self.values), np.bool_) if good is None else good

    def _in(self, span: Span) -> Mask:
        low, high = self.values, self.values if self.last is None else self.last
        least: Any = span.low
        most: Any = span.high
        good: Mask
        if least is not None and most is not None and least == most and low is high:
            good = low == least
        elif least is not None and most is not None:
            good = (high >= least) & (low <= most)
        elif least is not None:
            good = high > least if span.strict else high >= least
        else:
            good = low < most if span.strict else low <= most
        if span.area is not None and self.areas is not None:
            good &= self.areas == span.area
        return good


@dataclass(frozen=True, slots=True, eq=False)
class Several:
    """Any number of values a row: `each` of them, and the row that it belongs to, of `count`."""

    each: ValueSlice
    rows: NDArray[np.integer[Any]]
    count: int

    def valid(self) -> Mask:
        return self._of(self.each.valid())

    def passing(self, wanted: Wanted) -> Mask:
        return self._of(self.each.passing(wanted))

    def _of(self, good: Mask) -> Mask:
        mask = np.zeros(self.count, np.bool_)
        mask[self.rows[good]] = True
        return mask


@dataclass(frozen=True, slots=True, eq=False)
class Bytes:
    """The bytes of each row; of ASCII mode, what its digits stand for."""

    batch: Batch

    def valid(self) -> Mask:
        return np.ones(len(self.batch), np.bool_)

    def passing(self, wanted: Wanted) -> Mask:
        assert isinstance(wanted, BytesWanted)
        mask = np.zeros(len(self.batch), np.bool_)
        plain = self.batch.rows.protocol != Envelope.ASCII
        for needle in wanted.needles:
            mask |= self._with(needle, wanted.whole) & plain
        for row in np.flatnonzero(~plain).tolist():
            is_frame = self.batch.rows.kind[row] > 0
            data = self.batch.frame(row).adu.data if is_frame else self.batch.bytes_of(row)
            mask[row] = any(data == each if wanted.whole else each in data for each in wanted.needles)
        return mask

    def _with(self, needle: bytes, whole: bool) -> Mask:
        begins, lengths = self.batch.rows.at, self.batch.rows.length
        data, size = self.batch.data, len(needle)
        if size > len(data):
            return np.zeros(len(begins), np.bool_)
        starts = len(data) - size + 1
        matching = data[:starts] == needle[0]
        for i, octet in enumerate(needle[1:], 1):
            matching &= data[i : starts + i] == octet
        offsets = np.flatnonzero(matching)
        before = np.searchsorted(offsets, begins)
        behind = np.searchsorted(
            offsets, begins + 1 if whole else begins + lengths - size, side="left" if whole else "right"
        )
        hits: Mask = behind > before
        return hits & (lengths == size) if whole else hits


@dataclass(frozen=True, slots=True, eq=False)
class TextSlice:
    """A text for some of `count` rows; the others were not asked for, or have none."""

    texts: Sequence[str]
    rows: NDArray[np.intp]
    count: int

    def valid(self) -> Mask:
        mask = np.zeros(self.count, np.bool_)
        mask[self.rows] = True
        return mask

    def passing(self, wanted: Wanted) -> Mask:
        assert isinstance(wanted, TextWanted)
        mask = np.zeros(self.count, np.bool_)
        mask[self.rows] = [says(text, wanted) for text in self.texts]
        return mask


def says(text: str, wanted: TextWanted) -> bool:
    """Whether a text is as wanted."""
    folded = text.casefold()
    if wanted.part is TextPart.WHOLE:
        return folded in wanted.needles
    if wanted.part is TextPart.WITHIN:
        return any(needle in folded for needle in wanted.needles)
    return any(fnmatchcase(folded, needle) for needle in wanted.needles)


# Some rows of a table while a filter looks at them; what is dear to make is made once, and only if it is asked for.


BLOCK: Final = 1 << 16  # rows whose bytes are fetched at once


class TableSlice:
    """Rows `first` to `last` (excluded) of a table."""

    def __init__(self, table: FilterTable, first: int, last: int) -> None:
        self.table = table
        self.first = first
        self.last = last
        self._blocks: dict[int, TableSlice] = {}

    def __len__(self) -> int:
        return self.last - self.first

    def column(self, name: str) -> NDArray[Any]:
        """One of the table's columns."""
        return self.table.column(name)[self.first : self.last]

    @cached_property
    def frames(self) -> Mask:
        """Which rows are frames."""
        mask: Mask = self.column("kind") != Kind.NOISE
        return mask

    def found(self) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]]]:
        """Rows with findings, and the rule of each."""
        rows, rules = self.table.findings()
        low, high = np.searchsorted(rows, (self.first, self.last))
        return rows[low:high] - self.first, rules[low:high]

    def block(self, number: int) -> TableSlice:
        """`BLOCK` of its rows, kept as long as the piece."""
        if number not in self._blocks:
            first = self.first + number * BLOCK
            self._blocks[number] = TableSlice(self.table, first, min(first + BLOCK, self.last))
        return self._blocks[number]

    @cached_property
    def batch(self) -> Batch:
        """The rows with their bytes."""
        return self.table.batch(self.first, self.last)

    @cached_property
    def octets(self) -> RowOctets | None:
        """The rows by their bytes alone."""
        return self.table.octets(self.first, self.last)

    @cached_property
    def decoded(self) -> Decoded:
        """Their addresses and values."""
        return decode(self.batch)

    def some(self, requested: Mask | None) -> tuple[Batch, NDArray[np.intp]] | None:
        """Those rows alone that are asked for, and where each stands here (below 0: nowhere), where they are few."""
        if requested is None or np.count_nonzero(requested) >= len(self) * _READ_ALONE or self.octets is None:
            return None
        return self.octets.some(np.flatnonzero(requested))

    def spoken(self, requested: Mask | None) -> SpokenAddresses:
        """The addresses that each row speaks of; of rows that are not asked for maybe none."""
        some = self.some(requested)
        if some is None:
            return SpokenAddresses(self.decoded.address, self.decoded.quantity, self.decoded.area)
        batch, rows = some
        decoded, here = decode(batch), rows >= 0
        address, quantity = np.full((2, len(self)), -1, np.int64)
        area = np.zeros(len(self), np.uint8)
        address[rows[here]], quantity[rows[here]] = decoded.address[here], decoded.quantity[here]
        area[rows[here]] = decoded.area[here]
        return SpokenAddresses(address, quantity, area)

    @cached_property
    def held(self) -> HeldValues:
        """Where their values lie."""
        return HeldValues(self.batch)

    @cached_property
    def each(self) -> Each:
        """Their values one by one."""
        return Each(self.decoded)

    def summaries(self, requested: Mask | None) -> TextSlice:
        """The words of those frames that are asked for."""
        wanted = self.frames if requested is None else self.frames & requested
        rows = np.flatnonzero(wanted)
        by_key: dict[tuple[int, bytes, bytes | None], str] = {}  # polls say the same again and again
        texts = []
        for row in rows.tolist():
            frame = self.batch.frame(row)
            key = (frame.row.kind, frame.captured, frame.request_bytes)
            if key not in by_key:
                by_key[key] = frame.summary()
            texts.append(by_key[key])
        return TextSlice(texts, rows, len(self))


class SpokenAddresses(NamedTuple):
    """What rows speak of: first address and how many, -1 for none; AreaCodes."""

    address: NDArray[np.integer[Any]]
    quantity: NDArray[np.integer[Any]]
    area: NDArray[np.uint8]


class Each:
    """Single values: the row of each among `count`, its address (-1 unknown), its area and itself."""

    def __init__(self, decoded: Decoded) -> None:
        self._decoded = decoded
        self.value = decoded.values
        self.count = len(decoded.offsets) - 1

    @cached_property
    def _counts(self) -> NDArray[np.int64]:
        return np.diff(self._decoded.offsets)

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        """The row of each."""
        return np.repeat(np.arange(self.count), self._counts)

    @cached_property
    def address(self) -> NDArray[np.int64]:
        """The address of each, -1 unknown."""
        first = self._decoded.value_address.astype(np.int64)
        before = np.where(first < 0, _NOWHERE, first - self._decoded.offsets[:-1])
        address: NDArray[np.int64] = np.repeat(before, self._counts)
        address += np.arange(len(address))
        np.maximum(address, -1, out=address)
        return address

    @cached_property
    def area(self) -> NDArray[np.uint8]:
        """The AreaCode of each."""
        return np.repeat(self._decoded.area, self._counts)
