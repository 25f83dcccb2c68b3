"""Records of registers in what programs keep: trees of JSON, YAML, TOML, INI and XML, data in sources, blocks of lines.
A sheet is made of them whose headings are the keys, so that columns are found as in any table.

A record is a mapping with plain values; what has no name is named by the key that leads to it, and grouped by what it
stands in. Records of registers are those that have an address by its name.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any, Final

from .literals import Remark, tree_of_source
from .roles import AREA_NAMES, WHOLE, heading_bits
from .sheets import MapSheet, notes_of_cut
from .vocabulary import expression, form, tidied
from .written import access_said, area_words, numbers_in

if TYPE_CHECKING:
    from .importers.source import MapSource

_FEW: Final = 2
_MOST: Final = 20_000
_DEPTH: Final = 12
_LOOK: Final = 40  # lines in which remarks speak of all
_SOURCE: Final = 1 << 18  # characters of a source that are read
_LONGEST: Final = 300  # characters of a line that says one thing
_BRACKETS: Final = frozenset("{([")
_TOLD: Final = ("area", "access")  # by titles and keys
_SAID: Final = (("area", "area"), ("access", "access"), ("access", "writable"))  # the same by columns
_SHARED: Final = ("area", "access", "order", "base")
Record = dict[str, str]


def record_sheets(source: MapSource) -> Iterator[MapSheet]:
    """The records of a file as sheets, one for each way in which it can be read that gives any."""
    text = source.text[:_SOURCE]
    notes = notes_of_cut(source.tree is None and len(source.text) > _SOURCE, _SOURCE, "characters")
    is_source = source.tree is None and not _BRACKETS.isdisjoint(text)
    trees = (tree_of_source(text) if is_source else source.tree, [*_blocks(text)] if source.tree is None else ())
    remarks = [form("comment", line[:_LONGEST]).get("said", "") for line in text.splitlines()[:_LOOK] * (not is_source)]
    titles = [[said] for said in (*filter(None, remarks), *_sentences(source.tree))]
    for tree in trees:
        yield from (MapSheet("", [[_text(cell) for cell in row] for row in rows[:_MOST]], notes=notes)
                    for rows in islice(_lists_of_rows(tree, 0), 1))  # fmt: skip
        yield from _of_records(list(islice(_found(tree, (), {}), _MOST)), titles, notes)


def _sentences(tree: Any) -> list[str]:
    """What a file says at its head of how addresses count."""
    plain = tree.items() if isinstance(tree, Mapping) else ()
    said = (f"{_word(key)}: {value}" for key, value in plain if not _is_nested(value))
    return [text for text in said if form("from_one", text[:_LONGEST])]


def _of_records(records: list[Record], titles: list[list[str]], notes: tuple[str, ...]) -> Iterator[MapSheet]:
    """A sheet of the records that have an address by its name, of all where such are few."""
    addressed = [record for record in records if _has_address(record)]
    chosen = addressed if len(addressed) >= _FEW else records
    columns = list(dict.fromkeys(key for record in chosen for key in record))
    rows = [*titles, columns, *([record.get(key, "") for key in columns] for record in chosen)]
    if len(chosen) >= _FEW:
        yield MapSheet("", rows, notes=(*notes, *notes_of_cut(len(records) == _MOST, _MOST, "records")))


def _blocks(text: str) -> Iterator[Record]:
    """The blocks of a text that empty lines part, where each line of one is a name with what it is."""
    for block in text.split("\n\n"):
        lines = [form("named_line", line[:_LONGEST]) for line in block.strip().splitlines()]
        if len(lines) >= _FEW and all(lines):
            yield {line["name"].strip(): line["value"].strip() for line in lines}


def _has_address(record: Mapping[str, str]) -> bool:
    """Whether a number stands where a key says that the address is."""
    surest = max(record, key=lambda key: heading_bits(key, "address"), default="")
    return heading_bits(surest, "address") > 0 < len(numbers_in(record[surest][:20]))


def _lists_of_rows(node: Any, depth: int) -> Iterator[Sequence[Sequence[Any]]]:
    """The lists of lists in a tree that are rows of one length."""
    below = parts_of(node)
    if isinstance(node, Mapping) and all(isinstance(cell, list | str) for cell in below):  # of lists by their names
        lists = [expression(", *").split(cell) if isinstance(cell, str) else cell for cell in below]
        yield from _lists_of_rows([[key, *cells] for key, cells in zip(node, lists, strict=True)], _DEPTH)
    widths = {len(row) if isinstance(row, list) else 0 for row in below}
    if len(below) > _FEW and min(widths) > _FEW:
        yield below
    for inner in below[: _MOST * (depth < _DEPTH)]:
        yield from _lists_of_rows(inner, depth + 1)


def parts_of(node: Any) -> list[Any]:
    """What a mapping or a list of a tree holds; nothing of anything else."""
    match node:
        case Mapping():
            return [*node.values()]
        case list():
            return node
    return []


def _found(node: Any, path: tuple[str, ...], given: Record) -> Iterator[Record]:
    """The records in a tree; `path`: the keys that lead to a node; `given`: what holds for all below it."""
    if isinstance(node, list) and len(path) <= _DEPTH:
        for below in node:
            if isinstance(below, Remark):
                given = _with(given, _told(below))
            yield from _found(below, path, given)
    elif isinstance(node, Mapping) and len(path) <= _DEPTH:
        yield from _in_mapping(node, path, given)


def _in_mapping(node: Mapping[str, Any], path: tuple[str, ...], given: Record) -> Iterator[Record]:
    """What a mapping is, where nothing that it holds has an address, else the records in it."""
    cells, plain = dict(_cells(node)), {_word(key): "1" for key, value in node.items() if not _is_nested(value)}
    usual = (dict(_cells(part)) for key, part in node.items() if _is_nested(part) and form("of_defaults", str(key)))
    given = {**given, **next(usual, {})}
    areas = {"area": cell for cell in map(cells.__getitem__, plain) if cell.lower() in AREA_NAMES}  # noqa: B035
    shared = {**given, **areas, **{key: cells[key] for key in plain if _is_shared(key)}}
    below = [
        record
        for key, part in islice(node.items(), _MOST)
        for record in _found(part, (*path, str(key)), _with(shared, _told(str(key))))
    ]
    whole = {**_place(path, cells), **_lacking(given, cells), **cells}
    record = _placed(whole)
    speaks = len(plain) >= _FEW and any(map(numbers_in, cells.values()))
    is_record = any((speaks, _has_address(plain), record is not whole))
    yield from below if any(map(_has_address, below)) or not is_record else [record]


def _is_nested(value: Any) -> bool:
    return isinstance(value, Mapping | list)


def _with(given: Record, told: Record) -> Record:
    """What is given, and what a title tells: of an area another access."""
    return {**given, **(dict.fromkeys(_TOLD, "") if "area" in told else {}), **told}


def _lacking(given: Record, cells: Record) -> Record:
    """What is given of all that a record does not say itself."""
    said = {key for key, role in _SAID for own in cells if heading_bits(own, role) >= WHOLE}
    return {key: cell for key, cell in given.items() if cell and key not in said}


def _told(text: str) -> Record:
    """What a title or a key says of all that stands below it."""
    words = _word(text)
    return {key: cell for key, cell in zip(_TOLD, (area_words(words), access_said(words)), strict=True) if cell}


def _is_shared(key: str) -> bool:
    """Whether what a key says may hold for all that stands beside it."""
    return any(heading_bits(key, role) >= WHOLE for role in _SHARED)


def _placed(record: Record) -> Record:
    """A record with its address, where it only says how far it is from a base."""
    keys = [[key for key in record if heading_bits(key, role) >= WHOLE] for role in ("base", "offset")]
    parts = [sum(numbers_in(record[key])[:1]) for named in keys for key in named[:1]]
    if len(parts) < len(keys):
        return record
    return {**{key: cell for key, cell in record.items() if [key] not in keys}, "address": str(sum(parts))}


def _place(path: tuple[str, ...], cells: Mapping[str, str]) -> Record:
    """What the keys say that lead to a record: its name, or its address where that is a number; and its group."""
    *groups, key = ("", *path)
    is_number = numbers_in(key[:20]) and not expression(r"[^\W\d]{2}").search(key)
    kind = "address" if is_number and not _has_address(cells) else "key"
    named = any(heading_bits(word, "name") >= WHOLE for word in cells)
    if named and kind == "key":
        return {"group": " ".join(path)}
    return {kind: key, "group": " ".join(groups).strip()}


def _word(key: object) -> str:
    """A key as the words of a heading: `scaleFactor` is `scale factor`."""
    return " ".join(tidied("key", str(key)).lower().split())


def _cells(record: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The values of a record by their keys as words; those of what it holds, too."""
    for key, value in record.items():
        if isinstance(value, Mapping) and not _are_states(value):
            yield from _cells(value)
        elif value is not None:
            yield _word(key), _text(value)


def _are_states(value: Mapping[Any, Any]) -> bool:
    return all(str(state).isdecimal() and isinstance(name, str | bool) for state, name in value.items())


def _text(value: Any) -> str:
    """A value as a cell has it: states with their names, neighbouring numbers as a range."""
    match value:
        case None:
            return ""
        case dict():
            return "; ".join(f"{state}={_state(name)}" for state, name in value.items())
        case [int() as first, *_, int() as last] if value == list(range(first, last + 1)):
            return f"{first}-{last}"
        case list():
            return ", ".join(map(str, value))
        case _:
            return str(value)


def _state(name: str | bool) -> str:
    """The name of a state; YAML takes `on` and `off` for truth."""
    return name if isinstance(name, str) else ("off", "on")[name]


def json_lines(text: str) -> list[Any]:
    """The objects of a file with one a line; nothing behind a line that is none."""
    found = []
    for line in filter(str.strip, text.splitlines()):
        try:
            found.append(json.loads(line))
        except (ValueError, RecursionError):
            break
    return found
