"""Tables of registers, in whatever a sheet comes from: which column holds what is decided by `roles`, what a cell says
by `written`; here the rows are gone through.

A type that the table does not name follows from the number of registers. Addresses that begin with 1 are left as they
stand unless all of them are logical (40001 on): which base a manual counts from is for the user to say.
"""

from __future__ import annotations

from bisect import bisect, bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, zip_longest
from typing import Any, Final

from ..cells import CellError, area_and_address
from ..headings import has_heading, headed, headings_in, is_rule, is_value, of_values
from ..model import DIGIT_OF_AREA, VALUE_TYPES, MapArea
from ..roles import (
    WHOLE,
    Table,
    assigned,
    assignment,
    column_cells,
    heading_bits,
    known_headings,
    plain_heading,
)
from ..sheets import MapSheet, column_name, notes_of_cut
from ..vocabulary import expression, form, meaning
from ..written import (
    AddressForm,
    TableAddress,
    access_of,
    access_said,
    address_form,
    address_of,
    area_of_cell,
    area_words,
    bits_of,
    has_only_states,
    limits_of,
    measured,
    order_of,
    plain_number,
    states_in,
    type_of,
)
from .source import ImportedMap, MapBuilder, MapSource, whole_in

_FIRST_WORD: Final = {"CDAB": "least significant", "DCBA": "least significant"}
_MOST_HEADINGS: Final = 200  # of one sheet
_LONG_TEXTS: Final = frozenset({"name", "description"})  # columns whose cells go on below
_OPEN: Final = ("~", "-", "–", "…", "..")  # ends of an address whose last is on the next line
_LEAST_NAMES: Final = 3  # that tell whether names end in units


def chart_of(source: MapSource, sheet: MapSheet, device: str = "") -> ImportedMap | None:
    """The map of one sheet, of the file's name and `device`; None where it has no heading."""
    return _TableRows(source, sheet, device).chart()


def first_chart(source: MapSource, sheets: Iterable[MapSheet]) -> list[ImportedMap] | None:
    """The map of the first sheet that has a heading; None where none has."""
    charts = (chart_of(source, sheet) for sheet in sheets)
    return next(([chart] for chart in charts if chart is not None), None)


@dataclass(slots=True)
class _TableHeading:
    """What the columns of a table hold, by a row of headings and the rows below it."""

    columns: dict[str, int] = field(default_factory=dict)
    form: AddressForm = field(default_factory=AddressForm)
    addresses: Counter[str] = field(default_factory=Counter)  # how many rows have each
    of_functions: bool = False  # areas are the codes of functions
    order: str = ""  # what the heading of the orders says of them: that they are of words
    has_units_behind: bool = False  # names end in their units


