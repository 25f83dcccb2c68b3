"""Which column of a table holds what: an assignment of roles to columns, in bits, by headings and by what stands below.

A heading speaks for a role by all of it, by how it begins or by how it ends; the cells speak for one or against it by
their forms and by how they follow each other (addresses rise, names differ, serial numbers count). How much each says
is in `vocabulary.toml`. The pair of role and column that has most bits is taken first. So a column is found whose
heading is of no known language, and one whose heading means something else than usual.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import Any, Final

from .facts import facts_in
from .model import AREA_WORDS
from .vocabulary import expression, form, given, heading_bits, meaning, plain_heading, roles, roles_headed
from .written import numbers_in

_MOST_TURNS: Final = 8
_LEAST: Final = 5.0  # bits for which a column is given a role
_NEEDED: Final = frozenset({"address", "name"})
OF_PARTS: Final = ("type", "unit", "scale", "access")
_LEFT_OUT: Final = (
    (),
    ("number",),
    ("description",),
    ("number", "description"),
    ("offset",),
    ("offset", "description"),
)
_SAMPLE: Final = 200  # rows below a heading that are looked at
_LEAST_CELLS: Final = 3  # of a heading that is known by what stands below it
_TELLING: Final = frozenset({"type", "access", "area", "length", "scale"})
_LEAST_TOLD: Final = 3  # that tell one without these from a list of prices or alarms
_LEAST_ROWS: Final = 2  # below it
_RISING: Final = 0.8
_SPANS: Final = 9.0  # bits of a column of as many registers as addresses are apart
_FEW_SPANS: Final = 2  # rows that tell nothing of that

Table = Sequence[Sequence[str]]


def column_cells(rows: Table, at: int) -> list[str]:
    """The cells of a column that hold something."""
    return [*filter(None, (cell.strip() for row in rows for cell in row[at : at + 1]))]


class TableColumn:
    """A column: its heading in small letters, and the cells below it."""

    def __init__(self, heading: str, cells: Sequence[str], rows: int) -> None:
        self.heading = plain_heading(heading)
        self.cells = cells
        self.rows = rows
        self.filled = len(cells) / max(1, rows)

    @cached_property
    def numbers(self) -> list[int]:
        """The first number of each cell that has one; hexadecimal where all cells can be and some have letters."""
        if all(form("bare_hex", cell) for cell in self.cells) and not all(map(str.isdecimal, self.cells)):
            return [int(cell.rstrip("hH"), 16) for cell in self.cells]
        return [number for cell in self.cells for number in numbers_in(cell)[:1]]

    @property
    def is_of_addresses(self) -> bool:
        """Whether nearly all cells are numbers that rise, some at least: so are addresses beside each other."""
        likely = sum(form("place", cell) != {} for cell in self.cells)
        missing = sum(not given(cell) for cell in self.cells)
        return likely > 1 and likely + missing == len(self.cells) and self.rises

    def bits(self, role: str) -> float:
        """How much the column speaks for a role."""
        declared = roles()[role]
        heading = heading_bits(self.heading, role)
        if declared.get("heading") and not heading:
            return 0.0
        return heading + sum(self._evidence(line) for line in declared.get("cells", ()))

    def _evidence(self, line: Mapping[str, Any]) -> float:
        if not self.cells:
            return float(min(0, line["no"]) * ("filled" in line and self.rows > 0))
        holds = all(_LOOKS[kind](self, line) for kind in _LOOKS.keys() & line.keys())
        return float(line[("no", "yes")[holds]])

    def share(self, line: Mapping[str, Any], looks: Callable[[str], object]) -> bool:
        """Whether a look finds as many of the cells as a line asks for, all where it does not say."""
        return sum(map(bool, map(looks, self.cells))) >= float(line.get("share", 1)) * len(self.cells)

    @property
    def rises(self) -> bool:
        """Whether numbers, in most cells, rise nearly always."""
        steps = [after > before for before, after in pairwise(self.numbers)]
        return sum(steps) >= _RISING * len(steps) and 2 * len(self.numbers) > len(self.cells)

    @property
    def counts(self) -> bool:
        """Whether the cells count from 0 or 1 on."""
        first = [*self.numbers, 2][0]
        return first < 2 < len(self.cells) and self.numbers == list(range(first, first + len(self.cells)))

    @cached_property
    def rights(self) -> Mapping[str, str]:
        """What cells of rights mean in any language, where some are two words with a sign between: read/write."""
        parts = {cell: form("two_words", cell) for cell in {*self.cells}}
        both = dict(filter(all, parts.items()))
        reading = {said["first"]: "r" for said in both.values()}
        writing = {said["second"]: "w" for said in both.values()}
        return {**writing, **reading, **dict.fromkeys(both, "rw")} if len(both) == 1 else {}

    def has_areas(self, line: Mapping[str, Any]) -> bool:
        """Whether cells name areas; where no heading says so, all do, or are codes of functions that read registers."""
        if heading_bits(self.heading, "area"):
            ways = (AREA_WORDS.__contains__, partial(meaning, "area"), partial(form, "codes"))
            return self.share(line, lambda cell: any(way(cell.lower()) for way in ways))
        are_codes = all(form("read_code", cell) for cell in self.cells) > self.counts
        has_registers = not {*self.numbers}.isdisjoint((3, 4))
        named = all(cell.lower() in AREA_NAMES or meaning("area", cell) for cell in self.cells)
        return max(named, min(are_codes, has_registers))


AREA_NAMES: Final = frozenset(word for word in AREA_WORDS if not word.isdecimal())
_LOOKS: Final[Mapping[str, Callable[[TableColumn, Mapping[str, Any]], bool]]] = {
    "like": lambda column, line: column.share(line, expression(line["like"]).fullmatch),
    "some": lambda column, line: any(map(expression(line["some"]).fullmatch, column.cells)),
    "rises": lambda column, _: column.rises,
    "counts": lambda column, _: column.counts,
    "differs": lambda column, line: len({*column.cells}) >= line["differs"] * len(column.cells),
    "varies": lambda column, _: len({*column.cells}) > 1,
    "filled": lambda column, line: column.filled >= line["filled"],
    "pairs": lambda column, _: column.rights != {} and {*column.cells} <= {*column.rights},
    "tells": lambda column, line: column.share(line, lambda cell: line["fact"] in facts_in(cell, line["tells"])),
    "type": lambda column, line: column.share(line, lambda cell: meaning("typed", cell.replace("_", " "))),
    "area": TableColumn.has_areas,
}
"""What the lines of a role's `cells` ask of a column."""


