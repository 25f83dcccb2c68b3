"""What register maps say of values: that they stay in their limits."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from captures.line import LineSettings

from ...languages import counted, page_words
from ...registers.mapped import limits_broken, mapped_columns
from ...reports import Report
from ...reports.page import unknown
from ..model import CHARTS, Breaches, CheckedBatch, RuleResult, Start, form

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps


class _Limits:
    """Counts readings that lie outside the least and the greatest value of their map."""

    def __init__(self, charts: UnitMaps | None) -> None:
        self._charts = charts
        self._breaches = Breaches()
        self._examined = 0

    def feed(self, checked: CheckedBatch) -> None:
        for column in mapped_columns(checked.batch, checked.decoded, self._charts or {}):
            row = column.row
            if row.minimum is None and row.maximum is None:
                continue
            self._examined += len(column.answers)
            for number in np.flatnonzero(limits_broken(column)).tolist():
                text = page_words(
                    "{name} is {value:g} {unit}", name=row.name, value=column.values[number], unit=row.unit
                )
                text = text.rstrip()
                self._breaches.add(column.answers[number : number + 1], partial(checked.place, text=text))

    def verdict(self, report: Report) -> RuleResult:  # noqa: ARG002
        if not self._charts:
            return RuleResult(False, unknown("it needs a register map (--map)"))
        if not self._examined:
            return RuleResult(False, unknown("no value that has limits was read"))
        count = self._breaches.count
        return RuleResult(
            not count,
            page_words("{readings} outside", readings=counted(count, "reading", "readings")),
            tuple(self._breaches.first),
        )


@form("values-in-limits", '"values"i "in"i "their"i "limits"i',
      "every value that has limits in its register map (--map) lies in them", "values in their limits")  # fmt: skip
def values_in_limits(line: LineSettings) -> Start:  # noqa: ARG001
    charts = CHARTS.get()
    return lambda: _Limits(charts)
