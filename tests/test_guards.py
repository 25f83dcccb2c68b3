"""The guards against growth by cases: versions compared, decisions switched off, rooms held to their limits."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "benchmarks"))

ablate: ModuleType = importlib.import_module("ablate")
density: ModuleType = importlib.import_module("density")
ecosystem: ModuleType = importlib.import_module("ecosystem")


def test_each_fact_that_differs_is_a_line():
    old = {("frames", "a", "0@0"): "8 rtu", ("causes", "a", "1"): "bias"}
    new = {("frames", "a", "0@0"): "7 rtu", ("frames", "a", "0@7"): "noise of 1", ("causes", "a", "1"): "bias"}
    assert list(ecosystem.differences(old, new)) == [
        ("frames", "frames a 0@0: 8 rtu -> 7 rtu"),
        ("frames", "frames a 0@7: nothing -> noise of 1"),
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="the worker forks")
def test_what_a_version_says_is_compared_fact_by_fact(tmp_path: Path):
    text = tmp_path / "paste.txt"
    text.write_text("RX 11 03 00 6B 00 03 76 87\n")
    samples = [("made/paste.txt", text)]
    kinds = ["frames", "directions", "causes", "pastes"]
    whole = ecosystem.told_by(ecosystem.facts(ROOT, samples, kinds))
    assert whole[("pastes", "made/paste.txt", "1103006b00037687 #1")] == "rtu request True"
    text.write_text("RX 11 03 00 6B 00 03 76 86\n")
    damaged = ecosystem.told_by(ecosystem.facts(ROOT, samples, kinds))
    changed = dict(ecosystem.differences(whole, damaged))
    assert {"frames", "pastes"} <= changed.keys()


def test_a_sample_stays_in_its_half():
    names = [f"made/{number}" for number in range(200)]
    halves = [ecosystem.fold_of(name) for name in names]
    assert halves == [ecosystem.fold_of(name) for name in names]
    assert 60 < halves.count("fit") < 140


@pytest.mark.parametrize(
    ("source", "place", "without"),
    [
        ("if a:\n    b()\n", (1, 3), "if False:\n    b()"),
        ("x = 1 if a else 2", (1, 9), "x = 1 if False else 2"),
        ("x = a and b and c", (1, 10), "x = a and c"),
        ("x = [i for i in y if i if j]", (1, 21), "x = [i for i in y if j]"),
    ],
)
def test_a_decision_is_switched_off(source: str, place: tuple[int, int], without: str):
    import ast

    assert ast.unparse(ablate.switched_off(source, *place)) == without


def test_a_place_without_a_decision_is_refused():
    with pytest.raises(ValueError, match="no decision at 1:0"):
        ablate.switched_off("x = 1", 1, 0)


def test_a_room_beyond_its_limits_is_named():
    room = density.room_of({"a.py": "def f(x):\n    return x if x and x > 1 else 2\n"})
    assert room.limits == (1000, 3, 0)
    assert list(density.passed({"a": room}, {"a": [999, 3, 0]})) == ["a: 1000 decisions, at most 999 (a.py:f)"]
    assert "[999, 3, 0]" in density.lowered({"a": room}, {"a": [999, 9, 0]})
