"""Our own forms: the flat table as CSV, and YAML."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from ..table import read_table
from ..yamlform import read_yaml
from .source import ImportedMap, MapSource, mappings

NAME = "a map of our own form"
_SIGNS: Final = re.compile("[,;\t]")


def recognises(source: MapSource) -> bool:
    """A list `registers` in YAML, or a row of our column names."""
    if isinstance(source.yaml, Mapping):
        rows = source.yaml.get("registers")
        keys = {key for row in mappings(rows) for key in row}
        own = {"area"} if source.json is not None else {"area", "type"}  # JSON is of other programs
        return isinstance(rows, list) and not (keys and keys.isdisjoint(own))
    lines = filter(str.strip, source.text.lower().splitlines())
    head = next((line for line in lines if not line.lstrip(' "').startswith("#")), "")
    return {"address", "name", "area", "type"} <= {name.strip(' "') for name in _SIGNS.split(head)}


def read(source: MapSource) -> list[ImportedMap]:
    """The map as it stands."""
    is_yaml = isinstance(source.yaml, Mapping) and "registers" in source.yaml
    return [ImportedMap((read_yaml if is_yaml else read_table)(source.text, source.name))]
