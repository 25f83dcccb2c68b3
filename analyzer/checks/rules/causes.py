"""What explains the findings: that nothing is wrong with the bus, or with one unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from lark import Token

from captures.line import LineSettings

from ...languages import page_words
from ...reports import Report
from ..forms import Start, form
from ..model import CheckedBatch, RuleResult
from .counts import whole


@dataclass
class _Causes:
    """Counts the causes that concern a unit, or all; notes are no fault."""

    needs_causes: ClassVar[bool] = True
    unit: int | None

    def feed(self, checked: CheckedBatch) -> None:
        pass

    def verdict(self, report: Report) -> RuleResult:
        causes = [cause for cause in report.causes if cause.severity != "note"]
        if self.unit is not None:
            causes = [cause for cause in causes if self.unit in cause.units]
        listed = "; ".join(
            f"{cause.cause} ({page_words('{share:.0%} sure', share=cause.confidence)}): {cause.text}"
            for cause in causes
        )
        return RuleResult(not causes, listed or page_words("none"))


@form("no-causes", '"no"i ("cause"i | "causes"i) ["of"i "unit"i NUMBER]',
      "nothing is wrong with the bus, or with one unit: no cause but notes", "no causes",
      "no cause of unit 7")  # fmt: skip
def no_causes(line: LineSettings, unit: Token | None) -> Start:  # noqa: ARG001
    number = None if unit is None else whole(unit, 255)
    return lambda: _Causes(number)
