"""Values that stand still: told by the whole unit, and never of a bus that is well."""

from __future__ import annotations

import numpy as np
import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.suspects.values import _altogether
from analyzer.core import analyse
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture


@pytest.mark.parametrize(("seed", "unit"), [(14001, 22), (21003, 28), (21004, 219)])
def test_a_unit_none_of_whose_registers_moves_is_told_though_its_sisters_move_unlike_each_other(
    seed: int, unit: int
) -> None:
    made = field_cases()["frozen-values"].capture("precise", seed)
    ledger = ledger_of(
        ((part.batch, part.transactions) for part in analyse(Capture.of(made.line, made.chunks))), made.line
    )
    assert [(cause.cause, cause.units) for cause in causes_of(ledger)] == [("frozen-values", (unit,))]


def test_one_register_that_moves_or_few_that_do_in_sisters_say_nothing() -> None:
    still, lively = np.zeros((60, 8), np.bool_), np.full((3, 8), 0.2)
    assert _altogether(still, lively)
    one = still.copy()
    one[50, 3] = True
    assert not _altogether(one, lively)
    assert not _altogether(still, lively[:1])
    assert not _altogether(still, lively * (np.arange(8) < 5))
