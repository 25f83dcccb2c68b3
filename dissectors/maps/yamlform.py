"""Maps as YAML: the same columns and header keys as the table, with enums as mappings.

device: Meter
word_order: CDAB
registers:
  - {area: input, address: 0, name: Voltage, type: u32, scale: 0.1, unit: V}
  - area: holding
    address: 7
    name: Mode
    type: enum
    values: {0: off, 1: on}

What such a file, in YAML or JSON, may hold is a JSON Schema made of the columns that are declared.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import yaml

from ..values import ORDERS
from .cells import COLUMNS, cells_of
from .model import MapError, MappedValue, RegisterMap
from .table import assembled, header_of

_MOST_NODES: Final = 1_000_000
_DEEPEST: Final = 60
_TOO_DEEP: Final = "nested too deeply for a map"
_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Lenient(_Base):  # type: ignore[misc]
    """Tags that a program defines for itself stand for their plain values; what they would merge in is left out."""

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        node.value = [pair for pair in node.value if not (_is_merge(pair[0]) and not _merges(pair[1]))]
        super().flatten_mapping(node)


def _is_merge(key: yaml.Node) -> bool:
    return bool(key.tag == "tag:yaml.org,2002:merge")


def _merges(value: yaml.Node) -> bool:
    listed = value.value if isinstance(value, yaml.SequenceNode) else [value]
    return all(isinstance(one, yaml.MappingNode) for one in listed)


def _plain_node(loader: Any, _suffix: str, node: yaml.Node) -> Any:
    if isinstance(node, yaml.MappingNode):
        return loader.construct_mapping(node, deep=True)
    if isinstance(node, yaml.SequenceNode):
        return loader.construct_sequence(node, deep=True)
    return str(node.value)


_Lenient.add_multi_constructor("!", _plain_node)


def load_yaml(text: str, *, lenient: bool = False) -> Any:
    """The content of a YAML text; `lenient` takes tags of programs.

    ValueError, in one line with the line where it stands, for what is no YAML, is nested too deeply, or is over a
    million values long once its aliases are written out.
    """
    try:
        _is_bounded(text)
        return _document(_Lenient(text) if lenient else _Base(text))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}: " if mark is not None else ""
        problem = str(getattr(error, "problem", None) or "no YAML")
        if "nesting depth" in problem:  # the C scanner of PyYAML 6.0.4 and later reads ahead, and has a limit itself
            problem = _TOO_DEEP
        raise ValueError(" ".join(f"{where}{problem}".split())) from error
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:  # of dates and numbers that are none
        raise ValueError("a value that cannot be read") from error


def _document(loader: Any) -> Any:
    """What a text says, None where it says nothing; no object of Python."""
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


def _is_bounded(text: str) -> None:
    """ValueError for a text that is nested deeply, which would overflow the stack of the C loader, or long once its
    aliases are written out; one that holds itself is endless."""
    sizes: dict[str | None, int] = {}
    open_ones: list[tuple[str | None, int]] = [(None, 0)]  # anchors, and what stood before each
    size = 0
    for event in yaml.parse(text, Loader=_Base):
        match event:
            case yaml.CollectionStartEvent():
                sizes[event.anchor] = _MOST_NODES + 1
                open_ones.append((event.anchor, size))
                size += 1
            case yaml.CollectionEndEvent():
                anchor, before = open_ones.pop()
                sizes[anchor] = size - before
            case yaml.ScalarEvent():
                sizes[event.anchor] = 1
                size += 1
            case yaml.AliasEvent():
                size += sizes.get(event.anchor, 0)
        if len(open_ones) > _DEEPEST + 1:
            raise ValueError(_TOO_DEEP)
        if size > _MOST_NODES:
            raise ValueError("too long once its aliases are written out")


_ROWS: Final = "registers"
_TEXT_STATES: Final = {True: "on", False: "off"}  # YAML reads on and off as truth


def read_yaml(text: str, file: str) -> RegisterMap:
    """The map in a YAML text; MapError names file, row, column and what was expected."""
    try:
        content = load_yaml(text)
    except ValueError as error:
        raise MapError(f"{file}: {error}") from error
    if not isinstance(content, Mapping) or not isinstance(content.get(_ROWS), list):
        raise MapError(f"{file}: expected a mapping with a list {_ROWS!r}")
    header = {str(key).lower(): value for key, value in content.items() if key != _ROWS}
    return assembled(header, _cells_of_rows(content[_ROWS], file), file)


def write_yaml(chart: RegisterMap) -> str:
    """The YAML text of a map."""
    header: dict[str, Any] = dict(header_of(chart))
    rows = [_entry_of_value(row, chart.word_order) for row in chart.rows]
    text: str = yaml.safe_dump(
        {**header, "address_base": 0, _ROWS: rows}, allow_unicode=True, sort_keys=False, width=120
    )
    return text


def _cells_of_rows(rows: list[Any], file: str) -> Iterator[tuple[int, Mapping[str, object]]]:
    for number, row in enumerate(rows, 1):
        if not isinstance(row, Mapping):
            raise MapError(f"{file}: row {number}: expected a mapping of columns")
        cells = {str(key).lower(): _plain_entry(value) for key, value in row.items()}
        yield number, cells


def _plain_entry(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _TEXT_STATES.get(name, name) if isinstance(name, bool) else name for key, name in value.items()}
    return value


def _entry_of_value(value: MappedValue, order: str) -> dict[str, Any]:
    cells: dict[str, Any] = {key: cell for key, cell in cells_of(value, order).items() if cell != ""}
    cells["address"] = value.address
    for key in ("scale", "offset", "min", "max"):
        if key in cells:
            number = float(cells[key])
            cells[key] = int(number) if number == int(number) and abs(number) < 1e15 else number
    if value.values:
        cells["values"] = dict(value.values)
    return cells


def json_schema() -> dict[str, Any]:
    """The schema; columns and header keys that it does not name are allowed and kept."""
    columns = {column.name: {**column.schema, "description": column.help} for column in COLUMNS}
    text = {"type": "string"}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Register map",
        "type": "object",
        "required": ["registers"],
        "properties": {
            "device": {**text, "description": "what the device is called"},
            "vendor": {**text, "description": "who makes it"},
            "version": {"type": ["string", "number"], "description": "of the map"},
            "address_base": {"enum": [0, 1], "description": "the address of the first register"},
            "word_order": {"enum": list(ORDERS), "description": "where a row says none"},
            "match": {"type": ["object", "string"], "description": "what tells that a device is this one"},
            "source": {**text, "description": "where the facts come from"},
            "licence": {**text, "description": "on which terms the map may be used"},
            "registers": {
                "type": "array",
                "items": {"type": "object", "required": ["address", "name"], "properties": columns},
            },
        },
    }
