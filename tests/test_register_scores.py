"""The layouts on which inference of registers is fitted, and floors of its score on devices never fitted."""

from itertools import pairwise
from random import Random

import numpy as np
import pytest
from scripts import package

from analyzer.registers.evidence import shipped_weights
from analyzer.registers.readings import RegisterReadings

layouts = package("register_layouts")
series = package("register_series")
scores = package("register_scores")


def test_published_layouts_are_layouts():
    published = layouts.published_layouts()
    assert len(published) > 90 and set(published) < set(series.layouts())
    for name, chart in published.items():
        assert chart.rows and chart.vendor, name
        for area in ("input", "holding"):
            rows = sorted((row for row in chart.rows if row.area == area), key=lambda row: row.address)
            assert all(row.end <= after.address for row, after in pairwise(rows)), (name, area)
            assert not rows or rows[-1].end <= 0x10000, name


def test_a_stretch_of_a_published_layout():
    rows = layouts.stretch_values(layouts.stretch_of("input 10 V*3 _2 P/PV1:x0.1:kW state bits:u32 E:u64*2"), "CDAB")
    assert [(row.address, row.type, row.length) for row in rows] == [
        (10, "u16", 1), (11, "u16", 1), (12, "u16", 1), (15, "s32", 2), (17, "enum", 1), (18, "u32", 2),
        (20, "u64", 4), (24, "u64", 4),
    ]  # fmt: skip
    assert [row.name for row in rows[:4]] == ["voltage L1", "voltage L2", "voltage L3", "power PV1"]
    assert (rows[3].scale, rows[3].unit, rows[3].order, rows[0].order) == (0.1, "kW", "CDAB", "ABCD")
    with pytest.raises(ValueError, match="'V-3' is no token"):
        layouts.stretch_values(layouts.stretch_of("input 10 V-3"), "ABCD")


def test_a_single_register_within_a_wide_value_is_no_right_answer(monkeypatch):
    readings = RegisterReadings()
    readings.put(1, "input", 10, np.stack((np.zeros(60), np.arange(60) * 7 % 50), axis=1).astype(np.uint16))
    (row,) = layouts.stretch_values(layouts.stretch_of("input 10 E"), "ABCD")
    device = series.MadeDevice("meter", "maker", "ABCD", readings, (("input", 10, 2, (row,)),))
    singles = np.zeros((2, 9))
    singles[:, 0] = 1.0
    monkeypatch.setattr(scores, "run_posteriors", lambda _runs, _weights: [singles])
    tally = scores.Tally()
    scores.tallied(device, shipped_weights(), tally)
    assert tally.sure == [(1.0, False)]
    assert (tally.due["one word"], tally.right["one word"], tally.error()) == (1, 0, 1.0)


def test_devices_never_fitted_are_read_as_well_as_the_pages_say():
    """Three devices of each of the hard layouts, at other addresses; `docs/registers.md` has the figures of twelve."""
    weights, tally = shipped_weights(), scores.Tally()
    for path in sorted((series.LAYOUTS / "unseen").glob("*.csv")):
        chart = series.read_map(path)
        for seed in range(7000, 7003):
            device = series.made_device(path.stem, chart, Random(f"{path.stem} {seed}"), 60)
            scores.tallied(device, weights, tally)
    share = {kind: tally.right[kind] / due for kind, due in tally.due.items()}
    assert share["all"] > 0.89
    assert share["16-bit"] > 0.95
    assert share["float"] > 0.98
    assert share["one word"] > 0.65
    assert tally.two / tally.due["all"] > 0.985  # what cannot be told is among two readings
    assert tally.error() < 0.035


def test_other_devices_of_published_layouts_are_read_right():
    """One device of each, filled by the hand that the tables know less of."""
    weights, tally = shipped_weights(), scores.Tally()
    for name, chart in layouts.published_layouts().items():
        device = series.made_device(name, chart, Random(f"{name} 7000"), 60, another=1.0)
        scores.tallied(device, weights, tally)
    share = {kind: tally.right[kind] / due for kind, due in tally.due.items()}
    assert share["all"] > 0.91
    assert share["16-bit"] > 0.96
    assert share["one word"] > 0.78
    assert tally.error() < 0.02