def assigned(row: Sequence[str], below: Table) -> dict[str, int]:
    """The columns of a table by their roles, the surest first; empty where none is of addresses, or none of names."""
    return assignment(row, below)[0]


def assignment(row: Sequence[str], below: Table) -> tuple[dict[str, int], float]:
    """The columns of a table by their roles, and how many bits speak for all of it.

    Serial numbers are left out of the answer. Where they took the only column of numbers, that is the address; where a
    description is the only text, that is the name.
    """
    sample = below[:_SAMPLE]
    columns = [TableColumn(cell, column_cells(sample, at), len(sample)) for at, cell in enumerate(row)]
    bits = {(role, at): column.bits(role) for at, column in enumerate(columns) for role in roles()}
    for left in _LEFT_OUT:
        best = _assignment(bits, left)
        spans = _spans_in(sample, best, len(row))
        if spans:
            bits |= {pair: bits[pair] + _SPANS for pair in spans}
            best = _assignment(bits, left)
        if best.keys() >= _NEEDED:
            weight = sum(bits[pair] for pair in best.items())
            best.pop("number", None)
            return best, weight
    return {}, 0.0


def _spans_in(rows: Table, best: Mapping[str, int], width: int) -> list[tuple[str, int]]:
    """The columns that may be of lengths by how far addresses are apart, where none is of lengths yet."""
    if "address" not in best or "length" in best:
        return []
    others = {*range(width)} - {best["address"]}
    return [("length", at) for at in others if _are_spans(rows, best["address"], at)]


