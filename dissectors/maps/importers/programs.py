"""Maps that other programs keep: a file of data a program says where its registers stand and what its words mean.

`NAME.toml` has `paths` to the records, `fields` (what a map's column is, out of which keys of a record), and the
program's words for areas, types, orders and rights. A path's steps are keys; `{a,b}` any of these, `*` any, `-` the
rows of a table, `**` anything between. A key with `^` is one of what a record stands in (`^@`: the key that led to it),
`a.b` the one under another, `=x` is x itself where there is no other, `a+b` both, parted by a blank; the first that is
there counts. Addresses that a record lists (`addresses`) become its `first`, their `count` and the way that they go
(`listed`). `NAME.py`, where there is one, has `adapted(source, records)`, which puts right what no path can say.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from importlib.resources import files as package_files
from itertools import islice
from typing import Any, Final, cast

from ..model import VALUE_TYPES
from ..records import parts_of
from .source import ImportedMap, MapBuilder, MapSource, mappings, number_in, scaled, whole_in

Record = dict[str, Any]
Adapter = Callable[[MapSource, Iterator[Record]], Iterator[Record]]
_TABLES: Final = {"area": "areas", "type": "types", "order": "orders", "access": "rights"}  # of words
_BITS: Final = ("coil", "discrete")
_LOOK: Final = 2000  # records among which one of a program tells that a file is its


class Program:
    """A program's form of maps."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.data: Mapping[str, Any] = tomllib.loads(
            (package_files(__package__) / f"{name}.toml").read_text(encoding="utf-8")
        )
        self.NAME: str = self.data["name"]
        self._above = {name.partition(".")[0] for name in re.findall(r"\^([\w.]+)", str(self.data))}

    @cached_property
    def _adapted(self) -> Adapter | None:
        if not self.data.get("adapted"):
            return None
        return cast(Adapter, import_module(f"{__package__}.{self.name}").adapted)

    def read(self, source: MapSource) -> list[ImportedMap] | None:
        """A map a device; None where no path leads to a record that has what a register of the program needs."""
        if next(self._found(source, self.data.get("signature", self.data["paths"]), _LOOK), None) is None:
            return None
        builders: dict[str, MapBuilder] = {}
        records = self._found(source, self.data["paths"])
        if "addresses" in self.data:
            records = (_in_line(record, record.get(self.data["addresses"])) for record in records)
        for record in records if self._adapted is None else self._adapted(source, records):
            device, vendor = (" ".join(self._texts(record, key)) for key in ("device", "vendor"))
            builder = builders.setdefault(
                device, MapBuilder(source.name, device, vendor, self.data.get("order", "ABCD"))
            )
            _ProgramRow(self, builder, record).add()
        return [builder.built() for builder in builders.values()]

    def _texts(self, record: Record, what: str) -> Iterator[str]:
        for keys in self.data.get(what, ()):
            yield str(said(record, keys))

    def _found(
        self, source: MapSource, paths: Sequence[Mapping[str, Any]], most: int | None = None
    ) -> Iterator[Record]:
        """The records that paths lead to, among the first `most` that could be."""
        tree, walk = getattr(source, self.data["reads"]), _TreeWalk(self._above)
        for path in paths:
            for record in islice(walk.records(tree, path["to"].split("."), {}), most):
                where, unless = path.get("where", {}), path.get("unless", {"": ""})
                there = "needs" not in path or said(record, path["needs"]) is not None
                if there and where.items() <= record.items() and not unless.items() <= record.items():
                    yield record


def said(record: Mapping[str, Any], keys: Sequence[str]) -> Any:
    """The first of these keys that a record has."""
    return next((value for value in (_at(record, key) for key in keys) if value is not None), None)


def _at(record: Mapping[str, Any], key: str) -> Any:
    if "+" in key[1:]:
        parts = [record.get(part) for part in key.split("+")]
        return None if None in parts else " ".join(map(str, parts))
    if "." in key[1:] and isinstance(inner := record.get(key.partition(".")[0]), Mapping):
        return inner.get(key.partition(".")[2])
    return key[1:] if key.startswith("=") else record.get(key)


def _in_line(record: Record, listed: Any) -> Record:
    """A record whose listed addresses are told by the first, how many there are, and whether they rise or fall."""
    if not isinstance(listed, list):
        return record
    first = min((place for place in map(whole_in, listed) if place is not None), default=0)
    rising = [*range(first, first + len(listed))]
    ways = {"rising": rising, "falling": rising[::-1]}
    way = next((way for way, places in ways.items() if places == [*map(whole_in, listed)] != []), None)
    told = {} if way else {"notes": [f"registers {listed} do not lie side by side"], "skipped": True}
    return {**record, "first": first, "count": len(listed), "listed": way, **told}


Stepped = Iterator[tuple[Any, Record, Sequence[str]]]


