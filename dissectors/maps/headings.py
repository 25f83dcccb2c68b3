"""Where the headings of a table are: rows of known words, or rows of words that are some by what stands below them;
else the columns themselves tell what they are, as they stand or turned.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice, repeat, zip_longest
from typing import Final

from .roles import Table, assigned, column_cells, heading_weight, is_heading, may_be_heading
from .vocabulary import expression, form

_TOLD: Final = frozenset({"address", "name", "type"})  # columns of a table without a heading
HEADING_ROWS: Final = 60  # in which a heading is sought
_MOST_TRIED: Final = 12  # rows of words that may be a heading
_MOST_TURNED: Final = 24  # rows of a table whose values stand side by side


def has_heading(rows: Table) -> bool:
    """Whether the first rows have one, or what stands in the columns tells as much."""
    return next(headings_in(headed(rows[:HEADING_ROWS])), None) is not None


def headed(rows: Table) -> Table:
    """The rows as a table below its heading: as they stand, behind a heading that addresses, names and types tell, or
    with rows and columns exchanged."""
    if next(headings_in(rows[:HEADING_ROWS]), None) is not None:
        return rows
    width = max(map(len, rows), default=0)
    columns = assigned([""] * width, of_values(rows[:HEADING_ROWS]))
    places = column_cells(rows[:HEADING_ROWS], columns.get("address", width))
    if columns.keys() >= _TOLD and 2 * sum(form("words", cell) != {} for cell in places) < len(places):
        return [[*map({at: role for role, at in columns.items()}.get, range(width), repeat(""))], *rows]
    turned = [*map(list, zip_longest(*rows, fillvalue=""))] if len(rows) < _MOST_TURNED else []
    first = next(headings_in(turned), None)
    return turned if first is not None and assigned(turned[first], turned[first + 1 :]).keys() >= _TOLD else rows


def headings_in(rows: Table) -> Iterator[int]:
    """Where rows of headings are: those of known words, or the one that is one most surely by what stands below it."""
    known = [at for at, (row, after) in enumerate(zip_longest(rows, rows[1:])) if row != after and is_heading(row)]
    looked = (
        (at, row)
        for at, row in enumerate(rows[:HEADING_ROWS])
        if not known and may_be_heading(row) and not is_rule(row)
    )
    tried = ((at, row, of_values(rows[at + 1 : at + HEADING_ROWS])) for at, row in islice(looked, _MOST_TRIED))
    weight, first = max(((heading_weight(row, below), -at) for at, row, below in tried), default=(0.0, 0))
    yield from (at for at, row in enumerate(rows) if row == rows[-first]) if weight else known


def of_values(rows: Table) -> Table:
    """The rows that may have an address: no title, no line between others, and not the second of a heading."""
    return [row for row in rows if expression(r".*\d.*").fullmatch(" ".join(row)) and sum(map(bool, row)) > 1]


def is_value(row: Sequence[str]) -> bool:
    """Whether a row may be one of values: no title, no line between others."""
    return sum(map(bool, row)) > 1 and not is_rule(row)


def is_rule(row: Sequence[str]) -> bool:
    """Whether a row is a line between rows, or nothing."""
    return form("rule", "".join(row)) != {}
