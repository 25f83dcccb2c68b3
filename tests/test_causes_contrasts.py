"""What a symptom hangs on is told by contrasts, what is left is told always, certainty is what it was fitted to be."""

from __future__ import annotations

import re
from functools import lru_cache

import numpy as np
import pytest
from buses import SHARED
from hypothesis import given
from hypothesis import strategies as st
from scripts import package

import captures
from analyzer.causes.certainty import LEAST, MOST, Clues, certainty
from analyzer.causes.contrasts import Family, contrasts
from analyzer.causes.exchanges import Ending, Exchanges
from analyzer.causes.exchangetable import AskedRows, ExchangeTable
from analyzer.causes.ledger import ledger_of
from analyzer.causes.leftovers import TEMPLATES
from analyzer.causes.reasoning import Story, story_of
from analyzer.causes.registry import suspects
from analyzer.causes.sureness import CALIBRATED, how_sure, in_words
from analyzer.causes.traits import TRAITS, Traits, typical
from analyzer.core import analyse
from analyzer.languages import catalogue
from analyzer.simulation.field.bench import FieldCapture
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture

_LARGE, _SMALL = 40, 8


def _rows(count: int, quantities: list[int], rests: list[int] | None = None) -> AskedRows:
    rows = AskedRows.zeros(count)
    rows.time[:] = rows.number[:] = np.arange(count)
    rows.function[:] = 3
    rows.quantity[:] = [quantities[i % len(quantities)] for i in range(count)]
    rows.due[:] = 5 + 2 * rows.quantity
    rows.rest[:] = 10_000_000 if rests is None else rests
    return rows


def test_silence_that_hangs_on_the_quantity_is_told_by_it() -> None:
    rows = _rows(60, [_SMALL, _SMALL, _LARGE])
    best = contrasts(rows, rows.quantity == _LARGE)[0]
    assert (best.name, best.value, best.spared, best.is_sharp) == ("quantity", _LARGE, _SMALL, True)


