"""Where the headings of a table are, and what its columns hold: the form of its addresses, what its types and rights
mean beside each other, what stands behind its names.

Headings are rows of known words, or rows of words that are some by what stands below them; else the columns themselves
tell what they are, as they stand or turned.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import compress, islice, pairwise, repeat, zip_longest
from operator import mul
from typing import Final

from .roles import Table, TableColumn, assigned, column_cells, heading_weight, is_heading, may_be_heading
from .vocabulary import WHOLE, expression, form, heading_bits, plain_heading, roles
from .written import AddressForm, address_form, area_words, numbers_in

_TOLD: Final = frozenset({"address", "name", "type"})  # columns of a table without a heading
HEADING_ROWS: Final = 60  # in which a heading is sought
_MOST_TRIED: Final = 12  # rows of words that may be a heading
_MOST_TURNED: Final = 24  # rows of a table whose values stand side by side
_AS_DIVISOR: Final = "gains of 1 or more were taken as divisors of raw values"
_AS_FACTOR: Final = (
    "factors of 10 or more were taken as multipliers of raw values: divisors are called so in some manuals"
)
_LEAST_NAMES: Final = 3  # that tell whether names end in units
_LOGICAL: Final = 10_000  # by which logical numbers of areas differ


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


def with_composed(rows: Table, texts: Sequence[str]) -> Table:
    """The rows with their addresses, where a sentence says of which columns these are (`block x 1000 + offset`): in
    place of the first, and nothing in the second."""
    said = next(filter(None, (form("composed", text) for text in texts)), None)
    if not said:
        return rows
    parts = [plain_heading(said[part]) for part in ("first", "second") if said[part]]
    places: list[int] = []
    found = []
    for row in rows:
        titles = [plain_heading(cell) for cell in row]
        numbers = [number for at in places for number in numbers_in("".join(row[at : at + 1]))[:1]]
        cells = dict(zip(places, [str(sum(map(mul, numbers, (int(said["times"]), 1)))), ""], strict=False))
        if {*parts} <= {*titles}:
            places = [titles.index(part) for part in parts]
            cells, numbers = dict(zip(places, ["address", ""], strict=False)), places
        found.append([cells.get(at, cell) for at, cell in enumerate(row)] if len(numbers) == len(places) else row)
    return found


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


def is_other_heading(row: Sequence[str]) -> bool:
    """Whether a row is the heading of a table of bits or states: all its words are of headings, none of addresses."""
    known = [{role for role in roles() if heading_bits(plain_heading(cell), role)} for cell in filter(None, row)]
    return len(known) > 1 and all(known) and not any("address" in one for one in known)


def is_rule(row: Sequence[str]) -> bool:
    """Whether a row is a line between rows, or nothing."""
    return form("rule", " ".join(row)) != {}  # joined without blanks, they would be words that no text has


@dataclass(slots=True)
class TableHeading:
    """What the columns of a table hold, by a row of headings and the rows below it."""

    columns: dict[str, int] = field(default_factory=dict)
    form: AddressForm = field(default_factory=AddressForm)
    addresses: Counter[str] = field(default_factory=Counter)  # how many rows have each
    of_functions: bool = False  # areas are the codes of functions
    of_words: bool = False  # inputs that are registers are called so
    order: str = ""  # what the heading of the orders says of them: that they are of words
    has_units_behind: bool = False  # names end in their units
    others: Mapping[str, int] = field(default_factory=dict)  # columns of more addresses, by what tells them apart
    unsigned: Collection[str] = ()  # types that are others without the word that these have a sign
    is_offset: bool = False  # addresses are called offsets
    step: int = 1  # registers from one address to the next, the least
    rights: Mapping[str, str] = field(default_factory=dict)  # what cells of access mean where no word is known


def heading_of(
    row: Sequence[str], columns: dict[str, int], below: Table, numbering: str
) -> tuple[TableHeading, Sequence[str]]:
    """What columns hold below a row of headings, and what is to be said of it; `numbering`: what titles say of
    addresses."""
    texts = {role: plain_heading(row[at]) for role, at in columns.items()}
    addresses, names, units, types, areas, rights, factors = (
        column_cells(below, columns.get(role, len(row)))
        for role in ("address", "name", "unit", "type", "area", "access", "scale")
    )
    signed = filter(None, (form("says_signed", kind.lower()) for kind in types))
    how = address_form(f"{texts['address']}{numbering}", addresses)
    doubtful = {
        _AS_DIVISOR: 0 < heading_bits(texts.get("divisor", "divisor"), "divisor") < WHOLE,
        _AS_FACTOR: any(expression(r"[x×*]? ?10+").fullmatch(cell) for cell in factors),
        "whole factors, some below 0, were taken for powers of ten": "power" in columns,
        "plain addresses were taken as counted from 1, as a heading says": how.base > 0,
        "addresses were taken for hexadecimal, as some of them have letters": how.is_hex > how.is_said,
    }
    places = sorted({*_first_numbers(below, columns["address"])})
    found = TableHeading(
        columns,
        how,
        Counter(addresses),
        form("of_functions", texts.get("area", "")) != {},
        any(form("of_words", area) and area_words(area) == "input" for area in areas),
        "word order" * ("word" in texts.get("order", "")),
        _have_units_behind(names, units),
        _more_addresses(row, below, columns),
        {without_width(f"{said['before']} {said['behind']}") for said in signed},
        heading_bits(texts["address"], "offset") > 0,
        min((after - before for before, after in pairwise(places)), default=1),
        TableColumn("", rights, 1).rights,
    )
    return found, [*compress(doubtful, doubtful.values())]


def without_width(kind: str) -> str:
    """The words of a type without its bits."""
    return " ".join(expression(r"[^\W\d]+").findall(kind.lower()))


def _more_addresses(row: Sequence[str], below: Table, columns: Mapping[str, int]) -> Mapping[str, int]:
    """The columns of addresses by what tells them apart, where several stand side by side: Address L1, L2, L3."""
    word, _, own = row[columns["address"]].partition(" ")
    free = {at: row[at].removeprefix(word).strip() for at in range(len(row)) if at not in columns.values()}
    found = {
        title: at
        for at, title in free.items()
        if row[at].startswith(f"{word} ")
        and not heading_bits(plain_heading(title.strip("()[]")), "address")
        and TableColumn("", column_cells(below, at), len(below)).is_of_addresses
    }
    places = [number for at in (columns["address"], *found.values()) for number in _first_numbers(below, at)]
    is_one_space = len({*places}) == len(places) > 0 and max(places) - min(places) < _LOGICAL
    every = sorted({own: columns["address"], **found}.items(), key=lambda titled: titled[1])
    return dict(every) if found and is_one_space else {}


def _first_numbers(rows: Table, at: int) -> list[int]:
    """The first number of each cell of a column that has one."""
    return [number for cell in column_cells(rows, at) for number in numbers_in(cell)[:1]]


def _have_units_behind(names: Sequence[str], units: Sequence[str]) -> bool:
    """Whether many names end in a short word in brackets, and most have that or a unit of a column that few use."""
    behind = sum(form("unit_behind", name) != {} for name in names)
    return behind >= _LEAST_NAMES and 2 * (behind + len(units)) > len(names) > 2 * len(units)
