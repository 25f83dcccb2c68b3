"""What an import found, written so that a test reads as the table that it is about."""

from __future__ import annotations

import re

from dissectors.maps.importers import import_maps
from dissectors.maps.importers.builder import ImportedMap

OddFile = tuple[str, bytes, list[str], str]
"""A file's name and content, the rows expected of it (`row_texts`), and a note (pattern) or nothing."""


def row_texts(imported: ImportedMap) -> list[str]:
    """The rows of an imported map, a text each, with only what is not the usual."""
    texts = []
    for row in imported.chart.rows:
        states = "; ".join(f"{state}={name}" for state, name in row.values.items())
        parts = (
            row.area, row.address, row.type, row.order if row.order != "ABCD" and row.length > 1 else "",
            f"x{row.scale:g}" if row.scale != 1 else "", f"+{row.offset:g}" if row.offset else "", row.unit,
            row.access, f"{{{states}}}" if states else "", row.name,
        )  # fmt: skip
        texts.append(" ".join(str(part) for part in parts if part != ""))
    return texts


def check_import(odd: OddFile) -> None:
    """The one map in the file has the rows expected, and the note is among what its reader says."""
    file, data, expected, note = odd
    (found,) = import_maps(file, data)
    assert row_texts(found) == expected
    if note:
        assert any(re.search(note, said) for said in found.notes), found.notes
