"""Answers that the client takes for those to another request: its values stand under the wrong registers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from ...deframing.queues import LEAD_BITS
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ...tables.schema import Kind
from ..view import DiagnosisStep, where

_SURE: Final = 1 - 0.5**LEAD_BITS  # at the least: what leads by less is unsure

SHIFTED: Final = Rule(
    "shifted-answer",
    Severity.ERROR,
    About.FRAME,
    when="the client takes an answer for that to another request",
    clause="[2] 2.4.1",
    numbers=("unit", "request", "taken_for", "sure"),
    loses=True,
    text="unit {unit:.0f} answers frame {request:.0f}, and the client takes it for the answer to frame "
    "{taken_for:.0f}: it stores these values under the wrong registers",
    cause="an answer came late or twice; answers carry no register address, so each following one is taken for the "
    "next request's answer",
    remedy="make the client wait longer than the unit's slowest answer and discard late bytes before asking again; do "
    "not trust this unit's values until then",
)


@looks_for(SHIFTED)
def shifted_answers(view: DiagnosisStep) -> Iterator[Findings]:
    """Rows that say so; of those of which nobody can tell whose they are nothing is said."""
    rows = view.rows
    displaced = where((rows.taken_for_start >= 0) & (rows.request >= 0))
    if len(displaced):
        taken = [_taken_for(view, row) for row in displaced.tolist()]
        yield SHIFTED.on(rows[displaced], rows.unit[displaced], rows.request[displaced], np.array(taken), _SURE)


def _taken_for(view: DiagnosisStep, row: int) -> int:
    """The index of the request that the client takes an answer for."""
    start, unit = int(view.rows.taken_for_start[row]), int(view.rows.unit[row])
    for before in view.trail.back(view.batch, row):
        if before.row.kind == Kind.REQUEST and before.row.start == start and before.row.unit == unit:
            return before.row.index
    return -1
