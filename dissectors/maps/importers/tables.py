"""Tables of registers, in whatever a sheet comes from: which column holds what is decided by `roles`, what a cell says
by `written`; here the rows are gone through.

A type that the table does not name follows from the number of registers. Addresses that begin with 1 are left as they
stand unless all of them are logical (40001 on): which base a manual counts from is for the user to say.
"""

from __future__ import annotations

from bisect import bisect, bisect_left
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate, islice, zip_longest
from typing import Final

from ..cells import CellError, area_and_address, whole_in
from ..facts import facts_of, scaled_by
from ..headings import (
    TableHeading,
    has_heading,
    headed,
    heading_of,
    headings_in,
    is_other_heading,
    is_rule,
    is_value,
    of_values,
    with_composed,
    without_width,
)
from ..model import DIGIT_OF_AREA, READ_ONLY_AREAS, VALUE_TYPES, MapArea
from ..roles import Table, assigned, assignment, known_headings
from ..sheets import MapSheet, column_name, notes_of_cut
from ..titles import Titles, footnotes_in, is_title, text_of, texts_alone, without_codes
from ..vocabulary import WIDE_SIGNS, expression, form, given, meaning, meet, plain_heading
from ..written import (
    AddressForm,
    TableAddress,
    access_of,
    access_said,
    address_of,
    area_of_cell,
    area_words,
    bits_of,
    has_only_states,
    numbers_in,
    order_of,
    states_in,
    type_of,
)
from .builder import ImportedMap, MapBuilder
from .source import MapSource

_JOINTS: Final = (" ", "\n")  # before what goes on below: a text, states
_FIRST_WORD: Final = {"CDAB": "least significant", "DCBA": "least significant"}
_OF_TYPES: Final = ("coil", "holding")  # areas that types may say
_FEW: Final = 2  # cells of a row that may be a footnote
_MOST_HEADINGS: Final = 100  # of one sheet
_LONG_TEXTS: Final = frozenset({"name", "description"})  # columns whose cells go on below
_OF_SEVERAL: Final = ("unit", "scale", "divisor", "decimals", "power", "type", "access", "writable", "order")
"""Columns whose merged cells hold for each row beside them."""
_OPEN: Final = ("~", "-", "–", "…", "..")  # ends of an address whose last is on the next line
_MOST_BLOCKS: Final = 16  # that have the same offsets
_AREA_OF: Final = {digit: area for area, digit in DIGIT_OF_AREA.items()}
_MOST_MET: Final = 500  # rows whose words are looked up at once
_SCALED: Final = ("raw_low", "raw_high", "scaled_low", "scaled_high")
Cells = dict[str, str]


def chart_of(source: MapSource, sheet: MapSheet, device: str = "") -> ImportedMap | None:
    """The map of one sheet, of the file's name and `device`; None where it has no heading."""
    meet("\n".join(" ".join(row) for row in sheet.rows[:_MOST_MET]))
    return _TableRows(source, sheet, device).chart()


