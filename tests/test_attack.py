"""The campaign of attacks, short: what `benchmarks/attack` finds in a minute must hold."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from scripts import package

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs POSIX")


@pytest.mark.parametrize(
    ("only", "count"),
    [
        ("reader", 30),
        ("text", 100),  # also of the reader of texts
        ("filters,rules", 200),
        ("rule files,settings,preferences,given,notes", 500),
        ("states", 100),
        ("analysis,exporters,report", 24),
    ],
)
def test_no_input_of_the_fuzz_harms(only: str, count: int) -> None:
    """Inputs are counted and their CPU time is: how fast this machine is today is no matter of tests."""
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


def test_a_campaign_goes_on_where_its_account_ends(tmp_path: Path) -> None:
    account, fuzz, path = package("attack.account"), package("attack.fuzz"), tmp_path / "account.jsonl"
    for first, count, failures in ((0, 40, []), (40, 2, ["bad"])):
        account.add(path, account.Entry("notes beside", 7, first, count, "abc", 1.5, 0.2, 40.0, failures))
    with path.open("a") as file:
        file.write('{"target": "notes be')  # cut by a power failure
    assert account.reached(account.entries(path), "notes beside", 7) == 42
    outcome = fuzz.campaign(7, 50, path, only="notes beside", most=9)
    assert outcome.tried == 51
    assert outcome.failures == ["bad"]
    assert [(entry.first, entry.count) for entry in account.entries(path)] == [(0, 40), (40, 2), (42, 9)]
    assert "51 inputs" in list(account.told(account.entries(path)))[-1]


def test_damage_costs_what_it_hit() -> None:
    outcome = package("attack.damage").attack(1, 40)
    assert not outcome.failures, outcome.failures[0]


def test_a_recorder_weathers_storms() -> None:
    outcome = package("attack.storms").attack(1, 6)
    assert not outcome.failures, outcome.failures[0]


def test_taps_and_viewers_hold_against_hostile_ones() -> None:
    outcome = package("attack.taps").attack(1, 40)
    assert not outcome.failures, outcome.failures[0]
