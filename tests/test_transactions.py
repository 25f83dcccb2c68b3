"""Requests with their answers: statuses, retries, late answers; the same however the rows come in batches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from buses import LINE, adu, rtu_deframer, spaced, streams
from hypothesis import given

from analyzer.deframing.protocols import Deframer
from analyzer.tables.batch import Batch, join_batches
from analyzer.tables.transactions import Status, TransactionRows, Transactions
from captures.chunks import Block, Chunk
from dissectors.crc import lrc

READ, ANSWER = adu("110300000002"), adu("110304000a0014")


def transactions(feeds: Sequence[Chunk | Block]) -> TransactionRows:
    deframer, found = rtu_deframer(LINE), Transactions()
    batches = [*(deframer.feed(feed) for feed in feeds), deframer.close()]
    return TransactionRows.joined([*(found.feed(b) for b in batches), found.close()])


def statuses(pieces: list[bytes]) -> list[str]:
    return [Status(s).name for s in transactions(spaced(pieces)).status]


def test_answered_exception_and_unanswered() -> None:
    assert statuses([READ, ANSWER, READ, adu("118302"), READ]) == ["ANSWERED", "EXCEPTION", "UNANSWERED"]


def test_a_broadcast_waits_for_nobody() -> None:
    assert statuses([READ, ANSWER, adu("000600010002"), READ, ANSWER]) == ["ANSWERED", "BROADCAST", "ANSWERED"]


def test_a_damaged_answer_is_an_answer() -> None:
    broken = ANSWER[:4] + bytes([ANSWER[4] ^ 1]) + ANSWER[5:]
    assert statuses([READ, broken, READ, ANSWER]) == ["DAMAGED", "ANSWERED"]


def test_the_same_bytes_after_no_answer_are_a_retry_and_a_poll_is_not() -> None:
    other = adu("110300100002")
    found = transactions(spaced([READ, ANSWER, READ, READ, ANSWER, other, ANSWER, READ, ANSWER]))
    assert found.retry.tolist() == [False, False, True, False, False]


def test_a_late_answer_belongs_to_the_older_request() -> None:
    other, its_answer = adu("050400000001"), adu("0504020007")
    found = transactions(spaced([READ, other, ANSWER, READ, ANSWER, other, its_answer]))
    assert found.response.tolist() == [2, -1, 4, 6]
    assert found.late.tolist() == [True, False, False, False]


@pytest.mark.parametrize("together", [False, True])
def test_what_comes_after_minutes_answers_nothing_that_was_heard(together: bool) -> None:
    """A slice of a recording is missing: its last request and the first answer behind it are no exchange."""
    hour = 3600 * 10**9
    early = spaced([READ, ANSWER, READ])
    feeds = [*early, *(replace(chunk, t_ns=chunk.t_ns + hour) for chunk in spaced([ANSWER, READ, ANSWER]))]
    found = transactions([Block.from_chunks(feeds)] if together else feeds)
    assert found.response.tolist() == [1, -1, 5]
    assert found.response_ns.max() < 10**9


def test_response_time_is_unknown_where_request_and_answer_came_in_one_read() -> None:
    found = transactions([Chunk(10**9, READ + ANSWER), Chunk(2 * 10**9, READ), Chunk(2 * 10**9 + 10**7, ANSWER)])
    assert found.response_ns[0] == -1
    assert 0 < found.response_ns[1] < 10**7


@given(streams())
def test_batches_do_not_matter(chunks: list[Chunk]) -> None:
    whole, pieces = transactions([Block.from_chunks(chunks)]), transactions(list(chunks))
    assert whole.tolist() == pieces.tolist()


@given(streams())
def test_a_row_a_batch_is_as_good_as_all_at_once(chunks: list[Chunk]) -> None:
    assert_same_row_by_row(chunks)


@pytest.mark.parametrize("gap_ns", [6_000_000, 4_000_000_000])
def test_a_request_behind_a_damaged_answer_ends_the_wait_for_it_in_any_batch(gap_ns: int) -> None:
    """Cost: time to the next request. A row a batch, the damaged answer had been settled before that came."""
    damaged = ANSWER[:-1] + bytes([ANSWER[-1] ^ 1])
    found = transactions(spaced([READ, damaged, READ, ANSWER], gap_ns))
    assert found.status.tolist() == [Status.DAMAGED, Status.ANSWERED]
    assert found.t_next_ns[0] == found.t_start_ns[1]
    assert_same_row_by_row(spaced([READ, damaged, READ, ANSWER], gap_ns))


def test_a_retried_write_and_two_echoes_are_put_in_order_in_any_batch() -> None:
    write = adu("110600010002")
    assert_same_row_by_row(spaced([READ, ANSWER, write, write, write, write, READ, ANSWER]))


@pytest.mark.parametrize("strays", [14, 15, 16, 17, 18])
def test_what_comes_beyond_the_horizon_is_not_told_in_any_batch(strays: int) -> None:
    alien = adu("0504020007")
    assert_same_row_by_row(spaced([READ, *[alien] * strays, READ, ANSWER]))
    assert_same_row_by_row(spaced([READ, *[alien] * strays, ANSWER, READ]))


def assert_same_row_by_row(chunks: list[Chunk]) -> None:
    deframer = rtu_deframer(LINE)
    batches = [deframer.feed(Block.from_chunks(chunks)) if chunks else Batch.empty(), deframer.close()]
    batch = join_batches(batches)
    whole, single = Transactions(), Transactions()
    rows = [replace(batch, rows=batch.rows[i : i + 1]) for i in range(len(batch))]
    at_once = TransactionRows.joined([whole.feed(batch), whole.close()])
    row_by_row = TransactionRows.joined([*(single.feed(row) for row in rows), single.close()])
    assert at_once.tolist() == row_by_row.tolist()


@given(streams())
def test_every_request_has_one_transaction_in_order(chunks: list[Chunk]) -> None:
    found = transactions(list(chunks))
    assert (np.diff(found.request) > 0).all()
    answers = found.response[found.response >= 0]
    assert len(set(answers.tolist())) == len(answers)


@pytest.mark.parametrize("envelope", ["ascii", "tcp"])
def test_only_the_same_write_is_the_same_again_whatever_the_envelope(envelope: str) -> None:
    """In ASCII mode all frames end alike, and over Modbus TCP each has its own number."""
    writes = [adu("110600010002"), adu("110600010003"), adu("110600010003")]
    pieces = []
    for number, write in enumerate(writes):
        body = write[:-2]
        if envelope == "ascii":
            frame = b":" + (body + bytes([lrc(body)])).hex().upper().encode() + b"\r\n"
        else:
            frame = number.to_bytes(2) + b"\0\0" + len(body).to_bytes(2) + body
        pieces += [frame, frame]
    found, deframer = Transactions(), Deframer(LINE)
    batches = [deframer.feed(Block.from_chunks(spaced(pieces))), deframer.close()]
    told = TransactionRows.joined([*(found.feed(batch) for batch in batches), found.close()])
    assert told.status.tolist() == [Status.ANSWERED] * 3
    assert told.again.tolist() == [False, False, True]


def test_a_shifted_series_is_put_right_when_an_answer_is_left_over() -> None:
    """One late answer, taken for the next request's, and so on: the one that nobody asked for tells whose all were."""
    asked = [adu(f"1103{address:04x}0002") for address in (0, 16, 32, 48)]
    values = [adu(f"110304{value:08x}") for value in range(4)]
    other, its_answer = adu("050400000001"), adu("0504020007")
    wire = [READ, ANSWER, asked[0], asked[1], values[0], asked[2], values[1], asked[3], values[2]]
    chunks = spaced([*wire, other, values[3], its_answer, READ, ANSWER])
    found = transactions(chunks)
    assert found.response.tolist() == [1, 4, 6, 8, 10, 11, 13]
    assert found.late.tolist() == [False, True, True, True, True, False, False]
    assert found.mistaken.tolist() == [False, True, True, True, False, False, False]
    assert_same_row_by_row(chunks)


def test_an_answer_beyond_three_waits_of_the_master_shifts_nothing() -> None:
    asked, values = adu("110300100002"), adu("110304000000ff")
    other, its_answer = adu("050400000001"), adu("0504020007")
    chunks = spaced([READ, asked, values, other], gap_ns=200_000_000)
    late = [replace(c, t_ns=c.t_ns + 60_000_000_000) for c in spaced([other, ANSWER, its_answer])]
    found = transactions(chunks + late)
    assert found.status.tolist()[:2] == [Status.UNANSWERED, Status.ANSWERED]
    assert found.response[1] == 2
    assert not found.late[1]
