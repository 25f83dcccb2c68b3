"""Healthy devices with maps: what their values do is no cause of anything."""

from __future__ import annotations

from pathlib import Path

import pytest

import analyzer
from analyzer.simulation import Scenario, write
from dissectors.maps import shipped_names

NAMES = shipped_names()


@pytest.mark.parametrize("first", range(0, len(NAMES), 9))
def test_no_healthy_device_is_accused(first: int, tmp_path: Path) -> None:
    maps = tuple(f"{name}@{unit}" for unit, name in enumerate(NAMES[first : first + 3], 1))
    path = tmp_path / "bus.jsonl"
    write(Scenario("clean", "precise", transactions=700, seed=first, maps=maps), path)
    assert [cause.text for cause in analyzer.open(path).causes()] == [], maps
