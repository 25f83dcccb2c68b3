"""Maps that other programs keep: a file of data a program says where its registers stand and what its words mean.

`NAME.toml` has `paths` to the records, `steps` that are taken with these (`steps`), `fields` (what a map's column is,
out of which keys of a record), and the program's words for areas, types, orders and rights. A path's steps are keys;
`{a,b}` any of these, `*` any, `-` the rows of a table, or what an expression (`finds`) finds in a text, each with its
named parts, `**` anything between; no step at all is the list that a file is. A key with `^` is one of what a record
stands in (`^@`: the key that led to it), `a.b` the one under another, `=x` is x itself, `a+b` both, parted by a blank;
the first that is there counts. Words are looked up as they stand, then in small letters; `""` is what no known word
means.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.resources import files as package_files
from itertools import islice
from typing import Any, Final, cast

from ..cells import CellError, area_and_address, count_in, fraction, whole_in
from ..model import BIT_AREAS, VALUE_TYPES
from ..records import mappings, parts_of
from .builder import ImportedMap, MapBuilder, scaled
from .source import MapSource
from .steps import Record, said, step_named, value_at

_TABLES: Final = {"area": "areas", "type": "types", "order": "orders", "access": "rights"}  # of words
_LOOK: Final = 2000  # records among which one of a program tells that a file is its
_DEEPEST: Final = 60
_MOST_COPIES: Final = 250
_KEPT: Final = ("scale_register", "unit", "description", "group")  # columns that are as their keys say


@cache
def data_of(name: str) -> Mapping[str, Any]:
    """A file of data: of a program, or the table of programs."""
    return tomllib.loads((package_files(__package__) / f"{name}.toml").read_text(encoding="utf-8"))


class Program:
    """A program's form of maps."""

    def __init__(self, name: str) -> None:
        self.data = data_of(name)
        self.NAME: str = self.data["name"]
        self._above = {name.partition(".")[0] for name in re.findall(r"\^([\w.]+)", str(self.data))}

    def read(self, source: MapSource) -> list[ImportedMap] | None:
        """A map a device; None where no path leads to a record that has what a register of the program needs."""
        if next(self._found(source, self.data.get("signature", self.data["paths"]), _LOOK), None) is None:
            return None
        records = self._found(source, self.data["paths"])
        for step in self.data.get("steps", ()):
            records = step_named(step["do"])(source, records, step)
        builders: dict[str, MapBuilder] = {}
        for record in records:
            device, vendor = (" ".join(self._texts(record, key)) for key in ("device", "vendor"))
            order, notes = self.data.get("order", "ABCD"), [*self.data.get("says", ())]
            empty = MapBuilder(source.name, device, vendor, order, notes=notes)
            _ProgramRow(self.data, builders.setdefault(device, empty), record).add()
        return [builder.built() for builder in builders.values()]

    def _texts(self, record: Record, what: str) -> Iterator[str]:
        for keys in self.data.get(what, ()):
            yield str(said(record, keys))

    def _found(
        self, source: MapSource, paths: Sequence[Mapping[str, Any]], most: int | None = None
    ) -> Iterator[Record]:
        """The records that paths lead to, among the first `most` that could be."""
        for path in paths:
            way = [*filter(None, path["to"].split("."))]
            if not any(key in source.text for key in "".join(way[-1:]).strip("{}*-").split(",")):
                continue  # what it leads to is nowhere in the file
            tree = source.found(self.data["finds"]) if "finds" in self.data else getattr(source, self.data["reads"])
            records = iter(tree) if way == ["-"] else self._walked({"": tree}, ["", *way], {}, 0)
            for record in islice(records, most):
                where, unless = path.get("where", {}), path.get("unless", {"": ""})
                there = said(record, path.get("needs", ["="])) is not None
                if there and where.items() <= record.items() and not unless.items() <= record.items():
                    yield record | {key: said(record, keys) for key, keys in path.get("gives", {}).items()}

    def _walked(self, node: Mapping[str, Any], steps: Sequence[str], above: Record, depth: int) -> Iterator[Record]:
        """The mappings that steps lead to, each with what is said of it above."""
        if not steps or depth > _DEEPEST:
            yield from [{**above, **node}] * (not steps)
            return
        own = {f"^{key}": node[key] for key in self._above if not isinstance(node.get(key, []), list)}
        around, step = {**above, **own}, steps[0]
        if step == "**":
            yield from self._walked(node, steps[1:], above, depth + 1)
        keys = node if step in ("*", "**") else filter(node.__contains__, step.strip("{}").split(","))
        for key in keys:
            for below in mappings(node[key]) if step != "**" else _all_mappings(node[key]):
                yield from self._walked(below, steps[step != "**" :], {**around, "^@": key}, depth + 1)


