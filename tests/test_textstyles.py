"""Texts drawn from the grammar of styles are what their truth says, and as many are read right as ever were."""

from __future__ import annotations

from scripts import script

from analyzer.deframing.judging import envelope_of

styles, score = script("textstyles"), script("score_text")
TEXTS = 60


def test_a_seed_gives_one_text_and_halves_share_no_row() -> None:
    for table in (styles.STAMPS, styles.SPEAKERS, styles.WRITINGS, styles.TAILS, styles.EVERYDAY):
        fit, held = (set(styles.half([*table], which)) for which in ("fit", "held"))
        assert fit | held == set(table) and not fit & held
    assert styles.drawn(5, "held") == styles.drawn(5, "held")
    assert len({styles.drawn(seed, "held").text for seed in range(TEXTS)}) == TEXTS


def test_whole_frames_have_right_check_values_and_damaged_ones_none() -> None:
    kinds = set()
    for seed in range(TEXTS):
        for said in styles.drawn(seed).said:
            kinds.add(said.kind)
            data = said.data[said.kind == "behind a stray" :]
            assert (envelope_of(data) is None) == (said.kind == "damaged")
    assert kinds == {"frame", "damaged", "behind a stray"}


def test_styles_that_nothing_was_fitted_on_are_read_no_worse_than_they_were() -> None:
    texts = [styles.drawn(seed, "held") for seed in range(TEXTS)]
    wrong = [one.rows for one in texts if score.wrong_in(one.text, *score.truth_of(one))]
    assert 12 * len(wrong) <= len(texts), wrong
