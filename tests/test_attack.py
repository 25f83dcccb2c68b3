"""The campaign of attacks, short: what `benchmarks/attack` finds in a minute must hold."""

from __future__ import annotations

import os

import pytest
from scripts import package

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs POSIX")


@pytest.mark.parametrize(
    "only", ["reader", "text", "filters", "rules", "rule files", "notes beside", "analysis", "exporters", "report"]
)
def test_no_input_of_the_fuzz_harms(only: str) -> None:
    """Patient: how fast this machine is today is no matter of tests."""
    count = 8 if only in ("analysis", "exporters", "report") else 100
    outcome = package("attack.fuzz").attack(1, count, only=only, patience=10)
    assert not outcome.failures, outcome.failures[0]
    assert outcome.tried


def test_the_fuzz_sees_what_is_wrong() -> None:
    """A target that raises what nobody tells, or takes too long, is a failure that names its input."""
    fuzz, targets = package("attack.fuzz"), package("attack.targets")

    def harm(*_: object) -> None:
        raise ValueError("min() arg is an empty sequence")

    def careful(*_: object) -> None:
        raise OSError("told")

    bad = targets.Target("bad", lambda: (b"1234",), harm, (OSError,))
    good = targets.Target("good", lambda: (b"1234",), careful, (OSError,))
    slow = targets.Target("slow", lambda: (b"1234",), lambda *_: sum(range(10**6)), seconds=1e-9)
    assert "ValueError" in fuzz._one(bad, 1, 0)[0]
    assert fuzz._one(good, 1, 0)[0] == ""
    assert "bytes: 0." in fuzz._one(slow, 1, 0)[0]


def test_damage_costs_what_it_hit() -> None:
    outcome = package("attack.damage").attack(1, 40)
    assert not outcome.failures, outcome.failures[0]


def test_a_recorder_weathers_storms() -> None:
    outcome = package("attack.storms").attack(1, 6)
    assert not outcome.failures, outcome.failures[0]
