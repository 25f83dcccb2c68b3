"""Registers that a text says a line each."""

from __future__ import annotations

from typing import Final

from ..lines import line_sheets
from .source import ImportedMap, MapSource
from .tables import first_chart

NAME = "lines of registers"
_MOST: Final = 20_000


def read(source: MapSource) -> list[ImportedMap] | None:
    """One map of all lines."""
    return first_chart(source, line_sheets(source.text, _MOST))
