"""Percentiles in flat memory agree with exact ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer.reports.percentiles import Histogram


def test_nothing_counted_has_no_percentiles():
    assert Histogram().times().count == 0
    assert Histogram().times().p50_ns is None


def test_one_value_is_every_percentile():
    histogram = Histogram()
    histogram.add(np.array([12_345_678]))
    times = histogram.times()
    assert (times.min_ns, times.p50_ns, times.p99_ns, times.max_ns) == (12_345_678,) * 4


@given(st.lists(st.integers(1_000, 10**12), min_size=1, max_size=300), st.integers(1, 5))
def test_percentiles_are_within_a_percent_of_the_exact_ones(values, parts):
    histogram = Histogram()
    for piece in np.array_split(np.array(values), min(parts, len(values))):
        histogram.add(piece)
    times = histogram.times()
    assert times.count == len(values)
    assert (times.min_ns, times.max_ns) == (min(values), max(values))
    for share, got in ((0.50, times.p50_ns), (0.95, times.p95_ns), (0.99, times.p99_ns)):
        exact = int(np.percentile(values, share * 100, method="inverted_cdf"))
        assert got == pytest.approx(exact, rel=0.011)


def test_times_off_the_scale_are_counted():
    histogram = Histogram()
    histogram.add(np.array([0, 5, 10**15]))
    times = histogram.times()
    assert (times.count, times.min_ns, times.max_ns) == (3, 0, 10**15)