class _TableRows:
    """The rows of one sheet; what titles and headings said of those below is kept."""

    def __init__(self, source: MapSource, sheet: MapSheet, device: str) -> None:
        self.builder = MapBuilder(source.name, device=f"{source.stem} {device}".strip())
        shown = self._visible(sheet)
        self.rows = headed(shown)
        self.first = 1 - (self.rows[1:] == shown)  # number of the first row
        for note in sheet.notes:
            self.builder.note(note)
        self.area = area_words(sheet.name)
        self.heading = _TableHeading()
        self.group = self.above = ""
        self.order: str | None = None  # as a title says
        self.access = ""  # of the rows below, too
        self.accesses: dict[MapArea | None, str] = {}  # of the areas of which a sentence speaks
        self.numbering = ""  # what titles say of addresses
        self.register: tuple[MapArea, int] | None = None  # the newest, whose bits rows may name

    def chart(self) -> ImportedMap | None:
        """The map; None where no row is a heading."""
        headings = [*islice(headings_in(self.rows), _MOST_HEADINGS + 1), len(self.rows)]
        self.builder.notes += notes_of_cut(len(headings) > _MOST_HEADINGS + 1, _MOST_HEADINGS, "headings")
        del headings[_MOST_HEADINGS:-1]
        for row in self.rows[: headings[0]]:
            self._title(row)
        begin = 0
        for first in headings[:-1]:
            if first >= begin:  # else the second row of a heading
                begin = self._heading(first, headings[min(bisect(headings, first + 1), len(headings) - 1)])
                rows = self.rows[begin : headings[bisect_left(headings, begin)]]
                for number, row in self._joined(rows, begin + self.first):
                    if not self.builder.is_full:
                        self._row(row, number)
        if self.builder.rows:
            self.builder.note("columns were told by their headings: look the map over, its address base above all")
        return self.builder.built() if self.heading.columns else None

    def _visible(self, sheet: MapSheet) -> Table:
        """The rows without the columns that the sheet hides, where what is left is a table."""
        rows = [["" if at in sheet.hidden else cell for at, cell in enumerate(row)] for row in sheet.rows]
        if not (sheet.hidden and has_heading(rows)):
            return sheet.rows
        names = ", ".join(map(column_name, sorted(sheet.hidden)))
        self.builder.note(f"hidden columns of the sheet were skipped: {names}")
        return rows

    def _heading(self, first: int, last: int) -> int:
        """Take in the heading at a row; where the rows below it begin."""
        row, begin = self.rows[first], first + 1
        if begin < last and (joint := self._merged(first, last)):
            row, begin = joint, first + 2
        below = of_values(self.rows[begin:last])
        columns = assigned(row, below) or assigned(row, ())
        if not columns:
            return begin
        texts = {role: plain_heading(row[at]) for role, at in columns.items()}
        addresses = column_cells(below, columns["address"])
        how = address_form(f"{texts['address']}{self.numbering}", addresses)
        self.heading = _TableHeading(
            columns,
            how,
            Counter(addresses),
            bool(form("of_functions", texts.get("area", ""))),
            "word order" * ("word" in texts.get("order", "")),
            _have_units_behind(*(column_cells(below, columns.get(role, len(row))) for role in ("name", "unit"))),
        )
        for holds, note in (
            ("divisor" in columns and heading_bits(texts["divisor"], "divisor") < WHOLE, _AS_DIVISOR),
            ("power" in columns, "whole factors, some below 0, were taken for powers of ten"),
            (how.base > 0, "plain addresses were taken as counted from 1, as a heading says"),
            (how.is_hex > how.is_said, "addresses were taken for hexadecimal, as some of them have letters"),
        ):
            self.builder.notes += [note] * holds
        self.above, self.register = "", None
        self.area = ("area" not in columns and area_words(texts["address"])) or self.area
        return begin

    def _merged(self, first: int, last: int) -> list[str] | None:
        """The headings of two rows as one: where the second says more of columns that the first has together (`Address`
        over `Dec` and `Hex`), or what the first leaves out. None where the second is no heading."""
        row, second = (list(self.rows[at]) for at in (first, first + 1))
        width = max(len(row), len(second))
        pairs = zip(row + [""] * (width - len(row)), second + [""] * (width - len(second)), strict=True)
        both = [low if known_headings([low]) else f"{high} {low}".strip() for high, low in pairs]
        below = of_values(self.rows[first + 2 : last])
        weights = [assignment(one, below)[1] for one in (row, second, both)]
        return both if weights[2] > max(weights[:2]) else None

    def _joined(self, rows: Table, first: int) -> Iterator[tuple[int, list[str]]]:
        """The rows with their numbers; what a cell went on with on the next line is put back to it: texts alone, in
        small letters, or where lines part all other rows."""
        columns = self.heading.columns
        is_drawn = 3 * sum(is_rule(row) > (row == [""] * len(row)) for row in rows) > len(rows)
        held: list[tuple[int, list[Sequence[str]]]] = []
        for number, row in enumerate(rows, first):
            above = held[-1][1][0] if held else ()
            if is_value(above) and _goes_on(row, above, columns, is_drawn=is_drawn):
                held[-1][1].append(row)
            else:
                held.append((number, [row]))
        for number, parts in held:
            yield number, [" ".join(filter(None, cells)) for cells in zip_longest(*parts, fillvalue="")]

    def _title(self, row: Sequence[str]) -> None:
        """Take in what a row without values says of those below."""
        cells = list(filter(None, row))
        title = " ".join(cells)
        self.order = order_of(form("says_order", title.lower()).get("", "")) or self.order
        self.numbering += " hex" * (form("in_hex", title) != {}) + " 1-based" * (form("from_one", title) != {})
        area = area_words(title)
        told = ((area_words(part), access_said(part)) for part in expression("[,;.]").split(title))
        self.accesses |= {part: said for part, said in told if said}
        self.access = access_said(title) or self.access * (area in (None, self.area))
        self.area = area or self.area
        if len(cells) == 1 and (self.heading.columns or title.startswith("#")):
            self.group = _group(title) or self.group

    def _row(self, row: Sequence[str], number: int) -> None:
        cells = list(filter(None, row))
        heading = self.heading
        named = {key: row[at].strip() for key, at in heading.columns.items() if at < len(row)}
        if is_rule(row) or self._is_bit(named):
            return
        if len(cells) == 1:
            self._title(row)
            return
        self.above = named.get("area") or self.above  # one cell for several rows holds its text once
        if heading.addresses[named.get("address", "")] == 1:
            named.pop("bit", None)  # several rows of one register are its bits
        here = area_of_cell(self.above, function=heading.of_functions) or self.area
        place = named.get("address", "")
        address = address_of(place, heading.form)
        if address is None or (form("words", place) and not named.get("name")):  # a page's head or foot
            self.builder.note(f"row {number}: {place[:30]!r} is not an address")
            return
        if form("unused", named.get("name", "")):
            self.builder.note(f"row {number}: {named['name']}: no value")
            return
        self.register = self._value(named, address, here, f"row {number}")

    def _is_bit(self, cells: dict[str, str]) -> bool:
        """Whether a row names a bit of the register above: it has no address of its own. The bit is added then."""
        name = cells.get("name") or cells.get("description", "")
        spoken = form("spoken_bit", name) or {**form("bit_cell", cells.get("bit", "")), "name": name}
        if self.register is None or cells.get("address") or "bit" not in spoken:
            return False
        self.builder.add_bits(*self.register, int(spoken["bit"]), 1, " ".join(spoken["name"].split()))
        return True

    def _value(
        self, cells: dict[str, str], position: TableAddress, area: MapArea | None, what: str
    ) -> tuple[MapArea, int] | None:
        """Add what a row says; the register that it is about, whose bits rows below may name."""
        how = self.heading.form
        named, address = _area_and_address(position, area, how)
        kind, length = type_of(_type_said(cells), whole_in(cells.get("length")) or _words(cells, position, how))
        own_name = cells.get("name", "")
        if how_named := self.heading.has_units_behind and form("unit_behind", own_name):
            own_name, cells = how_named["name"], {**cells, "unit": how_named["unit"]}
        name = own_name or f"Register {cells.get('address', '')}"
        self.builder.notes += [f"{what}: no name"] * (not own_name)
        try:
            register = area_and_address(named, address)
        except CellError as error:
            self.builder.note(f"{what}: {name[:40]}: {error}")
            return None
        bit = form("bit_cell", position.bit or cells.get("bit", "")).get("bit")
        if bit:
            self.builder.add_bits(*register, int(bit), 1, " ".join(name.split()))
            return register
        order = self._order(cells, kind, what)
        name, cells = _without_list(name, cells)
        name, scale, unit, remark = measured(cells, " ".join(name.split()))
        name, kind, states = _with_list(name, kind, cells)
        name, cells = _without_span(name, cells)
        low, high = limits_of(cells)
        self.builder.add(
            *register,
            {
                "name": name,
                "type": kind,
                "order": order,
                "length": length,
                "scale": scale,
                "offset": plain_number(cells.get("offset", "")),
                "unit": unit,
                "values": states,
                "access": next(filter(None, self._accesses(cells, register[0])), None),
                "min": low,
                "max": high,
                "description": cells.get("description") or remark,
                "group": cells.get("group") or self.group,
            },
            f"{what}: {name[:40]}",
        )
        return register

    def _accesses(self, cells: dict[str, str], area: MapArea) -> Iterator[str | None]:
        """What is said of the access to a register, the nearest first; what titles say is of what can be written."""
        yield access_of(cells)
        yield "r" * (area in ("input", "discrete"))
        yield access_said(self.above, codes=self.heading.of_functions)
        yield self.access
        yield self.accesses.get(area)

    def _order(self, cells: dict[str, str], kind: str, what: str) -> str | None:
        """The order of a wide value: as its row says it, else as a title does; a doubtful one is told."""
        own = cells.get("order", "")
        said = f"{own} {cells.get('type', '')}".strip().lower()
        ways = (said, f"{self.heading.order} {own}", cells.get("description", ""))
        order = next(filter(None, map(order_of, ways)), self.order)
        is_said, is_sure = own or form("says_order", said), order and not form("is_inverse", said)
        if VALUE_TYPES.get(kind, 0) < 2:
            return None
        if is_said and not is_sure:
            shown = f"{own} {cells.get('type', '')}".strip()[:30]
            first = _FIRST_WORD.get(str(order), "most significant")
            self.builder.note(f"{what}: order {shown!r} was taken for {order or 'ABCD'}, {first} word first")
        return order