def test_silence_in_spells_is_told_by_time() -> None:
    rows = _rows(90, [_SMALL, _LARGE])
    hits = (np.arange(90) // 15) % 2 == 1
    assert contrasts(rows, hits)[0].family is Family.TIME


@given(st.integers(0, 1 << 30), st.floats(0.05, 0.95))
def test_what_hangs_on_nothing_seldom_has_a_contrast_of_many_bits(seed: int, rate: float) -> None:
    random = np.random.default_rng(seed)
    rows = _rows(120, [4, 8, 16], random.integers(1_000_000, 90_000_000, 120).tolist())
    assert all(each.bits < 14 for each in contrasts(rows, random.random(120) < rate))


@pytest.mark.parametrize("portion", [1, 7, 1000])
def test_what_the_table_remembers_hangs_on_the_exchanges_alone(portion: int) -> None:
    """In whatever portions they come; of many an even part."""
    many = Exchanges.zeros(40_000)
    many.unit[:] = np.arange(len(many)) % 7 + 1
    times = np.arange(len(many))
    whole, pieces = ExchangeTable(), ExchangeTable()
    whole.add(many, times)
    step = portion * 40
    for at in range(0, len(many), step):
        pieces.add(many[at : at + step], times[at : at + step])
    assert whole.rows.number.tolist() == pieces.rows.number.tolist()
    assert whole.rows.before.tolist() == pieces.rows.before.tolist()
    assert 4000 < len(whole.rows) <= 1 << 14
    assert len(set(np.bincount(whole.rows.unit)[1:] // 1000)) == 1


def test_of_what_is_rare_the_table_remembers_all() -> None:
    many, table = Exchanges.zeros(100_000), ExchangeTable()
    many.unit[:] = 5
    many.outcome[::1000] = Ending.SILENT
    table.add(many, np.arange(len(many)))
    rows = table.of(5)
    silent = rows[rows.outcome == Ending.SILENT]
    assert len(silent) == 100
    assert table.weight_of(silent) == 1
    assert len(rows) < len(many) / 4
    assert table.weights(rows).sum() == pytest.approx(len(many), rel=0.05)


nameless = package("nameless")


@lru_cache(1)
def _made(name: str, seed: int) -> FieldCapture:
    return (field_cases().get(name) or nameless.nameless_cases()[name]).capture("precise", seed)


def _story(name: str, seed: int = 3) -> Story:
    made = _made(name, seed)
    capture = Capture.of(made.line, made.chunks)
    return story_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


@pytest.mark.parametrize(
    "name",
    ["deaf-to-some", "unit-fails", "gateway-line-cut", "unit-0-asked", "cut-at-length", "tap-loses", "request-flaw",
     "unknown-function", "rest-too-short", "same-damage-text", "same-damage-bit", "bias-beside-dead",
     "client-driver-held"],
)  # fmt: skip
def test_a_kind_is_told_by_what_it_hangs_on(name: str) -> None:
    made, story = _made(name, 3).expected, _story(name)
    assert story.causes
    assert story.causes[0].cause in (made.cause, *([made.beside.cause] if made.beside else []))


@pytest.mark.parametrize("name", ["nameless-every-nth", "nameless-refuses-by-chance", "nameless-deaf-behind"])
def test_what_no_cause_takes_is_told_all_the_same(name: str) -> None:
    story = _story(name)
    assert story.not_explained
    assert all(left.exchanges > 0 and left.like for left in story.not_explained)


def test_answers_that_the_client_does_not_take_are_told() -> None:
    story = _story("client-deaf", 2)
    assert not story.causes
    assert all("the client does not take them" in left.like for left in story.not_explained) and story.not_explained


def test_answers_that_come_while_the_client_is_deaf_are_told() -> None:
    story = _story("client-deaf-behind", 6)
    assert not story.causes
    assert all("the client does not take them" in left.like for left in story.not_explained) and story.not_explained


def test_a_tap_that_repeats_is_the_first_cause() -> None:
    story = _story("tap-repeats", 5)
    assert story.causes and story.causes[0].cause == "tap-repeats"


def test_answers_that_the_client_waits_on_behind_are_told_though_it_never_asks_again() -> None:
    story = _story("drawn-client-deaf-nth", 0)
    assert [left.unit for left in story.not_explained] == [16, 116]


def test_values_that_a_program_writes_in_vain_are_told() -> None:
    story = _story("refuses-by-value", 1)
    assert any("refused" in left.like for left in story.not_explained)


def test_a_scan_that_asks_each_address_several_times_leaves_nothing_unexplained() -> None:
    assert _story("healthy-scan", 1001).not_explained == []


@pytest.mark.parametrize("seed", [1003, 1005])
def test_interference_is_told_as_such_and_not_as_a_guess(seed: int) -> None:
    first = _story("interference", seed).causes[0]
    assert first.cause == "interference"
    assert in_words(first.confidence) != "perhaps"


@pytest.mark.parametrize("seed", [1, 3])
def test_a_client_that_sends_twice_is_no_second_client(seed: int) -> None:
    story = _story("client-sends-twice", seed)
    assert "two-masters" not in [cause.cause for cause in story.causes]
    assert story.not_explained


@pytest.mark.parametrize("seed", [1, 3])
def test_a_unit_that_is_deaf_after_a_write_does_not_restart(seed: int) -> None:
    story = _story("deaf-after-write", seed)
    assert not story.causes
    assert all("soon after a write" in left.like for left in story.not_explained) and story.not_explained


def test_bits_that_turn_in_values_alone_are_hardly_a_lines_doing() -> None:
    story = _story("two-faults-without", 3)
    assert story.not_explained
    assert all(in_words(cause.confidence) == "perhaps" for cause in story.causes)


@pytest.mark.parametrize("name", ["healthy", "healthy-rare-errors", "healthy-event-log", "healthy-slow-unit"])
def test_nothing_is_left_of_a_bus_that_is_well(name: str) -> None:
    assert not _story(name).not_explained


def test_what_is_left_is_told_in_russian_too() -> None:
    assert set(catalogue("ru")["left"]) == set(TEMPLATES)


@given(st.sampled_from([each.cause for each in suspects()]), st.tuples(*[st.floats(0, 12)] * len(Clues._fields)))
def test_certainty_is_never_beyond_what_was_seen(cause: str, numbers: tuple[float, ...]) -> None:
    share = certainty(cause, Clues(*numbers), {})
    assert LEAST <= share <= MOST
    assert in_words(share) in ("certain", "most likely", "perhaps")
    assert (f"({share:.0%})" in how_sure(share)) == (share >= CALIBRATED)


def test_traits_are_typical_of_their_own_cause_or_of_none() -> None:
    endings = {"mute": {"silent": 0.9, "well": 0.1}, "late": {"head": 0.5, "well": 0.5}}
    kinds = {cause: [each] for cause, each in endings.items()}
    shares = {trait: kinds if trait == "ending" else {} for trait in TRAITS}
    none = {"ending": [{"long": 0.8, "well": 0.2}]}
    mute, late = {"ending": {"silent": 36.0, "well": 4.0}}, {"ending": {"head": 20.0, "well": 20.0}}
    known_as_none = {"ending": {"long": 30.0, "well": 10.0}}

    def like(cause: str, found: Traits) -> float:
        return typical(shares, none, cause, found)["ending"]

    assert like("mute", mute) > 0 > like("mute", late)
    assert like("late", late) > 0 > like("late", mute)
    assert all(like(cause, known_as_none) < 0 for cause in endings)


_UNSAFE = re.compile(r"(?i)^(write|switch|stop|broadcast|restart)\b")


@pytest.mark.parametrize("suspect", suspects(), ids=lambda suspect: suspect.cause)
def test_the_first_thing_to_do_starts_nothing(suspect: object) -> None:
    test = suspect.deciding_test  # type: ignore[attr-defined]
    assert not _UNSAFE.search(test) or "port that listens" in test
    if re.search(r"(?i)\btake\b.* off", test):
        assert "operator" in test


_TRUTH = SHARED / "corpus" / "cases3"


@pytest.mark.parametrize("name", sorted(path.stem for path in _TRUTH.glob("*.jsonl")) or [None])
def test_no_case_of_the_field_is_mute(name: str | None) -> None:
    if name is None:
        pytest.skip("the shared corpus is not there")
    capture = captures.open(_TRUTH / f"{name}.jsonl")
    story = story_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))
    healthy = int(name) > 12
    assert healthy != bool(story.causes or story.not_explained)
