"""Which column of a table holds what: an assignment of roles to columns, in bits, by headings and by what stands below.

A heading speaks for a role by all of it, by how it begins or by how it ends; the cells speak for one or against it by
their forms and by how they follow each other (addresses rise, names differ, serial numbers count). How much each says
is in `vocabulary.toml`. The pair of role and column that has most bits is taken first. So a column is found whose
heading is of no known language, and one whose heading means something else than usual.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, Final
from unicodedata import category, normalize

from .model import AREA_WORDS
from .vocabulary import WIDE_SIGNS, expression, form, given, is_narrow, meaning, roles
from .written import numbers_in

_HEADING: Final = 60  # characters
WHOLE, _BEGINS, _ENDS, _MAYBE = 10.0, 6.0, 5.0, 6.0  # bits
_LEAST_END: Final = 5  # bytes of a noun that stands last in a heading: two letters of Chinese say much
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
_LEAST_TOLD: Final = 4  # that tell one without types from a list of prices or alarms
_LEAST_ROWS: Final = 2  # below it
_FILLED: Final = 0.9
_RISING: Final = 0.8

Table = Sequence[Sequence[str]]


def column_cells(rows: Table, at: int) -> list[str]:
    """The cells of a column that hold something."""
    return [cell for row in rows if at < len(row) and (cell := row[at].strip())]


@lru_cache(maxsize=4096)
def heading_bits(text: str, role: str) -> float:
    """How much a heading, in small letters, speaks for a role; 0 where nothing of it does."""
    if not 0 < len(text) <= _HEADING:
        return 0.0
    narrow = is_narrow(text)
    words = _any(role, "words", narrow=narrow)
    last = _any(role, "last", "(?:{})$", narrow=narrow).search(text)
    ends = [mark.start() for mark in expression(r"(?<=\w)(?!\w)").finditer(text)]
    ways = (
        (WHOLE, is_whole(text, role)),
        (_BEGINS, any(words.fullmatch(text, 0, end) for end in ends)),
        (_MAYBE, _any(role, "maybe", narrow=narrow).fullmatch(text)),
        (_ENDS, _any(role, "ends", "(?:{})$", narrow=narrow).search(text)),
        (_ENDS, last and len(last[0].encode()) >= _LEAST_END),
    )
    return next((bits for bits, found in ways if found), 0.0)


def is_whole(text: str, role: str) -> bool:
    """Whether a heading is of a role by all of it."""
    return text == role or _any(role, "words", narrow=is_narrow(text)).fullmatch(text) is not None


@lru_cache(maxsize=256)
def _any(role: str, kind: str, where: str = "{}", *, narrow: bool) -> re.Pattern[str]:
    words = "|".join(roles(narrow=narrow)[role].get(kind, ())) or r"(?!)"
    return expression(where.replace("{}", _unaccented(words)), narrow=narrow)


def _unaccented(text: str) -> str:
    """A text without the marks on its letters, which people leave out."""
    bare = "".join(sign for sign in normalize("NFD", text) if category(sign) != "Mn")
    return normalize("NFC", bare).translate(_STROKES)


_STROKES: Final = str.maketrans({"đ": "d", "ł": "l", "ø": "o", "ı": "i", "æ": "ae", "œ": "oe", "ß": "ss"})


class TableColumn:
    """A column: its heading in small letters, and the cells below it."""

    def __init__(self, heading: str, cells: Sequence[str], rows: int) -> None:
        self.heading = plain_heading(heading)
        self.cells = cells
        self.filled = len(cells) / max(1, rows)

    @cached_property
    def numbers(self) -> list[int]:
        """The first number of each cell that has one."""
        return [number for cell in self.cells for number in numbers_in(cell)[:1]]

    @property
    def is_of_addresses(self) -> bool:
        """Whether nearly all cells are numbers that rise, some at least: so are addresses beside each other."""
        likely = sum(form("place", cell) != {} for cell in self.cells)
        missing = sum(not given(cell) for cell in self.cells)
        return likely > 1 and likely + missing == len(self.cells) and self._rises({})

    def bits(self, role: str) -> float:
        """How much the column speaks for a role."""
        declared = roles()[role]
        heading = heading_bits(self.heading, role)
        if declared.get("heading") and not heading:
            return 0.0
        return heading + sum(self._evidence(line) for line in declared.get("cells", ()))

    def _evidence(self, line: Mapping[str, Any]) -> float:
        if not self.cells:
            return float(min(0, line["no"]) * ("filled" in line))
        holds = all(_LOOKS[kind](self, line) for kind in _LOOKS.keys() & line.keys())
        return float(line[("no", "yes")[holds]])

    def _share(self, line: Mapping[str, Any], looks: Callable[[str], object]) -> bool:
        return sum(map(bool, map(looks, self.cells))) >= float(line.get("share", 1)) * len(self.cells)

    @cached_property
    def is_narrow(self) -> bool:
        """Whether its cells have Latin letters alone."""
        return all(map(is_narrow, self.cells))

    def _like(self, line: Mapping[str, Any]) -> bool:
        return self._share(line, expression(line["like"], narrow=self.is_narrow).fullmatch)

    def _some(self, line: Mapping[str, Any]) -> bool:
        return any(map(expression(line["some"], narrow=self.is_narrow).fullmatch, self.cells))

    def _rises(self, _: Mapping[str, Any]) -> bool:
        steps = [after > before for before, after in pairwise(self.numbers)]
        return sum(steps) >= _RISING * len(steps) and 2 * len(self.numbers) > len(self.cells)

    def _counts(self, _: Mapping[str, Any]) -> bool:
        first = [*self.numbers, 2][0]
        return first < 2 < len(self.cells) and self.numbers == list(range(first, first + len(self.cells)))

    def _varies(self, _: Mapping[str, Any]) -> bool:
        return len(set(self.cells)) > 1

    def _differs(self, _: Mapping[str, Any]) -> bool:
        return len(set(self.cells)) >= _RISING * len(self.cells)

    def _is_filled(self, _: Mapping[str, Any]) -> bool:
        return self.filled >= _FILLED

    def _types(self, line: Mapping[str, Any]) -> bool:
        return self._share(line, lambda cell: meaning("typed", cell.replace("_", " ")))

    def _areas(self, line: Mapping[str, Any]) -> bool:
        if not heading_bits(self.heading, "area"):
            return all(cell.lower() in AREA_NAMES or meaning("area", cell) for cell in self.cells)
        return self._share(
            line, lambda cell: form("codes", cell.lower()) or meaning("area", cell) or cell.lower() in AREA_WORDS
        )


AREA_NAMES: Final = frozenset(word for word in AREA_WORDS if not word.isdecimal())
_LOOKS: Final[Mapping[str, Callable[[TableColumn, Mapping[str, Any]], bool]]] = {
    "like": TableColumn._like,
    "some": TableColumn._some,
    "rises": TableColumn._rises,
    "counts": TableColumn._counts,
    "differs": TableColumn._differs,
    "varies": TableColumn._varies,
    "filled": TableColumn._is_filled,
    "type": TableColumn._types,
    "area": TableColumn._areas,
}


@lru_cache(maxsize=8192)
def plain_heading(cell: str) -> str:
    """A heading in small letters without accents, its signs those of ASCII."""
    return " ".join(_unaccented(cell.translate(WIDE_SIGNS).lower()).split()).strip(" :.")


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
        best = _assignment({pair: value for pair, value in bits.items() if pair[0] not in left})
        if best.keys() >= _NEEDED:
            weight = sum(bits[pair] for pair in best.items())
            best.pop("number", None)
            return best, weight
    return {}, 0.0


@lru_cache(maxsize=4096)
def roles_of_part(text: str) -> Sequence[str]:
    """Which of type, unit, factor and access a text alone may be, the surest first."""
    column = TableColumn("", [text], 1)
    bits = {role: column.bits(role) for role in OF_PARTS}
    return sorted((role for role in bits if bits[role] >= _LEAST), key=lambda role: -bits[role])


def _assignment(bits: Mapping[tuple[str, int], float]) -> dict[str, int]:
    found: dict[str, int] = {}
    for role, at in sorted(bits, key=lambda pair: -bits[pair]):
        if bits[role, at] >= _LEAST and role not in found and at not in found.values():
            found[role] = at
    return found


def known_headings(row: Sequence[str]) -> int:
    """How many cells of a row are headings by all of them."""
    return sum(map(_is_known, row))


@lru_cache(maxsize=8192)
def _is_known(cell: str) -> bool:
    text = plain_heading(cell[:_HEADING])
    return any(is_whole(text, role) for role in roles())


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
    tells = "type" in columns or len(columns) > _LEAST_TOLD
    return bits if tells and len(columns) >= _LEAST_CELLS and form("words", row[columns["address"]]) else 0.0