_AS_DIVISOR: Final = "gains of 1 or more were taken as divisors of raw values"


def _without_list(name: str, cells: dict[str, str]) -> tuple[str, dict[str, str]]:
    """A row's name, without a list of states on the lines below it in its cell, which is a remark."""
    first, _, more = name.partition("\n")
    if not has_only_states(more):
        return name, cells
    return first, {**cells, "description": f"{more} {cells.get('description', '')}".strip()}


def _without_span(name: str, cells: dict[str, str]) -> tuple[str, dict[str, str]]:
    """A row's name, without a range of values in brackets behind it."""
    behind = form("states_behind", name)
    span = form("span", behind.get("states", ""))
    return (behind["name"], {"range": span[""], **cells}) if span else (name, cells)


def _with_list(name: str, kind: str, cells: dict[str, str]) -> tuple[str, str, Any]:
    """A row's name, type, and the names of its states; of its bits, where a remark names some."""
    named = bits_of(cells.get("description", ""), kind)
    return (name, "bits", named) if named else ((called := states_in(cells, kind, name))[0], kind, called[1])


def _goes_on(row: Sequence[str], above: Sequence[str], columns: Mapping[str, int], *, is_drawn: bool) -> bool:
    """Whether texts go on from the row above, which has no cell less: the name in small letters, no bit of it; where
    lines part all other rows, any name."""
    filled = {at for at, cell in enumerate(row) if cell}
    name = "".join(row[columns.get("name", len(row)) :][:1])
    place = columns.get("address", len(above))
    is_open = "".join(above[place:][:1]).endswith(_OPEN)
    texts = {columns[role] for role in _LONG_TEXTS & columns.keys()}
    alone = set() if is_open else {0, place} - texts
    held = "".join(above[columns.get("name", len(above)) :][:1])
    own = is_drawn or (f"{name}a"[0].islower() and not form("spoken_bit", name)) or held.endswith(",")
    return own and set() < filled <= (texts | {at for at, cell in enumerate(above) if cell}) - alone


