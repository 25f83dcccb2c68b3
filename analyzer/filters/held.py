"""What rows hold in one field, and which of them hold what is wanted: the one place where values are compared.

A comparison is true of a row if any of its values is as wanted. Nothing that a row does not have is ever as wanted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from ..frames import Batch
from ..frames import Protocol as Envelope
from .tree import Octets, Part, Span, Spans, Text, Wanted

Mask = NDArray[np.bool_]
_FEW: Final = 8  # spans: beyond, single numbers are looked up together


class Held(Protocol):
    """One field of some rows."""

    def known(self) -> Mask:
        """Which rows have it."""
        ...

    def passing(self, wanted: Wanted) -> Mask:
        """Which rows have it with a wanted value."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Values:
    """A value a row; `has` says which rows have one (None: all of them).

    With `last` a value is a stretch of numbers, from `values` to there; `areas` are their AreaCodes.
    """

    values: NDArray[Any]
    has: Mask | None = None
    last: NDArray[Any] | None = None
    areas: NDArray[np.uint8] | None = None

    def known(self) -> Mask:
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

    each: Values
    rows: NDArray[np.integer[Any]]
    count: int

    def known(self) -> Mask:
        return self._of(self.each.known())

    def passing(self, wanted: Wanted) -> Mask:
        return self._of(self.each.passing(wanted))

    def _of(self, good: Mask) -> Mask:
        found = np.zeros(self.count, np.bool_)
        found[self.rows[good]] = True
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Bytes:
    """The bytes of each row; of ASCII mode, what its digits stand for."""

    batch: Batch

    def known(self) -> Mask:
        return np.ones(len(self.batch), np.bool_)

    def passing(self, wanted: Wanted) -> Mask:
        assert isinstance(wanted, Octets)
        found = np.zeros(len(self.batch), np.bool_)
        plain = self.batch.rows["protocol"] == Envelope.RTU
        for needle in wanted.needles:
            found |= self._with(needle, wanted.whole) & plain
        for row in np.flatnonzero(~plain).tolist():
            is_frame = self.batch.rows["kind"][row] > 0
            data = self.batch.frame(row).adu.data if is_frame else self.batch.bytes_of(row)
            found[row] = any(data == each if wanted.whole else each in data for each in wanted.needles)
        return found

    def _with(self, needle: bytes, whole: bool) -> Mask:
        begins, lengths = self.batch.rows["at"], self.batch.rows["length"]
        data, size = self.batch.data, len(needle)
        if size > len(data):
            return np.zeros(len(begins), np.bool_)
        starts = len(data) - size + 1
        here = data[:starts] == needle[0]
        for i, octet in enumerate(needle[1:], 1):
            here &= data[i : starts + i] == octet
        places = np.flatnonzero(here)
        from_here = np.searchsorted(places, begins)
        behind = np.searchsorted(
            places, begins + 1 if whole else begins + lengths - size, side="left" if whole else "right"
        )
        found: Mask = behind > from_here
        return found & (lengths == size) if whole else found


@dataclass(frozen=True, slots=True, eq=False)
class Words:
    """A text for some of `count` rows; the others were not asked for, or have none."""

    texts: Sequence[str]
    rows: NDArray[np.intp]
    count: int

    def known(self) -> Mask:
        found = np.zeros(self.count, np.bool_)
        found[self.rows] = True
        return found

    def passing(self, wanted: Wanted) -> Mask:
        assert isinstance(wanted, Text)
        found = np.zeros(self.count, np.bool_)
        found[self.rows] = [says(text, wanted) for text in self.texts]
        return found


def says(text: str, wanted: Text) -> bool:
    """Whether a text is as wanted."""
    folded = text.casefold()
    if wanted.part is Part.WHOLE:
        return folded in wanted.needles
    if wanted.part is Part.WITHIN:
        return any(needle in folded for needle in wanted.needles)
    return any(fnmatchcase(folded, needle) for needle in wanted.needles)
