"""Values that are harmed: told as what they are, of the right unit; and what only looks odd is not."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analyzer.causes.registerstates import PollValues
from analyzer.causes.standstills import standstills
from analyzer.causes.suspects.codes import _lost_of
from analyzer.causes.suspects.counters import _torn
from analyzer.causes.valueforms import FORMS, fit_among, fit_since, swapped_bytes
from analyzer.tables.schema import Int64s

_READS = 120
_SECOND = 1_000_000_000


def _poll(words: Int64s, address: int = 0, unit: int = 1) -> PollValues:
    times = np.arange(len(words), dtype=np.int64) * _SECOND
    return PollValues(unit, 3, address, times, (words % 65536).astype(np.uint16), 1, len(words))


def _measured(seed: int, most: int = 24_000, columns: int = 8) -> Int64s:
    """Values that wander, each about a middle of its own."""
    random, reads = np.random.default_rng(seed), _READS
    middles = np.linspace(300, most, columns)
    slow = np.cumsum(random.normal(0, 0.002, (reads, columns)), axis=0)
    found: Int64s = np.round(middles * (1 + slow)).astype(np.int64) + random.integers(-1, 2, (reads, columns))
    return found


_CHANGES: dict[str, Callable[[Int64s], Int64s]] = {
    "bytes": swapped_bytes,
    "before": lambda words: np.roll(words, -1, axis=1),
    "behind": lambda words: np.roll(words, 1, axis=1),
    "0.1": lambda words: words // 10,
    "0.01": lambda words: words // 100,
}


@pytest.mark.parametrize("form", _CHANGES)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), since=st.integers(30, 90))
def test_a_change_of_form_is_told_with_its_moment(form: str, seed: int, since: int) -> None:
    words = _measured(seed)
    words[since:] = _CHANGES[form](words[since:])
    change = fit_since([_poll(words)])
    assert change is not None
    assert (change.fit.form, change.time) == (form, since * _SECOND)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), by=st.lists(st.sampled_from((1.0, 3.0, 8.0, 0.3, 10.0)), min_size=8, max_size=8))
def test_loads_that_are_switched_are_no_change_of_form(seed: int, by: list[float]) -> None:
    if by.count(10.0) > 1:
        return
    words = _measured(seed)
    words[60:] = np.round(words[60:] * np.array(by)).astype(np.int64)
    assert fit_since([_poll(words)]) is None


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), off=st.integers(30, 80))
def test_a_plant_that_is_switched_off_and_on_changes_no_form(seed: int, off: int) -> None:
    words = _measured(seed)
    words[off : off + 20] = 0
    assert fit_since([_poll(words)]) is None


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_unit_that_holds_what_its_sisters_hold_in_another_form(seed: int) -> None:
    sisters = [[_poll(_measured(seed + i, 2000), unit=i)] for i in range(1, 4)]
    odd = [_poll(swapped_bytes(_measured(seed + 9, 2000)), unit=9)]
    fit = fit_among(odd, sisters)
    assert fit is not None and fit.form in ("bytes", "both")
    assert fit_among(sisters[0], sisters[1:]) is None
    other = [_poll(10 * _measured(seed + 5, 2000)[:, ::-1], unit=5)]  # of another make
    assert fit_among(odd, [sisters[0], other]) is None


def test_every_form_has_words() -> None:
    from analyzer.causes.suspects.forms import _CHANGED, _SWAPPED

    assert set(FORMS) == {*_SWAPPED, *_CHANGED}


def _words(numbers: Sequence[int], late: int) -> Int64s:
    """A number's words, the more significant one so many reads late."""
    low = np.array(numbers) % 65536
    high = np.array([numbers[max(i - late, 0)] for i in range(len(numbers))]) >> 16
    return np.stack((high % 65536, low), axis=1)


@settings(max_examples=20, deadline=None)
@given(rate=st.integers(900, 6000), begin=st.integers(0, 1 << 24), late=st.sampled_from((0, 0, 1, 2)))
def test_words_of_different_moments_are_told_and_those_of_one_are_not(rate: int, begin: int, late: int) -> None:
    numbers = [begin + rate * i for i in range(3 * 65536 // rate + _READS)]
    torn = list(_torn([_poll(_words(numbers, late))]))
    assert bool(torn) == bool(late)
    assert all(each.numbers["torn"] >= 2 for each in torn)


def test_two_words_about_zero_that_cross_it_at_about_one_time_are_no_torn_number() -> None:
    """One follows the other twice, some reads later: that may well be chance."""
    first, second = (np.round(3 * np.cos((np.arange(_READS) - late) / 19)).astype(np.int64) for late in (6, 0))
    torn = list(_torn([_poll(np.stack((np.minimum(first, 0).clip(-1), second), axis=1))]))
    assert all(each.bits < 24 for each in torn)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), turns=st.integers(1, 5))
def test_a_word_about_zero_beside_another_register_is_no_torn_number(seed: int, turns: int) -> None:
    wave = 200 * np.sin(np.linspace(0, 6.28 * turns, _READS)) + np.random.default_rng(seed).normal(0, 9, _READS)
    words = np.stack((np.full(_READS, 7), np.round(wave).astype(np.int64)), axis=1)
    assert not list(_torn([_poll(words)]))


@pytest.mark.parametrize("code", [0x7FFF, 0x8000, 0xFFFF])
def test_a_code_in_the_place_of_a_value_is_told(code: int) -> None:
    words = _measured(3)
    words[40:44, 2] = words[70:73, 2] = code
    (lost,) = _lost_of(_poll(words))
    assert (lost.address, lost.codes, int(lost.lost.sum())) == (2, (f"{code:04X}",), 7)
    assert not list(_lost_of(_poll(_measured(3))))


def test_a_value_that_goes_to_the_end_of_its_range_by_itself_is_no_code() -> None:
    words = _measured(3)
    words[:, 0] = np.minimum(np.arange(_READS) * 400, 0x7FFF)
    words[:, 1] = np.round(40 * np.sin(np.arange(_READS) / 5)).astype(np.int64)  # about 0: FFFF is -1
    words[:, 2] = np.where(np.arange(_READS) // 10 % 2, 0xFFFF, 0)  # a mask
    assert not list(_lost_of(_poll(words)))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), begin=st.sampled_from((-1, 0x7F80, 0x7FC0, 0xFF80)))
def test_a_word_that_wanders_about_a_code_is_no_float_that_is_none(seed: int, begin: int) -> None:
    """Beside another register it would be a float of the exponent that infinities have."""
    random = np.random.default_rng(seed)
    words = np.stack([begin + np.cumsum(random.integers(-1, 2, _READS)), random.integers(0, 400, _READS)], axis=1)
    assert not list(_lost_of(_poll(words)))


def test_values_that_stall_and_leap_are_told_and_a_plant_at_rest_is_not() -> None:
    words = _measured(5) + 40 * np.arange(_READS)[:, None]
    stalled = words.copy()
    stalled[40:70] = words[40]
    (told,), bits = standstills([_poll(stalled)])
    assert (told.since, told.lasts) == (40 * _SECOND, False) and bits > 24
    rests = words.copy()
    rests[40:70], rests[70:] = words[40], words[41:91]  # it goes on from where it stood
    off = words.copy()
    off[40:70] = 0
    assert not [found for each in (rests, off, words) if (found := standstills([_poll(each)])[0])]