def _have_units_behind(names: Sequence[str], units: Sequence[str]) -> bool:
    """Whether many names end in a short word in brackets, and most have that or a unit of a column that few use."""
    behind = sum(form("unit_behind", name) != {} for name in names)
    return behind >= _LEAST_NAMES and 2 * (behind + len(units)) > len(names) > 2 * len(units)


def _group(text: str) -> str:
    """The title above rows, as a group; a sentence is none."""
    return form("group_title", text.strip("#*: ")).get("", "")


def _type_said(cells: dict[str, str]) -> str:
    """What the columns of type, width and sign say together; where none is, what a remark says of the sign."""
    width = cells.get("width", "")
    signed = meaning("signed", cells.get("signed", ""))
    if "type" not in cells and not signed:
        signed = form("says_sign", cells.get("description", "")).get("said")
    return " ".join(filter(None, (cells.get("type"), width, signed)))


def _words(cells: dict[str, str], position: TableAddress, how: AddressForm) -> int | None:
    """Registers of a value by its octets, or from its first to its last address."""
    octets = whole_in(cells.get("octets")) or 1
    end = address_of(cells.get("end", ""), how)
    last = position.last or (end.first if end else -1)
    span = max(0, last - position.first + 1)
    return octets // 2 if octets % 2 == 0 else span or None


def _area_and_address(
    position: TableAddress, area: MapArea | None, how: AddressForm
) -> tuple[MapArea | None, int | str]:
    """Area and address as `area_and_address` takes them: a logical number (40108, 4x108) names its area itself, where
    the row says nothing else, or the same."""
    digits = how.logical_digits(area)
    text = position.text
    looks = digits and expression(rf"[{digits}](?!0+$)\d{{4,5}}").fullmatch(text)
    if position.prefixed or (looks and area in (None, _AREA_OF.get(text[0]))):
        return None, text
    return area or "holding", position.first - how.base


_AREA_OF: Final = {digit: area for area, digit in DIGIT_OF_AREA.items()}
