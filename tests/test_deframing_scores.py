"""How well captures with known truth are read: the shared corpus where it is present, and the simulator's seeds."""

from __future__ import annotations

from pathlib import Path

import pytest
from buses import SHARED, shared
from scripts import script

from analyzer.simulation import Scenario, write

bench = script("score_corpus")

# (F1, direction, pairing) that is reached, of the shared captures that are not read perfectly: no digit may be lost
REACHED = {
    "brutal-gateway": (1.0, 0.99834, 0.99593),
    "brutal-irq": (1.0, 0.99681, 0.99245),
    "brutal-precise": (1.0, 0.99835, 0.99595),
    "brutal-untimed": (0.99916, 1.0, 0.9959),  # of one answer nobody can tell whose it is, and that is said
}
# wire: the same that a capture of a fresh seed must reach
FLOORS = {
    "clean": (1.0, 1.0, 1.0),
    "hard": (1.0, 0.999, 0.999),
    "slow": (1.0, 1.0, 1.0),
    "broadcast": (1.0, 1.0, 1.0),
    "noisy": (0.9995, 0.99, 0.99),
    "glitch": (0.999, 0.99, 0.99),
    "vendor": (0.998, 0.99, 0.99),
    "brutal": (0.99, 0.99, 0.95),
}
_corpus = sorted(p.stem for p in SHARED.glob("corpus/simulated/*.jsonl") if ".truth" not in p.suffixes)
_real = sorted(p.stem for p in SHARED.glob("corpus/real/*.jsonl") if ".truth" not in p.suffixes)


def check(path: Path, floors: tuple[float, float, float]) -> None:
    f1, direction, pairing = floors
    result = bench.score(bench.load(path.with_suffix(".truth.jsonl")), bench.predictions(path))
    assert result.f1 >= f1, result
    assert result.direction >= direction, result
    assert result.pairing >= pairing, result


@pytest.mark.parametrize("name", _corpus or ["clean-precise"])
def test_the_shared_simulated_captures(name: str) -> None:
    check(shared(f"corpus/simulated/{name}.jsonl"), REACHED.get(name, (1.0, 1.0, 1.0)))


@pytest.mark.parametrize("name", _real or ["pymodbus_rtu"])
def test_the_shared_real_captures_every_frame_and_nothing_false(name: str) -> None:
    path = shared(f"corpus/real/{name}.jsonl")
    result = bench.score(bench.load(path.with_suffix(".truth.jsonl")), bench.predictions(path))
    assert (result.missed, result.false) == (0, 0)
    assert result.direction in (None, 1.0)


@pytest.mark.parametrize("seed", [101, 102])
@pytest.mark.parametrize(
    ("wire", "tap"),
    [
        ("clean", "gateway"), ("clean", "ftdi16"), ("hard", "precise"), ("hard", "untimed"), ("slow-slave", "irq"),
        ("broadcast", "irq"), ("noisy", "precise"), ("glitch", "irq"), ("vendor", "irq"), ("brutal", "precise"),
        ("brutal", "irq"), ("brutal", "ftdi16"),
    ],
)  # fmt: skip
def test_captures_that_nobody_tuned_for(wire: str, tap: str, seed: int, tmp_path: Path) -> None:
    path = tmp_path / f"{wire}-{tap}.jsonl"
    write(Scenario(wire, tap, transactions=250, seed=seed), path)
    check(path, FLOORS[wire.split("-")[0]])