class _TreeWalk:
    """The way down a tree: what `keys` say above a record goes with it, as `^key`."""

    def __init__(self, keys: Collection[str]) -> None:
        self._keys = keys

    def records(self, node: Any, steps: Sequence[str], above: Record) -> Iterator[Record]:
        """The mappings that steps lead to, each with what it stands in."""
        if not steps:
            yield {**above, **node}
            return
        ways = {"**": self._anywhere, "-": self._rows}
        for below, around, rest in ways.get(steps[0], self._by_keys)(node, steps):
            yield from self.records(below, rest, {**above, **around})

    def _by_keys(self, node: Any, steps: Sequence[str]) -> Stepped:
        """What the keys of a step lead to: `a`, `{a,b}` or `*`."""
        inner = node if isinstance(node, Mapping) else {}
        wanted = [*inner] if steps[0] == "*" else steps[0].strip("{}").split(",")
        around = self._said(inner)
        for key in filter(inner.__contains__, wanted):
            for below in mappings(inner[key]):
                yield below, {**around, "^@": key}, steps[1:]

    def _anywhere(self, node: Any, steps: Sequence[str]) -> Stepped:
        """The node itself for the steps behind `**`, and all that it holds for these."""
        waiting: list[tuple[Any, Record]] = [(node, {})]
        while waiting:
            inner, around = waiting.pop()
            yield from [(inner, around, steps[1:])] * isinstance(inner, dict)
            around = {**around, **self._said(inner)}
            waiting += [(one, around) for one in reversed(parts_of(inner)) if isinstance(one, dict | list)]

    def _rows(self, node: Any, steps: Sequence[str]) -> Stepped:
        for below in node:
            yield below, {}, steps[1:]

    def _said(self, node: Any) -> Record:
        """What a mapping says itself of the records within it."""
        there = self._keys if isinstance(node, Mapping) else ()
        return {f"^{key}": node[key] for key in there if not isinstance(node.get(key, []), list)}


class _ProgramRow:
    """A record as a row of a map."""

    def __init__(self, program: Program, builder: MapBuilder, record: Record) -> None:
        self.data, self.builder, self.record = program.data, builder, record
        own_name = str(self.said("name") or "")
        self.name = own_name or f"Register {self.said('address')}"
        self.what = record.get("what") or self.name  # in notes
        builder.notes += [f"{self.what}: no name"] * (not own_name)

    def said(self, what: str) -> Any:
        """What a column is out of the record."""
        return said(self.record, self.data["fields"].get(what, ()))

    def meant(self, what: str) -> tuple[str | None, str]:
        """What the program's word for a column means, the first that is known; and the first that there is."""
        keys = self.data["fields"].get(what, ())
        values = [(key, _at(self.record, key)) for key in keys]
        given = [str(value).strip() for key, value in values if value is not None and not key.startswith("=")]
        words = given[: 1 if what == "area" else None] or [key[1:] for key in keys if key.startswith("=")]
        table: Mapping[str, str] = self.data.get(_TABLES[what], {})
        known = map(table.get, map(str.lower, words))
        return next(filter(None, known), None), next(iter(words), "")

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
        position = self.said("address")
        address = whole_in(position)
        area, area_word = self.meant("area")
        kind, type_word = ("bool", "") if area in _BITS else self.meant("type")
        bit = whole_in(self.said("bit")) if kind != "bit" else whole_in(self.said("bit")) or 0
        if address is None or area is None:
            self.note(f"address {position!r} of {area_word!r} is not known")
        elif bit is not None and kind != "bool":
            self.builder.add_bits(area, address, bit, whole_in(self.said("width")) or 1, self.name)
        elif kind is None:
            self.note(f"{self.data.get('types_are', 'type')} {type_word!r} is not a type that maps have")
        else:
            self.builder.add(area, address, self._cells(area, kind), self.what)

    def _cells(self, area: str, kind: str) -> dict[str, object]:
        kind, _, own_order = kind.partition(" ")
        states = states_of(self.said("values"))
        length = self.said("length")
        if states and kind[0] in "us":
            kind, length = "enum", VALUE_TYPES[kind]
        is_wide = VALUE_TYPES[kind] > 1 or self.data.get("orders_bytes", False)
        read_only = self.data.get("bits_access") if area in _BITS else None
        return {
            "name": self.name,
            "type": kind,
            "order": own_order or (self.meant("order")[0] if is_wide and kind != "bool" else None),
            "length": length,
            **self._factor(),
            "scale_register": self.said("scale_register"),
            "unit": self.said("unit"),
            "values": states,
            "access": self.meant("access")[0] or read_only,
            "min": self._number("min"),
            "max": self._number("max"),
            "description": self.said("description"),
            "group": self.said("group"),
        }

    def _factor(self) -> dict[str, object]:
        """Scale and offset; the number that a key divides by counts as its inverse."""
        scale = (self._number("scale") or 1.0) / (self._number("divisor") or 1.0)
        raw = self.data.get("offset_of_raw", 0) * scale
        return scaled(scale, (self._number("offset") or 0.0) * (raw or 1.0))

    def _number(self, what: str) -> float | None:
        value = self.said(what)
        if value in (None, ""):
            return None
        number = number_in({"": value}, "", float("nan"))
        if number != number:
            self.note(f"{what} {value!r} is not known")
            return None
        return number


def states_of(values: Any) -> dict[int, str]:
    """Names of states out of a mapping either way round, or out of records with `key` (one or several) and `value`."""
    pairs = (
        values.items()
        if isinstance(values, Mapping)
        else [(one.get("key"), one.get("value")) for one in mappings(values)]
    )
    states: dict[int, str] = {}
    for key, name in pairs:
        for one in key if isinstance(key, list) else [key]:
            number = whole_in(one)
            state, word = (number, name) if number is not None else (whole_in(name), key)
            if state is not None:
                states[state] = {True: "On", False: "Off"}[word] if isinstance(word, bool) else str(word)
    return states