def _all_mappings(node: Any) -> list[Mapping[str, Any]]:
    """A mapping, or those of a list, lists in it too."""
    within = parts_of(node) if isinstance(node, list) else [node]
    lists = [mapping for one in within if isinstance(one, list) for mapping in mappings(one)]
    return [*mappings(within), *lists]


class _ProgramRow:
    """A record as a row of a map."""

    def __init__(self, data: Mapping[str, Any], builder: MapBuilder, record: Record) -> None:
        self.data, self.builder, self.record = data, builder, record
        own_name = str(self.said("name") or "")
        self.name = own_name or f"Register {self.said('address')}"
        row = f"row {record['row']}: " if "row" in record else ""
        self.what = f"{row}{self.name}"  # in notes
        builder.notes += [f"{self.what}: no name"] * (not own_name)

    def said(self, what: str) -> Any:
        """What a column is out of the record."""
        return said(self.record, self.data["fields"].get(what, ()))

    def count(self, what: str, usual: int = 0) -> int:
        return count_in(self.said(what), usual)

    def meant(self, what: str) -> tuple[str | None, str]:
        """What the program's word for a column means, the first that is known; and the first that there is."""
        keys = self.data["fields"].get(what, ())
        values = [(key, value_at(self.record, key)) for key in keys]
        given = [str(value).strip() for key, value in values if value is not None and not key.startswith("=")]
        words = given[: 1 if what == "area" else None] or [key[1:] for key in keys if key.startswith("=")]
        table: Mapping[str, str] = self.data.get(_TABLES[what], {})
        known = (table.get(word) or table.get(word.lower()) for word in words)
        return next(filter(None, known), table.get("")), next(iter(words), "")

    def note(self, text: str) -> None:
        self.builder.note(f"{self.what}: {text}")

    def add(self) -> None:
        """The row, or what keeps the record from being one."""
        for text in self.record.get("of file", ()):
            self.builder.note(text)
        for text in self.record.get("notes", ()):
            self.note(text)
        if "skipped" in self.record:
            return
        area, area_word = self.meant("area")
        spot = (area, self._address(area)) if area else self._logical()
        kind, type_word = self.meant("type")
        types_are = self.data.get("types_are", "type")
        bits_are = self.data.get("bits_are", [kind])
        wrong = (
            (None in spot, f"address {self.said('address')!r} of {area_word!r} is not known"),
            (kind is None and spot[0] not in BIT_AREAS, f"{types_are} {type_word!r} is not a type that maps have"),
            (spot[0] in BIT_AREAS and kind not in bits_are, f"address {self.said('address')} leads with the digit of "
             f"{spot[0]}s, which hold no {type_word}"),
        )  # fmt: skip
        told = next((text for holds, text in wrong if holds), "")
        if told:
            self.note(told)
        else:
            self._add(str(spot[0]), cast(int, spot[1]), "bool" if spot[0] in BIT_AREAS else str(kind))

    def _logical(self) -> tuple[str | None, int | None]:
        """Area and address of a record whose address names its area."""
        try:
            return area_and_address(None, self.said("address"))
        except CellError:
            return None, None

    def _address(self, area: str | None) -> int | None:
        """The address, by what it is counted from, and octets behind it as registers."""
        address = whole_in(self.said("address"))
        behind, half = divmod(self.count("octets_behind") * (area not in BIT_AREAS), 2)
        if half:
            self.note(f"an offset of {2 * behind + half} octets begins within a register")
        return None if address is None else address + self.count("shift") + behind

    def _add(self, area: str, address: int, kind: str) -> None:
        """What stands at an address: some bits of it, or a value, or several side by side."""
        mask = self.count("mask")
        own_bit = {0: whole_in(self.said("bit")), 1: mask.bit_length() - 1}.get(mask.bit_count())
        bits = [bit for bit in (own_bit, *[0] * (kind == "bit")) if bit is not None and kind != "bool"]
        if mask.bit_count() > 1:
            self.note(f"bitmask {mask:#x} is not carried")
        if bits:
            self.builder.add_bits(area, address, bits[0], self.count("width", 1), self.name)
            return
        cells = self._cells(area, kind)
        copies = min(self.count("copies"), _MOST_COPIES)
        for turn in range(copies + 1):
            cells["name"] = f"{self.name} {turn + 1}" if copies > 0 else self.name
            self.builder.add(
                area,
                address + turn * max(1, VALUE_TYPES[str(cells["type"])]),
                cells,
                self.what if copies < 1 else cells["name"],
            )

    def _cells(self, area: str, kind: str) -> dict[str, object]:
        kind, _, own_order = kind.partition(" ")
        states = states_of(self.said("values"))
        lengths: tuple[Any, ...] = (self.said("length"), self._length())
        if states and kind[0] in "us":
            kind, lengths = "enum", (VALUE_TYPES[kind],)
        has_order = kind != "bool" and (VALUE_TYPES[kind] > 1 or self.data.get("orders_bytes", False))
        usual = (self.meant("access")[0], self.data.get("bits_access") if area in BIT_AREAS else None)
        return {
            **{column: self.said(column) for column in _KEPT},
            **self._factor(),
            "type": kind,
            "order": own_order or (self.meant("order")[0] if has_order else None),
            "length": next(filter(None, lengths), None),
            "values": states,
            "access": next(filter(None, usual), None),
            "min": self._number("min"),
            "max": self._number("max"),
        }

    def _length(self) -> int:
        """Registers, by the octets or the last address that a record tells; 0 where it tells neither."""
        octets, last, address = (self.count(what) for what in ("octets", "last", "address"))
        return -(-octets // 2) or max(0, last - address + 1) * (last > 0)

    def _factor(self) -> dict[str, object]:
        """Scale and offset; the number that a key divides by counts as its inverse."""
        scale = (self._number("scale") or 1.0) / (self._number("divisor") or 1.0)
        raw = self.data.get("offset_of_raw", 0) * scale
        return scaled(scale, (self._number("offset") or 0.0) * (raw or 1.0))

    def _number(self, what: str) -> float | None:
        """A number of the record; it is told where one is not known."""
        value = self.said(what)
        with suppress(CellError):
            return None if value in (None, "") else fraction(what, value)
        self.note(f"{what} {value!r} is not known")
        return None


def states_of(values: Any) -> dict[int, str]:
    """Names of states out of a mapping either way round, or out of records with `key` (one or several) and `value`."""
    listed = [(one.get("key"), one.get("value")) for one in mappings(values)]
    pairs = values.items() if isinstance(values, Mapping) else listed
    every = ((state, name) for key, name in pairs for state in (key if isinstance(key, list) else [key]))
    numbered = ((whole_in(state), whole_in(name), state, name) for state, name in every)
    found = ((own, name) if own is not None else (other, state) for own, other, state, name in numbered)
    return {state: _STATES.get(name, str(name)) for state, name in found if state is not None}


_STATES: Final[Mapping[Any, str]] = {True: "On", False: "Off"}  # YAML takes On and Off for truth
