"""Tables of columns: what their rows are after joining, picking, cutting and writing; percentiles in flat memory."""

from __future__ import annotations

from dataclasses import dataclass
from types import GenericAlias
from typing import Annotated, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer.tables.bins import Histogram
from analyzer.tables.findings import Findings
from analyzer.tables.schema import Bools, BoundaryEvidence, Columns, Float64s, Int64s, Rows
from analyzer.tables.transactions import TransactionRows


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Marks(Columns):
    """A table of every kind of column."""

    place: Int64s
    right: Bools
    figures: Annotated[Float64s, 2]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Spelled(Columns):
    """The same kinds as numpy spells them before 2.5 (`ndarray[shape, dtype[T]]`) and since (an alias with T alone)."""

    before: np.ndarray[tuple[Any, ...], np.dtype[np.uint16]]
    since: GenericAlias(list, (np.uint16,))  # type: ignore[valid-type]
    figures: Annotated[GenericAlias(list, (np.float64,)), 2]  # type: ignore[valid-type]


def test_columns_are_typed_however_numpy_spells_an_array() -> None:
    assert list(Spelled.dtypes().values()) == [np.dtype("u2"), np.dtype("u2"), np.dtype((np.float64, (2,)))]


def marks(count: int, first: int = 0) -> Marks:
    place = first + np.arange(count, dtype=np.int64)
    return Marks(place, place % 2 == 0, np.stack((place / 3, -place), axis=1).astype(float))


def test_rows_are_walked_by_name() -> None:
    table = marks(5000)
    rows = list(table)
    assert [tuple(row) for row in rows] == table.tolist()
    assert (rows[4097].place, rows[4097].right, rows[4097].figures) == (4097, False, [4097 / 3, -4097.0])
    assert list(marks(0)) == []


@given(st.lists(st.integers(0, 9), max_size=5))
def test_joined_tables_are_their_rows_in_order(counts: list[int]) -> None:
    parts = [marks(count, 100 * number) for number, count in enumerate(counts)]
    joined = Marks.joined(parts)
    assert joined.tolist() == [row for part in parts for row in part.tolist()]
    assert [column.dtype.base for column in joined.columns()] == [dtype.base for dtype in Marks.dtypes().values()]


@given(st.lists(st.booleans(), max_size=30), st.integers(-40, 40), st.integers(-40, 40))
def test_some_rows_are_those_of_a_list(mask: list[bool], first: int, last: int) -> None:
    some = marks(len(mask))
    rows, which = some.tolist(), np.array(mask, np.bool_)
    assert some[which].tolist() == [row for row, chosen in zip(rows, mask, strict=True) if chosen]
    numbers = np.flatnonzero(which)[::-1]
    assert some[numbers].tolist() == [rows[number] for number in numbers.tolist()]
    assert some[first:last].tolist() == rows[first:last]


def test_a_stretch_is_a_view_and_picked_rows_are_copies() -> None:
    some = marks(6)
    some[2:4].place[:] = -1
    assert some.place.tolist() == [0, 1, -1, -1, 4, 5]
    some[np.array([0, 1])].place[:] = 9
    some.copy().place[:] = 9
    assert some.place.tolist() == [0, 1, -1, -1, 4, 5]
    some.put(slice(0, 2), marks(2, 7))
    assert some.tolist()[:2] == marks(2, 7).tolist()


def test_a_table_shows_itself_in_a_line_and_its_first_rows_in_a_notebook() -> None:
    some = marks(30)
    assert repr(some) == "<Marks: 30 rows of place, right, figures>"
    shown = some._repr_html_()
    assert shown.count("<tr>") == 1 + 20 and "the first 20 of 30" in shown
    assert "the first" not in some[:20]._repr_html_()


def test_a_single_row_is_no_table() -> None:
    with pytest.raises(TypeError, match="one row is"):
        marks(3)[1]  # type: ignore[index]


@pytest.mark.parametrize("table", [Rows, TransactionRows, Findings, BoundaryEvidence])
def test_the_tables_of_the_house_have_typed_columns_side_by_side(table: type[Columns]) -> None:
    made = table.zeros(5)
    assert len(made) == 5 and len(made[1:3]) == 2
    for column, dtype in zip(made.columns(), table.dtypes().values(), strict=True):
        assert column.dtype == dtype.base and column.flags.c_contiguous


def test_nothing_counted_has_no_percentiles():
    assert not Histogram()


def test_one_value_is_every_percentile():
    histogram = Histogram()
    histogram.add(np.array([12_345_678]))
    assert [histogram.least, *histogram.quantiles(0.5, 0.99), histogram.most] == [12_345_678] * 4


@given(st.lists(st.integers(1_000, 10**12), min_size=1, max_size=300), st.integers(1, 5))
def test_percentiles_are_within_a_percent_of_the_exact_ones(values, parts):
    histogram = Histogram()
    for piece in np.array_split(np.array(values), min(parts, len(values))):
        histogram.add(piece)
    assert len(histogram) == len(values)
    assert (histogram.least, histogram.most) == (min(values), max(values))
    shares = (0.50, 0.95, 0.99)
    for share, got in zip(shares, histogram.quantiles(*shares), strict=True):
        exact = int(np.percentile(values, share * 100, method="inverted_cdf"))
        assert got == pytest.approx(exact, rel=0.011)


def test_times_off_the_scale_are_counted():
    histogram = Histogram()
    histogram.add(np.array([0, 5, 10**15]))
    assert (len(histogram), histogram.least, histogram.most) == (3, 0, 10**15)