class _TableRows:
    """The rows of one sheet; what titles and headings said of those below is kept."""

    def __init__(self, source: MapSource, sheet: MapSheet, device: str) -> None:
        self.builder = MapBuilder(source.name, device=f"{source.stem} {device}".strip())
        visible = self._visible(sheet)
        shown = [[text_of(row)] if is_title(row) else row for row in with_composed(visible, texts_alone(visible))]
        self.rows = headed(shown)
        self.first = 1 - (self.rows[1:] == shown)  # number of the first row
        for note in sheet.notes:
            self.builder.note(note)
        self.headings = [*islice(headings_in(self.rows), _MOST_HEADINGS + 1), len(self.rows)]
        alone = [*map(text_of, self.rows[: self.headings[0]]), *texts_alone(self.rows[self.headings[0] :])]
        self.titles = Titles(area_words(sheet.name), footnotes=footnotes_in(alone))
        self.rows = without_codes(self.rows, alone)
        self.is_divided = any(form("says_divided", text) for text in alone)  # by what a column calls a factor
        self.heading = TableHeading()
        self.alike: dict[tuple[str, ...], list[Sequence[str]]] = {}  # the rows below each heading, wherever it stands
        self.is_named = False
        self.beside = 0  # cells of the rows of a table of bits or states between
        self.above = ""  # the area of the rows above
        self.register: tuple[MapArea, int] | None = None  # the newest, whose bits rows may name

    def chart(self) -> ImportedMap | None:
        """The map; None where no row is a heading."""
        headings = self.headings
        self.builder.notes += notes_of_cut(len(headings) - 1, _MOST_HEADINGS, "headings")
        del headings[_MOST_HEADINGS:-1]
        for row in self.rows[: headings[0]]:
            self._title(row)
        ends = {first: headings[min(bisect(headings, first + 1), len(headings) - 1)] for first in headings[:-1]}
        for first, last in ends.items():
            self.alike.setdefault(tuple(self.rows[first]), []).extend(self.rows[first + 1 : last])
        begin = 0
        for first, last in ends.items():
            if first >= begin:  # else the second row of a heading
                begin = self._heading(first, last)
                rows = self.rows[begin : headings[bisect_left(headings, begin)]]
                for number, row in self._joined(rows, begin + self.first):
                    self._row(row, f"row {number}")
        told = "columns were told by their headings: look the map over, its address base above all"
        self.builder.notes += [told] * bool(self.builder.rows)
        nameless = self.builder.rows and not self.is_named  # numbers below a word such as `hex`: a capture has those
        return self.builder.built() if self.heading.columns and not nameless else None

    def _visible(self, sheet: MapSheet) -> Table:
        """The rows without the columns that the sheet hides, where what is left is a table."""
        rows = [[cell * (at not in sheet.hidden) for at, cell in enumerate(row)] for row in sheet.rows]
        if not (sheet.hidden and has_heading(rows)):
            return sheet.rows
        names = ", ".join(map(column_name, sorted(sheet.hidden)))
        self.builder.note(f"hidden columns of the sheet were skipped: {names}")
        return rows

    def _heading(self, first: int, last: int) -> int:
        """Take in the heading at a row; where the rows below it begin."""
        row, begin, alike = self.rows[first], first + 1, self.alike[tuple(self.rows[first])]
        if begin < last and (joint := self._merged(first, last)):
            row, begin, alike = joint, first + 2, [below for below in alike if below != self.rows[begin]]
        below = of_values(alike)
        columns = assigned(row, below) or assigned(row, ())
        if not columns:
            return begin
        if self.is_divided and "scale" in columns:
            columns["divisor"] = columns.pop("scale")
        self.heading, doubts = heading_of(row, columns, below, self.titles.numbering)
        self.builder.notes += doubts
        self.above, self.register, self.beside = "", None, 0
        own = "" if "area" in self.heading.columns else plain_heading(row[self.heading.columns["address"]])
        self.titles.area = area_words(own) or self.titles.area
        return begin

    def _merged(self, first: int, last: int) -> list[str] | None:
        """The headings of two rows as one: where the second says more of columns that the first has together (`Address`
        over `Dec` and `Hex`), or what the first leaves out. None where the second is no heading."""
        row, second = (list(self.rows[at]) for at in (first, first + 1))
        width = max(len(row), len(second))
        padded = [*row, *[""] * (width - len(row))]
        above = [*accumulate(padded, _nearest)]  # one cell over several
        pairs = zip(above, padded, second + [""] * (width - len(second)), strict=True)
        both = [low if known_headings([low]) else f"{top if low else own} {low}".strip() for top, own, low in pairs]
        below = of_values(self.rows[first + 2 : last])
        weights = [assignment(one, below)[1] for one in (row, second, both)]
        tops = {above[at] for at, cell in enumerate(second) if cell}
        is_split = "" not in tops and len(tops) == 1 < sum(map(bool, second))  # one heading over several columns
        is_hex = form("hex_heading", "".join(second).lower()) != {}
        is_below = (is_split or is_hex) and not any(form("place", cell) for cell in second)
        return both if weights[2] > max(weights[:2]) or is_below else None

    def _joined(self, rows: Table, first: int) -> Iterator[tuple[int, list[str]]]:
        """The rows with their numbers; what a cell went on with on the next line is put back to it: texts alone, in
        small letters, or where lines part all other rows."""
        columns = self.heading.columns
        is_drawn = 3 * sum(is_rule(row) > (row == [""] * len(row)) for row in rows) > len(rows)
        held: list[tuple[int, list[Sequence[str]]]] = []
        for number, row in enumerate(rows, first):
            above = held[-1][1][0] if held else ()
            if columns and is_value(above) and _goes_on(row, above, columns, is_drawn=is_drawn):
                held[-1][1].append(row)
            else:
                held.append((number, [row]))
        for number, parts in held:
            texts = [[_JOINTS[has_only_states(cell)] + cell for cell in part] for part in parts[1:]]
            yield number, ["".join(cells).strip() or cells[0] for cells in zip_longest(parts[0], *texts, fillvalue="")]

    def _title(self, row: Sequence[str]) -> None:
        """Take in what a row without values says of those below."""
        cells = list(filter(None, row))
        title = text_of(row)
        self.titles.take(title, is_group=len(cells) == 1 and (self.heading.columns != {} or title.startswith("#")))

    def _row(self, row: Sequence[str], what: str) -> None:
        """Take in a row: a line between others, a title, a bit of the register above, or values."""
        cells = self._cells(row)
        filled = sum(map(bool, row))
        if is_rule(row) or self._is_beside(row, filled) or self._is_bit(cells):
            return
        if filled == 1 or (filled == _FEW and form("section", row[0])):
            self._title(row)
            return
        held = self.above * (not self.heading.form.is_logical)  # one cell for several rows holds its text once
        kind = cells.get("type", "")
        self.above = cells.get("area") or held * ("area" in cells) or kind * (area_words(kind) in _OF_TYPES)
        if self.heading.addresses[cells.get("address", "")] == 1:
            cells.pop("bit", None)  # several rows of one register are its bits
        others = {f" {title}": cell for title, at in self.heading.others.items() for cell in row[at : at + 1]}
        spots = {title: place for title, place in others.items() if numbers_in(place)}
        for title, place in (spots or {"": cells.get("address", "")}).items():
            self._at(cells | {"address": place, "name": f"{cells.get('name', '')}{title}"}, what)

    def _cells(self, row: Sequence[str]) -> Cells:
        """The cells of a row by their roles, with those above that hold their places."""
        shown = {key: cell for key, at in self.heading.columns.items() for cell in row[at : at + 1]}
        held = {key: getattr(shown.get(key), "above", "") for key in _OF_SEVERAL}
        cells = {key: cell.strip() for key, cell in shown.items()} | dict(filter(all, held.items()))
        return self.titles.without_marks(cells)

    def _is_beside(self, row: Sequence[str], filled: int) -> bool:
        """Whether a row is of a table of bits or states that stands between: its heading, or no longer than that."""
        is_heading = filled < len(self.heading.columns) and is_other_heading(row)
        self.beside = filled if is_heading else self.beside * (filled != 1 and filled <= self.beside)
        return self.beside > 0

    def _at(self, cells: Cells, what: str) -> None:
        """Add what stands at the address of a row, in each of the blocks that have it."""
        place, name = cells["address"], cells["name"]
        position = address_of(place, self.heading.form)
        if position is None or (form("words", place) and not name):  # a page's head or foot
            self.builder.note(f"{what}: {place[:30]!r} is not an address")
            return
        if form("unused", name):
            self.builder.note(f"{what}: {name}: no value")
            return
        blocks = [*islice(self.titles.blocks.items(), _MOST_BLOCKS)] * place.startswith("+")
        for title, base in blocks or [("", self.titles.base * self.heading.is_offset)]:
            prefix = f"{title} " * (len(blocks) > 1)
            self.register = self._value(cells | {"name": f"{prefix}{name}"}, position.moved(base), what)

    def _is_bit(self, cells: Cells) -> bool:
        """Whether a row names a bit of the register above: it has no address of its own. The bit is added then."""
        name = cells.get("name") or cells.get("description", "")
        spoken = form("spoken_bit", name) or {**form("bit_cell", cells.get("bit", "")), "name": name}
        if self.register is None or cells.get("address") or "bit" not in spoken:
            return False
        self.builder.add_bits(*self.register, int(spoken["bit"]), 1, " ".join(spoken["name"].split()))
        return True

    def _value(self, cells: Cells, position: TableAddress, what: str) -> tuple[MapArea, int] | None:
        """Add what a row says; the register that it is about, whose bits rows below may name."""
        own_name = cells["name"].strip()
        name = own_name or f"Register {cells['address']}"
        self.builder.notes += [f"{what}: no name"] * (not own_name)
        self.is_named |= own_name != ""
        try:
            register = area_and_address(*self._spot(position))
        except CellError as error:
            self.builder.note(f"{what}: {name[:40]}: {error}")
            return None
        bit = form("bit_cell", position.bit or cells.get("bit", "")).get("bit")
        if bit:
            self.builder.add_bits(*register, int(bit), 1, " ".join(name.split()))
        else:
            self._add(register, self._apart({**cells, "name": name}), position, what)
        return register

    def _spot(self, position: TableAddress) -> tuple[MapArea | None, int | str]:
        """Area and address as `area_and_address` takes them: a logical number (40108, 4x108) names its area itself,
        where the row says nothing else, or the same; where all are logical, whatever titles say."""
        how, own = self.heading.form, area_of_cell(self.above, function=self.heading.of_functions)
        if self.heading.of_words and own == "input" and not form("of_words", self.above):
            own = "discrete"
        area = own or self.titles.area
        digits = how.logical_digits(area)
        looks = digits and expression(rf"[{digits}](?!0+$)\d{{4,5}}").fullmatch(position.text)
        free, named = own if how.is_logical else area, _AREA_OF.get(position.text[0])
        if position.prefixed or (looks and (free in (None, named) or (free, named) == ("input", "discrete"))):
            return None, position.text
        return area or "holding", position.first - how.base

    def _apart(self, cells: Cells) -> Cells:
        """The cells of a row, with what stands behind its name in cells of their own."""
        kind, *rest = expression(r"[,;](?!\d) ?").split(cells.get("type", "").translate(WIDE_SIGNS), maxsplit=1)
        if rest and type_of(kind, None) == type_of(cells["type"], None):
            cells = {**cells, "type": kind, "description": f"{rest[0]}, {cells.get('description', '')}".strip(", ")}
        first, _, more = cells["name"].partition("\n")
        if has_only_states(more):
            return {**cells, "name": first, "description": f"{more} {cells.get('description', '')}".strip()}
        if how_named := self.heading.has_units_behind and form("unit_behind", cells["name"]):
            return {**cells, "name": how_named["name"], "unit": how_named["unit"]}
        return cells

    def _add(self, register: tuple[MapArea, int], cells: Cells, position: TableAddress, what: str) -> None:
        """Add the value at a register."""
        shown = {**cells, "name": " ".join(cells["name"].split()), "unit": given(cells.get("unit", ""))}
        told, left = facts_of(shown)
        told |= scaled_by([cells.get(role, "") for role in _SCALED])
        length = whole_in(cells.get("length")) or _words(cells, position, self.heading.form)
        is_plain = without_width(cells.get("type", "")) in self.heading.unsigned
        signs = (told["sign"], "signed" * told["low"].startswith("-"), "unsigned" * is_plain)
        sign = next(filter(None, signs), "")
        kind, length = type_of(_type_said(cells, sign) or told["type"] or self._type_of_all(), length)
        order = self._order(cells, kind, what)
        bits = bits_of(cells.get("description", ""), kind)
        kind = "bits" if kind in ("u16", "u32") and form("says_bits", cells.get("description", "")) else kind
        name, states = states_in(left, kind, left["name"])
        accesses = self._accesses(cells, told["access"], register[0])
        self.builder.add(
            *register,
            {
                "name": name,
                "type": "bits" if bits else kind,
                "order": order,
                "length": length,
                "scale": told["scale"],
                "offset": told["added"],
                "unit": told["unit"] * (shown["unit"] != "" or not cells.get("unit")),  # a dash says that there is none
                "values": bits or states,
                "access": next(filter(None, accesses), None),
                "min": told["low"],
                "max": told["high"],
                "description": left.get("description") or left["unit"] * (told["unit"] == ""),
                "group": cells.get("group") or self.titles.group,
            },
            f"{what}: {name[:40]}",
        )

    def _type_of_all(self) -> str:
        """What a title says of the type of all values, where their addresses are as far apart as it is long."""
        kind, _ = type_of(self.titles.type, None)
        return self.titles.type * (VALUE_TYPES[kind] <= self.heading.step)

    def _accesses(self, cells: Cells, told: str, area: MapArea) -> Iterator[str | None]:
        """What is said of the access to a register, the nearest first; what titles say is of what can be written."""
        yield access_of(cells) or self.heading.rights.get(cells.get("access", ""))
        yield "r" * (area in READ_ONLY_AREAS)
        yield meaning("access", told.lower())
        yield access_said(self.above, codes=self.heading.of_functions)
        yield self.titles.access
        yield self.titles.accesses.get(area)

    def _order(self, cells: Cells, kind: str, what: str) -> str | None:
        """The order of a wide value: as its row says it, else as a title does; a doubtful one is told."""
        if VALUE_TYPES.get(kind, 0) < 2:
            return None
        own = cells.get("order", "")
        said = f"{own} {cells.get('type', '')}".strip()
        ways = (said.lower(), f"{self.heading.order} {own}", cells.get("description", ""))
        order = next(filter(None, map(order_of, ways)), self.titles.order)
        is_sure = order and not form("is_inverse", said.lower())
        if not is_sure and (own or form("says_order", said.lower())):
            first = _FIRST_WORD.get(str(order), "most significant")
            self.builder.note(f"{what}: order {said[:30]!r} was taken for {order or 'ABCD'}, {first} word first")
        return order


