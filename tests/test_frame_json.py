"""`Frame.to_json` says the same whether frames are asked for in order, here and there, or one alone."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

import analyzer
from analyzer.simulation import Scenario, write
from analyzer.tables.frame import Frame


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    path = tmp_path_factory.mktemp("bus") / "bus.jsonl"
    write(Scenario("noisy", "irq", seed=5), path)
    return list(analyzer.open(path).frames())


def alone(frame: Frame) -> Frame:
    return replace(frame, told=None)


def test_asked_in_order(frames: list[Frame]) -> None:
    assert len(frames) > 100
    for frame in frames:
        assert frame.to_json() == alone(frame).to_json()
        assert list(frame.to_json()) == list(alone(frame).to_json())


def test_asked_here_and_there(frames: list[Frame]) -> None:
    chosen = random.Random(1)
    for start in (0, 40, 7):
        for frame in [*frames[start : start + 30], *chosen.sample(frames, 30)]:
            assert frame.to_json() == alone(frame).to_json()


def test_changes_stay_with_who_makes_them(frames: list[Frame]) -> None:
    for frame in frames[:20]:
        line = frame.to_json()
        line["fields"].clear()
        assert frame.to_json()["fields"]


def test_without_fields(frames: list[Frame]) -> None:
    for frame in frames[:20]:
        plain = alone(frame).to_json()
        del plain["fields"]
        assert frame.to_json(fields=False) == plain
