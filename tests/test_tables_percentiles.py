"""Percentiles in flat memory agree with exact ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer.tables.bins import Histogram


def test_nothing_counted_has_no_percentiles():
    assert not Histogram()


def test_one_value_is_every_percentile():
    histogram = Histogram()
    histogram.add(np.array([12_345_678]))
    assert [histogram.least, *histogram.quantiles(0.5, 0.99), histogram.most] == [12_345_678] * 4


@given(st.lists(st.integers(1_000, 10**12), min_size=1, max_size=300), st.integers(1, 5))
def test_percentiles_are_within_a_percent_of_the_exact_ones(values, parts):
    histogram = Histogram()
    for piece in np.array_split(np.array(values), min(parts, len(values))):
        histogram.add(piece)
    assert len(histogram) == len(values)
    assert (histogram.least, histogram.most) == (min(values), max(values))
    shares = (0.50, 0.95, 0.99)
    for share, got in zip(shares, histogram.quantiles(*shares), strict=True):
        exact = int(np.percentile(values, share * 100, method="inverted_cdf"))
        assert got == pytest.approx(exact, rel=0.011)


def test_times_off_the_scale_are_counted():
    histogram = Histogram()
    histogram.add(np.array([0, 5, 10**15]))
    assert (len(histogram), histogram.least, histogram.most) == (3, 0, 10**15)
