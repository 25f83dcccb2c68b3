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

from dissectors.values import ORDERS

from .cells import COLUMNS, cells_of
from .model import MapError, MappedValue, RegisterMap
from .table import assembled, header_of
from .yamltext import load_yaml

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
    return assembled(header, _rows(content[_ROWS], file), file)


def write_yaml(chart: RegisterMap) -> str:
    """The YAML text of a map."""
    header: dict[str, Any] = dict(header_of(chart))
    rows = [_row(row, chart.word_order) for row in chart.rows]
    text: str = yaml.safe_dump(
        {**header, "address_base": 0, _ROWS: rows}, allow_unicode=True, sort_keys=False, width=120
    )
    return text


def _rows(rows: list[Any], file: str) -> Iterator[tuple[int, Mapping[str, object]]]:
    for number, row in enumerate(rows, 1):
        if not isinstance(row, Mapping):
            raise MapError(f"{file}: row {number}: expected a mapping of columns")
        cells = {str(key).lower(): _plain(value) for key, value in row.items()}
        yield number, cells


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _TEXT_STATES.get(name, name) if isinstance(name, bool) else name for key, name in value.items()}
    return value


def _row(value: MappedValue, order: str) -> dict[str, Any]:
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
