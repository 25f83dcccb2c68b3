"""Damage in step with the mains: found in captures of any length, at a cost that does not grow with it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from analyzer.causes import bits
from analyzer.causes.bits import phase_bits
from analyzer.causes.flatmemory import CrowdedTimes

WEEK = 7 * 86400.0
MAINS = ((49.85, 50.15), (99.7, 100.3), (59.82, 60.18), (119.64, 120.36))
SURE = 14.0


def kept(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """What is remembered of hits (s)."""
    crowd = CrowdedTimes()
    crowd.add(np.sort(times) * 1e9 + 1.7e18)
    return crowd.numbers / 1e9


@pytest.mark.parametrize(
    ("hits", "span"), [(40, 120.0), (60, 600.0), (15_000, 86400.0), (15_000, WEEK), (200_000, WEEK)]
)
def test_what_keeps_step_is_found(hits: int, span: float) -> None:
    random = np.random.default_rng(hits)
    times = np.round(random.uniform(0, span, hits) * 50.012) / 50.012 + random.normal(0, 8e-4, hits)
    found = phase_bits(kept(times), *MAINS[0])
    assert found.bits > SURE
    assert found.frequency == pytest.approx(50.012, abs=0.02)
    assert 0.8 < found.alike <= 1


def test_a_mains_that_wanders_is_found_in_a_week() -> None:
    random = np.random.default_rng(3)
    times = np.sort(random.uniform(0, WEEK, 15_000))
    frequency = 50 + 0.02 * np.sin(times / 300)
    turns = np.cumsum(np.diff(times, prepend=0.0) * frequency)
    times = times - (turns - np.round(turns)) / frequency + random.normal(0, 8e-4, len(times))
    assert phase_bits(kept(times), *MAINS[0]).bits > SURE


@pytest.mark.parametrize(("hits", "span"), [(2, 1.0), (30, 60.0), (300, 600.0), (15_000, WEEK)])
def test_what_keeps_no_step_is_not(hits: int, span: float) -> None:
    random = np.random.default_rng(hits)
    for _ in range(5):
        times = kept(random.uniform(0, span, hits))
        assert max(phase_bits(times, low, high).bits for low, high in MAINS) < SURE / 2


@pytest.mark.parametrize("span", [3600.0, 86400.0, WEEK, 52 * WEEK])
def test_a_long_capture_costs_no_more(span: float, monkeypatch: pytest.MonkeyPatch) -> None:
    phases, powers = [], bits._powers

    def counted(
        times: NDArray[np.float64], starts: NDArray[np.int64], frequencies: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        phases.append(len(times) * len(frequencies))
        return powers(times, starts, frequencies)

    monkeypatch.setattr(bits, "_powers", counted)
    random = np.random.default_rng(1)
    for low, high in MAINS:
        phase_bits(kept(random.uniform(0, span, 15_000)), low, high)
    assert sum(phases) < 15_000_000


@given(
    st.lists(st.integers(0, 2_000_000_000_000), max_size=60).map(sorted),
    st.integers(1, 60),
    st.integers(1, 50),
)
def test_times_are_remembered_alike_in_whatever_portions(times: list[int], portion: int, repeated: int) -> None:
    stream = np.repeat(np.array(times, np.int64), repeated)
    whole, pieces = CrowdedTimes(), CrowdedTimes()
    whole.add(stream)
    for at in range(0, len(stream), portion):
        pieces.add(stream[at : at + portion])
    assert pieces.numbers.tolist() == whole.numbers.tolist()
    assert len(whole.numbers) <= 1280
    assert np.isin(whole.numbers, stream.astype(np.float64)).all()


def test_nothing_and_all_at_once_keep_no_step() -> None:
    assert phase_bits(np.zeros(0), *MAINS[0]) == (0.0, 0.0, 0.0)
    assert phase_bits(np.full(9, 5.0), *MAINS[0]) == (0.0, 0.0, 0.0)
