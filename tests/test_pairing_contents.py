"""Whose an answer is, where order and header cannot tell: by what it holds; and what is said where nothing can."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from queuing import LINE, MS, Talk, adu

from analyzer.core import Analysed, Analyzer
from analyzer.deframing.queues import PendingAnswer, Strangeness, UnitQueue
from analyzer.tables.schema import Kind, Rows
from captures import Chunk, LineSettings
from captures.chunks import Block


def told(chunks: Sequence[Chunk], *, line: LineSettings = LINE, size: int = 1 << 30, timed: bool = True) -> Rows:
    analyzer = Analyzer(line)
    parts: list[Analysed] = []
    for first in range(0, len(chunks), size):
        block = Block.from_chunks(chunks[first : first + size], timed=timed)
        parts += analyzer.feed(block)
    return Rows.joined([part.batch.rows for part in [*parts, *analyzer.close()]])


def answers(rows: Rows) -> dict[int, tuple[int, int, bool]]:
    return {
        row.start: (row.request_start, row.taken_for_start, row.unsure) for row in rows if row.kind == Kind.RESPONSE
    }


@pytest.mark.parametrize("timed", [True, False])
def test_a_series_of_answers_each_behind_the_next_request_stands_under_its_own(timed: bool) -> None:
    talk = Talk()
    talk.rounds(5)
    displaced = talk.shifted(30)
    talk.rounds(5)
    found = answers(told(talk.chunks, timed=timed))
    assert {start: found[start][0] for start in talk.truth} == talk.truth
    taken = {start: found[start][1] for start in displaced}
    requests = sorted(set(talk.truth.values()))
    assert taken == {start: requests[requests.index(talk.truth[start]) + 1] for start in displaced}
    assert [start for start in talk.truth if found[start][1] >= 0] == displaced
    assert not any(unsure for _, _, unsure in found.values())


@pytest.mark.parametrize("timed", [True, False])
def test_a_unit_that_falls_behind_ever_further_is_followed(timed: bool) -> None:
    """Each fifth request waits in vain, and the unit queues them all: at the end it is 40 requests and 30 s behind."""
    talk = Talk()
    talk.rounds(5)
    polls: dict[int, int] = {}
    waiting: list[tuple[int, int]] = []
    for i in range(200):
        waiting.append(talk.ask(i % 4, 500))
        polls[waiting[-1][1]] = i % 4
        if i % 5:
            talk.answer(waiting.pop(0))
    behind = {start: request for start, request in talk.truth.items() if request in polls}
    found = answers(told(talk.chunks, timed=timed))
    assert all(polls[found[start][0]] == polls[request] for start, request in behind.items())


def test_of_a_unit_that_answered_twice_before_nobody_is_certain_that_it_does_not() -> None:
    """All polls hold the same: an answer right behind a request may be to that, or to the one before once more."""
    talk = Talk(alike=True)
    talk.rounds(4)
    asked = talk.ask(0)
    talk.answer(asked)
    talk.answer(asked)  # in a gap: certain
    del talk.truth[max(talk.truth)]
    talk.rounds(2)
    lost = talk.ask(0)
    talk.now += 300 * MS
    displaced = talk.answer(talk.ask(1), 0.5)
    talk.answer(lost)
    talk.rounds(1)
    _, taken, unsure = answers(told(talk.chunks, timed=False))[displaced]
    assert unsure
    assert taken >= 0, "the client goes on with it all the same"


@pytest.mark.parametrize("doubles", [False, True])
def test_of_a_unit_that_answers_twice_an_answer_once_more_may_be_the_one_before(doubles: bool) -> None:
    """All polls hold the same; the second answer to one comes behind the next request, whose own comes in a gap."""
    talk = Talk(alike=True)
    talk.rounds(4)
    asked = talk.ask(0)
    talk.answer(asked)
    if doubles:
        del talk.truth[talk.answer(asked)]  # in a gap: certain
    talk.rounds(2)
    first = talk.ask(0)
    talk.answer(first)
    second = talk.ask(1)
    again = talk.answer(first)
    talk.answer(second)
    talk.rounds(2)
    request, taken, unsure = answers(told(talk.chunks, timed=False))[again]
    assert taken == (second[1] if unsure else -1)
    assert unsure == doubles and request == (-1 if doubles else second[1])


@pytest.mark.parametrize("held", [False, True])
def test_a_shift_goes_on_behind_a_request_that_came_broken_and_a_long_hold(held: bool) -> None:
    """The tap gives a request in two pieces, or holds back everything for seconds; the unit heard it all."""
    talk = Talk()
    talk.rounds(8)
    open_one = talk.ask(0)
    talk.now += 300 * MS
    for i in range(1, 40):
        following = talk.ask(i % 4)
        if i % 20 == 10 and held:
            talk.now += 6_000 * MS
        elif i % 20 == 10:
            chunk = talk.chunks.pop()
            talk.chunks += [Chunk(chunk.t_ns, chunk.data[:3]), Chunk(chunk.t_ns + 6_000 * MS, chunk.data[3:])]
            talk.now += 6_000 * MS
        talk.answer(open_one)
        open_one = following
    stream = b"".join(chunk.data for chunk in talk.chunks)
    found = answers(told(talk.chunks))
    shown = {start: found[start][0] for start in talk.truth if start in found and not found[start][2]}
    assert len(shown) > 0.9 * len(talk.truth)
    assert all(stream[request + 3] == stream[talk.truth[start] + 3] for start, request in shown.items() if request >= 0)


@pytest.mark.parametrize("small", [False, True])
def test_an_answer_given_twice_in_the_first_round_shifts_what_follows(small: bool) -> None:
    """Nothing is known yet of the polls, but two of them hardly hold the same words; small numbers they may well."""
    talk, words = Talk(), (1, 0, 3, 0) if small else (40123, 5821, 312, 9044)
    polls = [bytes((9, 3, 0, 16 * i, 0, 4)) for i in range(8)]
    asked, taken = [], []
    for i in range(40):
        asked.append(talk.send(adu(polls[i % 8])))
        mine = i if small else max(i - 1, 0)  # the second answer is the first one once more
        data = b"".join((word + (0 if small else 7 * (mine % 8) + mine)).to_bytes(2) for word in words)
        taken.append((talk.send(adu(bytes((9, 3, 8)) + data), 15), mine))
    found = answers(told(talk.chunks))
    said = [(found[start][0], mine) for start, mine in taken if not found[start][2]]
    assert all(request == asked[mine] for request, mine in said)
    assert len(said) == len(taken) if small else len(said) > len(taken) / 2


def test_a_request_that_was_lost_moves_nothing() -> None:
    talk = Talk()
    talk.rounds(4)
    for _ in range(6):
        talk.ask(2)
        talk.now += 300 * MS
        talk.rounds(1)
    found = answers(told(talk.chunks))
    assert {start: found[start] for start in talk.truth} == {s: (r, -1, False) for s, r in talk.truth.items()}


@pytest.mark.parametrize("alike", [False, True])
def test_a_unit_that_wakes_up_answers_at_once_what_it_is_asked(alike: bool) -> None:
    """Nothing is known of its polls; but each answer is as soon behind its request, however long the client paused."""
    talk, pauses = Talk(alike=alike), Random(3)
    for i in range(7):
        talk.ask(i % 4)
        talk.now += 300 * MS
    for i in range(7, 47):
        talk.answer(talk.ask(i % 4, pauses.choice((20, 60, 350))), 15 + pauses.random())
    found = answers(told(talk.chunks))
    assert {start: found[start] for start in talk.truth} == {s: (r, -1, False) for s, r in talk.truth.items()}


@pytest.mark.parametrize(("polls", "most"), [(1, 24), (4, 10)])
def test_a_doubt_ends_when_all_is_as_it_should_be(polls: int, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    weighed, weigh = [], UnitQueue.answer

    def counted(queue: UnitQueue, answer: PendingAnswer, strangeness: Strangeness, *, timed: bool) -> None:
        weighed.append(answer)
        weigh(queue, answer, strangeness, timed=timed)

    monkeypatch.setattr(UnitQueue, "answer", counted)
    talk = Talk()
    talk.rounds(4)
    talk.ask(0)
    talk.now += 300 * MS
    for i in range(400):
        talk.answer(talk.ask(i % polls))
    told(talk.chunks, size=50)
    assert 0 < len(weighed) <= most, "the rest of 400 answers follow their requests"


@pytest.mark.parametrize("size", [1, 7, 1 << 30])
def test_polls_that_move_as_one_are_no_doubt_where_nothing_is_odd(size: int) -> None:
    """Four blocks of one unit hold the same, another thing each round: as clocks do, or a program on trial."""
    talk = Talk()
    for turn in range(40):
        words = b"".join((3000 + 700 * k + turn * (k % 3 == 0)).to_bytes(2, "big") for k in range(6))
        for first in range(0, 64, 16):
            request = talk.send(adu(bytes((9, 3, 0, first, 0, 6))))
            talk.truth[talk.send(adu(bytes((9, 3, 12)) + words), 15)] = request
    found = answers(told(talk.chunks, size=size))
    assert {start: asked for start, (asked, _, unsure) in found.items() if not unsure}.items() <= talk.truth.items()
    assert sum(unsure for _, _, unsure in found.values()) <= 8, "in the first rounds, at most"


def test_of_polls_that_hold_the_same_nobody_can_tell() -> None:
    talk = Talk(alike=True)
    talk.rounds(4)
    displaced = talk.shifted(12, ends=False)
    found = answers(told(talk.chunks, timed=False))
    assert all(found[start][2] and found[start][0] == -1 for start in displaced)
    assert all(found[start][1] >= 0 for start in displaced), "the client takes each for its newest request's"
    assert all(found[start] == (talk.truth[start], -1, False) for start in list(talk.truth)[:16])


def test_an_answer_in_a_gap_tells_whose_those_before_it_were_though_all_hold_the_same() -> None:
    talk = Talk(alike=True)
    talk.rounds(4)
    talk.shifted(12)
    found = answers(told(talk.chunks, timed=False))
    assert {start: found[start][0] for start in talk.truth} == talk.truth


def test_a_damaged_request_is_answered_by_nothing() -> None:
    talk = Talk()
    talk.rounds(3)
    asked = talk.ask(1)
    broken = bytearray(talk.chunks[-1].data)
    broken[3] ^= 1
    talk.chunks[-1] = Chunk(talk.now, bytes(broken))
    start = talk.answer(asked)
    talk.rounds(3)
    assert answers(told(talk.chunks))[start][0] == -1


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.sampled_from(("well", "lost", "late", "twice", "shift", "gap")), min_size=1, max_size=12),
    st.booleans(),
    st.integers(1, 5),
)
def test_whose_an_answer_is_does_not_hang_on_how_it_is_read(events: list[str], alike: bool, size: int) -> None:
    talk = Talk(alike=alike)
    talk.rounds(2)
    for number, event in enumerate(events):
        poll = number % 4
        if event == "shift":
            talk.shifted(5)
        elif event == "lost":
            talk.ask(poll)
            talk.now += 300 * MS
        elif event == "late":
            first = talk.ask(poll)
            talk.now += 300 * MS
            second = talk.ask((poll + 1) % 4)
            talk.answer(first)
            talk.answer(second)
        else:
            asked = talk.ask(poll)
            talk.answer(asked)
            if event == "twice":
                talk.answer(asked)
            if event == "gap":
                talk.now += 6_000 * MS
    once, parts = told(talk.chunks), told(talk.chunks, size=size)
    assert len(once) == len(parts)
    for name in ("start", "kind", "request", "request_start", "response_ns", "taken_for_start", "unsure"):
        assert np.array_equal(once.column(name), parts.column(name)), name
    assert (once.request_start < once.start).all(), "no answer is of a later request"
    early, seen = Analyzer(LINE, settles=False), []
    for chunk in talk.chunks:
        early.feed(Block.from_chunks([chunk]))
        seen.append(early.latest.batch.rows)
    early.close()
    given_early = Rows.joined([*seen, early.latest.batch.rows])
    assert np.array_equal(once.request_start, given_early.request_start)


def test_rows_wait_no_longer_than_they_may() -> None:
    """Polls that hold the same, for long: what is held is bounded, and the rest is given."""
    talk = Talk(alike=True)
    talk.rounds(2)
    talk.ask(0)
    talk.now += 300 * MS
    analyzer, given_rows, most = Analyzer(LINE, settles=False), 0, 0
    talk.rounds(100)
    for sent, chunk in enumerate(talk.chunks, 1):
        analyzer.feed(Block.from_chunks([chunk]))
        given_rows += len(analyzer.latest.batch.rows)
        most = max(most, sent - given_rows)
    assert most < 160
