"""What values of four registers are told from: two of two registers side by side, a float among others."""

import numpy as np
import pytest

from analyzer.registers.evidence import block_evidence
from analyzer.registers.hypotheses import HYPOTHESES

READINGS = 60
RNG = np.random.default_rng(5)
COUNTER = 40_000 + np.cumsum(RNG.integers(1, 60, READINGS))


def words_of(numbers, form):
    """A series as registers, high words first."""
    return np.asarray(numbers).astype(f">{form}").view(">u2").reshape(READINGS, -1).astype(np.uint16)


def absurd(words, *, is_float, order="ABCD"):
    (found,) = block_evidence([(words if order == "ABCD" else words[:, ::-1], READINGS)])
    wide = next(n for n, h in enumerate(HYPOTHESES) if (h.words, h.is_float, h.order) == (4, is_float, order))
    return bool(found.absurd[wide][0])


@pytest.mark.parametrize("order", ["ABCD", "CDAB"])
@pytest.mark.parametrize(
    ("numbers", "form", "is_one"),
    [
        (COUNTER, "u8", True),
        (COUNTER * 90_000, "u8", True),
        (-COUNTER, "i8", True),
        ((19 << 32) + COUNTER % 40_000, "u8", False),  # two of 32 bits, of which the first stands still
        ((COUNTER // 50 << 32) + 7, "u8", False),
    ],
)
def test_a_word_at_zero_or_at_rest_below_another_is_of_two_numbers(numbers, form, is_one, order):
    assert absurd(words_of(numbers, form), is_float=False, order=order) == (not is_one)


@pytest.mark.parametrize("order", ["ABCD", "CDAB"])
def test_digits_behind_those_that_change_are_anything(order):
    smooth = 230 + np.cumsum(RNG.normal(0, 0.3, READINGS))
    assert not absurd(words_of(smooth, "f8"), is_float=True, order=order)
    assert not absurd(words_of(np.round(smooth * 4) / 4, "f8"), is_float=True, order=order)
    beside = words_of(smooth * 1e6, "f8")
    beside[:, 2] = 65_470  # a register of its own that stands still, and one that moves a little
    beside[:, 3] = RNG.integers(0, 4, READINGS)
    assert absurd(beside, is_float=True, order=order)
