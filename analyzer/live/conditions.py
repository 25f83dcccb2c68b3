"""A filter asked row by row while the bus goes on: what to show, when to stop, what triggers."""

from __future__ import annotations

import numpy as np

from captures.line import LineSettings
from dissectors.maps.units import UnitMaps

from ..filters import compile_filter
from ..filters.table import BatchTable
from .recent import ShownRow
from .session import SessionStep


class Condition:
    """One filter. What became of a request is known once its answer came; later findings ask it again."""

    def __init__(self, text: str, charts: UnitMaps | None = None) -> None:
        """FilterError says where `text` is no filter; `charts` are the maps that names in it come from."""
        self._filter = compile_filter(text, charts=charts)
        self._origin: int | None = None
        self._of: object = None
        self._mask: np.ndarray[tuple[int], np.dtype[np.bool_]] = np.zeros(0, np.bool_)

    def holds(self, shown: ShownRow, step: SessionStep, line: LineSettings) -> bool:
        """Whether this row passes, by what is known of it now."""
        if self._of is not shown.batch:
            if self._origin is None:
                self._origin = int(shown.batch.rows.t_start_ns[0])
            table = BatchTable(shown.batch, line, transactions=step.analysed.transactions, origin_ns=self._origin)
            self._of, self._mask = shown.batch, self._filter.mask(table)
        return bool(self._mask[shown.row])