def _nearest(left: str, cell: str) -> str:
    """A cell, or where it is empty that before it."""
    return cell or left


def _goes_on(row: Sequence[str], above: Sequence[str], columns: Mapping[str, int], *, is_drawn: bool) -> bool:
    """Whether texts go on from the row above, which has no cell less: the name in small letters; where
    lines part all other rows, any name."""
    filled, held = ({at for at, cell in enumerate(cells) if cell} for cells in (row, above))
    name, name_above, place_above = (
        "".join(cells[columns.get(role, len(cells)) :][:1])
        for cells, role in ((row, "name"), (above, "name"), (above, "address"))
    )
    texts = {columns[role] for role in _LONG_TEXTS & columns.keys()}
    alone = set() if place_above.endswith(_OPEN) else {0, min(columns.values()), columns["address"]} - texts
    goes_on = (is_drawn, f"{name}a"[0].islower(), has_only_states(name), name_above.endswith(","))
    return any(goes_on) and set() < filled <= (texts | held) - alone


def _type_said(cells: Cells, sign: str) -> str:
    """What the columns of type, width and sign say together; where none is, what a remark says of the sign."""
    own = (cells.get("type"), cells.get("width", ""), meaning("signed", cells.get("signed", "")) or sign)
    return " ".join(filter(None, own))


def _words(cells: Cells, position: TableAddress, how: AddressForm) -> int | None:
    """Registers of a value by its octets, or from its first to its last address."""
    octets = whole_in(cells.get("octets")) or 1
    end = address_of(cells.get("end", ""), how)
    last = position.last or (end.first if end else -1)
    ways = (octets // 2 * (octets % 2 == 0), max(0, last - position.first + 1))
    return next(filter(None, ways), None)
