"""Our own forms: the flat table as CSV, and YAML."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from ..cells import COLUMN_NAMES
from ..table import read_table
from .source import ImportedMap, MapSource, mappings

NAME = "a map of our own form"
_SIGNS: Final = re.compile("[,;\t]")
_COLUMNS: Final = frozenset(COLUMN_NAMES)


def read(source: MapSource) -> list[ImportedMap] | None:
    """The map as it stands, where YAML has a list `registers` or a table a row of our column names."""
    if isinstance(source.yaml, Mapping):
        from ..yamlform import read_yaml

        rows = source.yaml.get("registers")
        keys = {key for row in mappings(rows) for key in row}
        fits = {"area", "address"} <= keys or (source.json is None and keys <= _COLUMNS)  # JSON is of other programs
        is_own = isinstance(rows, list) and fits
        return [ImportedMap(read_yaml(source.text, source.name))] if is_own else None
    lines = filter(str.strip, source.text.lower().splitlines())
    head = next((line for line in lines if not line.lstrip(' "').startswith("#")), "")
    is_own = {"address", "name", "area", "type"} <= {name.strip(' "') for name in _SIGNS.split(head)}
    return [ImportedMap(read_table(source.text, source.name))] if is_own else None
