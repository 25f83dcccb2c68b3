"""Our own forms: the flat table as CSV, and YAML."""

from __future__ import annotations

from collections.abc import Mapping

from ..table import read_table
from ..yamlform import read_yaml
from .source import ImportedMap, MapSource

NAME = "a map of our own form"


def recognises(source: MapSource) -> bool:
    """A list `registers` in YAML, or a row of our column names."""
    if not source.is_text:
        return False
    if isinstance(source.yaml, Mapping):
        rows = source.yaml.get("registers")
        keys = {key for row in rows if isinstance(row, Mapping) for key in row} if isinstance(rows, list) else set()
        own = {"area"} if source.json is not None else {"area", "type"}  # JSON is of other programs
        return isinstance(rows, list) and (not keys or bool(own & keys))
    lines = [line.lower() for line in source.text.splitlines() if line.strip() and not line.lstrip('"').startswith("#")]
    names = (
        {name.strip().strip('"') for name in lines[0].replace(";", ",").replace("\t", ",").split(",")}
        if lines
        else set()
    )
    return {"address", "name", "area", "type"} <= names


def read(source: MapSource) -> list[ImportedMap]:
    """The map as it stands."""
    is_yaml = isinstance(source.yaml, Mapping) and "registers" in source.yaml
    return [ImportedMap((read_yaml if is_yaml else read_table)(source.text, source.name))]
