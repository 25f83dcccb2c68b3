"""Registers as records of JSON or YAML: objects that have an address, in lists or by name, of whatever program.

Their keys are read as the headings of a table are: `address`, `data_type`, `scaleFactor`, `readWrite`. What has no name
is named by where it stands, and grouped by what it stands in.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any, Final

from ..sheets import MapSheet
from .source import ImportedMap, MapSource, refused, whole_in
from .spreadsheet import map_of_sheet

NAME = "records of registers"
_ADDRESS: Final = ("address", "addr", "register", "reg", "register address", "start address", "offset", "адрес")
_NUMBER: Final = ("number", "register number", "no", "nr")  # beside a type
_NAMES: Final = ("name", "parameter", "signal", "title", "label", "description", "наименование", "имя")
_FEW: Final = 2
_MOST: Final = 20_000
_DEPTH: Final = 12
_INSIDE: Final = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|_+|(?<=[a-z])-(?=[a-z])")


def recognises(source: MapSource) -> bool:
    """JSON, or YAML by its name, with records."""
    return len(list(islice(_records(source), _FEW))) == _FEW


def read(source: MapSource) -> list[ImportedMap]:
    """One map of all records."""
    records = list(islice(_records(source), _MOST))
    keys = list(dict.fromkeys(key for record in records for key in record))
    rows = [keys, *([record.get(key, "") for key in keys] for record in records)]
    imported = map_of_sheet(source, MapSheet("", rows))
    if imported is None:
        raise refused(source, NAME, f"a key that names each record, beside {', '.join(keys[:5])}")
    return [imported]


def _records(source: MapSource) -> Iterator[dict[str, str]]:
    tree = source.json
    if tree is None and source.suffix in (".yaml", ".yml"):
        tree = source.yaml
    elif tree is None and source.is_text and source.text.startswith("{"):
        tree = list(_of_lines(source.text))
    return _found(tree, ())


def _of_lines(text: str) -> Iterator[Any]:
    """The objects of a file with one a line; nothing behind a line that is none."""
    for line in filter(str.strip, text.splitlines()):
        try:
            yield json.loads(line)
        except (ValueError, RecursionError):
            return


def _found(node: Any, path: tuple[str, ...]) -> Iterator[dict[str, str]]:
    """The records in a tree; `path`: the keys that lead to a node."""
    if len(path) > _DEPTH:
        return
    if isinstance(node, Mapping):
        if (record := _record(node, path)) is not None:
            yield record
            return
        for key, below in node.items():
            yield from _found(below, (*path, str(key)))
    elif isinstance(node, list):
        for below in node:
            yield from _found(below, path)


def _record(node: Mapping[str, Any], path: tuple[str, ...]) -> dict[str, str] | None:
    """A mapping as a record: with an address of its own, or named by one; else None."""
    own = {_word(key) for key, value in node.items() if not isinstance(value, Mapping)}
    named = bool(set(_NAMES) & own)
    record = dict(_cells(node))
    if named and {"type", "data type", "format"} & own and not set(_ADDRESS) & set(record):
        record = {"address" if key in _NUMBER else key: value for key, value in record.items()}
    place = next((key for key in _ADDRESS if key in own or (named and key in record)), None)
    if place is None and named and path and whole_in(path[-1]) is not None:
        record, place, path = {"address": path[-1], **record}, "address", path[:-1]
    if place is None or whole_in(record[place].partition("-")[0]) is None:
        return None
    if not named:
        record["name"] = path[-1] if path else ""
        path = path[:-1]
    record.setdefault("group", " ".join(path))
    return record


def _word(key: object) -> str:
    """A key as the words of a heading: `scaleFactor` is `scale factor`."""
    return " ".join(_INSIDE.sub(" ", str(key)).lower().split())


def _cells(record: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The values of a record by their keys as words; those of what it holds, too."""
    for key, value in record.items():
        word = _word(key)
        if isinstance(value, Mapping):
            if all(re.fullmatch(r"\d+", str(state)) and isinstance(name, str | bool) for state, name in value.items()):
                yield word, "; ".join(f"{state}={_state(name)}" for state, name in value.items())
            else:
                yield from _cells(value)
        elif isinstance(value, list):
            whole = [item for item in value if isinstance(item, int)]
            in_row = len(whole) == len(value) > 0 and whole == list(range(whole[0], whole[0] + len(whole)))
            yield word, f"{whole[0]}-{whole[-1]}" if in_row and len(whole) > 1 else ", ".join(map(str, value))
        elif value is not None:
            yield word, str(value)


def _state(name: str | bool) -> str:
    """The name of a state; YAML takes `on` and `off` for truth."""
    return name if isinstance(name, str) else "on" if name else "off"
