"""Registers that a text says a line each."""

from __future__ import annotations

from typing import Final

from ..lines import line_sheets
from .source import ImportedMap, MapSource
from .tables import chart_of

NAME = "lines of registers"
_MOST: Final = 20_000


def read(source: MapSource) -> list[ImportedMap] | None:
    """One map of all lines, read in the way that tells most."""
    charts = [chart_of(source, sheet) for sheet in line_sheets(source.text, _MOST)]
    best = max(filter(None, charts), key=lambda chart: chart.facts, default=None)
    return None if best is None else [best]