def _are_spans(rows: Table, place: int, at: int) -> bool:
    """Whether a column has so many registers each that the next address lies behind them, most often just there."""
    cells = (pair for row in rows for pair in zip(row[place : place + 1], row[at : at + 1], strict=False))
    known = [(numbers_in(where)[0], int(said)) for where, said in cells if numbers_in(where) and form("span", said)]
    steps = [(after - before, count) for (before, count), (after, _) in pairwise(known) if after > before]
    fitting, exact = sum(count <= step for step, count in steps), sum(count == step for step, count in steps)
    are_several = len({count for _, count in known}) > 1 and len(known) > _FEW_SPANS
    return are_several and 0 < len(steps) == fitting and 2 * exact >= len(steps)


@lru_cache(maxsize=4096)
def roles_of_part(text: str) -> Sequence[str]:
    """Which of type, unit, factor and access a text alone may be, the surest first."""
    column = TableColumn("", [text], 1)
    bits = {role: column.bits(role) for role in OF_PARTS}
    return sorted((role for role in bits if bits[role] >= _LEAST), key=lambda role: -bits[role])


def _assignment(bits: Mapping[tuple[str, int], float], left: Collection[str]) -> dict[str, int]:
    """The roles of columns for which most bits speak together, some left out: the surest pairs first, then without
    those pairs in whose stead others say more."""
    may = {pair: value for pair, value in bits.items() if value >= _LEAST and pair[0] not in left}
    best = _surest_first(may)
    for _ in range(_MOST_TURNS):
        tried = [(_weight(_surest_first(may, pair), may), pair) for pair in best.items()]
        weight, pair = max(tried, default=(0.0, ("", 0)))
        if weight <= _weight(best, may):
            break
        del may[pair]
        best = _surest_first(may)
    return best


def _surest_first(may: Mapping[tuple[str, int], float], without: tuple[str, int] = ("", 0)) -> dict[str, int]:
    found: dict[str, int] = {}
    for role, at in sorted(may.keys() - {without}, key=lambda pair: (-may[pair], *pair)):
        if role not in found and at not in found.values():
            found[role] = at
    return found


def _weight(found: Mapping[str, int], bits: Mapping[tuple[str, int], float]) -> float:
    return sum(bits[pair] for pair in found.items())


def known_headings(row: Sequence[str]) -> int:
    """How many cells of a row are headings by all of them."""
    return sum(map(bool, map(roles_headed, map(plain_heading, row))))


def is_heading(row: Sequence[str]) -> bool:
    """Whether a row is one of headings by its words: two are known, one of addresses among what there is."""
    if any(cell[:1].isdecimal() for cell in row):
        return False
    named = any(heading_bits(plain_heading(cell), "address") for cell in row)
    return named and known_headings(row) > 1


def may_be_heading(row: Sequence[str]) -> bool:
    """Whether there are cells enough for a heading, none of which begins as a number."""
    cells = [cell for cell in row if cell]
    return len(cells) >= _LEAST_CELLS and not any(cell[:1].isdecimal() for cell in cells)


def heading_weight(row: Sequence[str], below: Table) -> float:
    """How surely a row of words that nobody knows is a heading, by what stands below it: addresses, names and more; 0
    where it is none."""
    columns, bits = assignment(row, below) if len(below) >= _LEAST_ROWS else ({}, 0.0)
    tells = not _TELLING.isdisjoint(columns) or len(columns) > _LEAST_TOLD
    return bits if tells and form("words", row[columns["address"]]) else 0.0
