"""Requests with their answers: statuses, retries, late answers; the same however the rows come in batches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from buses import LINE, adu, rtu_deframer, spaced, streams
from hypothesis import given
from hypothesis import strategies as st

from analyzer.deframing.protocols import Deframer
from analyzer.tables.batch import Batch, join_batches
from analyzer.tables.columns import decode
from analyzer.tables.transactions import NEVER, Status, TransactionRows, Transactions, shared
from analyzer.tables.values import confirmed_values
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


@pytest.mark.parametrize("together", [False, True])
def test_over_tcp_the_same_under_another_number_is_a_retry_where_none_answered(together: bool) -> None:
    pieces, read, answer = [], READ[:-2], ANSWER[:-2]
    for number, answered, body in (
        (1, 1, read),
        (2, 0, read),
        (3, 0, read),
        (4, 1, read),
        (5, 1, adu("110300200002")[:-2]),
    ):
        for frame in (body, answer)[: 1 + answered]:
            pieces.append(number.to_bytes(2) + b"\0\0" + len(frame).to_bytes(2) + frame)
    feeds, found, deframer = spaced(pieces), Transactions(), Deframer(LINE)
    batches = [*map(deframer.feed, [Block.from_chunks(feeds)] if together else feeds), deframer.close()]
    told = TransactionRows.joined([*map(found.feed, batches), found.close()])
    assert told.retry.tolist() == [False, False, True, True, False]


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


def other_bits(data: bytes, count: int) -> bytes:
    """The bytes, as many of them damaged from the third on."""
    return data[:2] + bytes(octet ^ 0x11 for octet in data[2 : 2 + count]) + data[2 + count :]


SECOND_TRIES = {  # what stands before the request instead of itself: whether that is a retry of it
    "one byte is another": (other_bits(READ, 1), True),
    "two bytes are": (other_bits(READ, 2), True),
    "three bytes are": (other_bits(READ, 3), False),
    "the last is cut off": (READ[:-1], True),
    "the last two are": (READ[:-2], True),
    "the last three are": (READ[:-3], False),
    "noise that is as long": (b"\x55" * 8, False),
    "another request, damaged": (other_bits(adu("110300ff0009"), 1), False),
}


@pytest.mark.parametrize("case", SECOND_TRIES)
@pytest.mark.parametrize("together", [False, True])
def test_a_request_behind_itself_damaged_is_a_retry(case: str, together: bool) -> None:
    before, expected = SECOND_TRIES[case]
    feeds = spaced([READ, ANSWER, before, READ, ANSWER])
    found = transactions([Block.from_chunks(feeds)] if together else feeds)
    assert found.retry.tolist() == [False, expected]


WRITE, WRITE_2, READ_2 = adu("110600010002"), adu("110600010003"), adu("110300200003")
BROADCAST, BROADCAST_2 = adu("000600010002"), adu("000600010003")
COLUMNS = {  # frames: what columns of their transactions hold
    "broadcasts again": (
        [BROADCAST, BROADCAST, BROADCAST_2, BROADCAST_2, READ, ANSWER],
        {"again": [0, 1, 0, 1, 0], "retry": [0] * 5},
    ),
    "writes again": ([WRITE, WRITE, WRITE, WRITE, WRITE_2, WRITE_2], {"again": [0, 1, 0], "response": [1, 3, 5]}),
    "a write after something else": ([WRITE, WRITE, READ, ANSWER, WRITE, WRITE], {"again": [0, 0, 0]}),
    "a poll is no write": ([READ, ANSWER, READ, ANSWER], {"again": [0, 0]}),
    "a retry is none either": ([WRITE, WRITE_2, READ, WRITE, READ], {"again": [0, 0, 0, 0]}),
    "octets that are lost, glitches apart": (
        [READ, b"\x99\x88\x77", READ, b"\x00\xff\x99", READ, ANSWER, b"\x12\x34", READ],
        {"garbage": [3, 1, 0, 0], "retry": [0, 1, 1, 0]},
    ),
    "a late answer": (
        [READ, READ_2, ANSWER, READ, ANSWER],
        {"late": [1, 0, 0], "response": [2, -1, 4], "garbage": [0, 0, 0]},
    ),
    "a broadcast again, and nothing behind it": (
        [READ, ANSWER, BROADCAST, adu("110301000002"), ANSWER, BROADCAST, BROADCAST],
        {"again": [0, 0, 0, 0, 1]},
    ),
    "the answer behind a request of its kind": (
        [READ, adu("110300200002"), ANSWER, READ, ANSWER],
        {"late": [0, 0, 0], "response": [-1, 2, 4]},
    ),
    "an exception": ([READ, adu("118304"), READ, ANSWER], {"exception": [4, 0], "status": [1, 0], "retry": [0, 0]}),
}


@pytest.mark.parametrize("case", COLUMNS)
@pytest.mark.parametrize("together", [False, True])
def test_what_becomes_of_requests(case: str, together: bool) -> None:
    pieces, expected = COLUMNS[case]
    feeds = spaced(pieces)
    found = transactions([Block.from_chunks(feeds)] if together else feeds)
    assert {name: found.column(name).tolist() for name in expected} == expected


def test_a_late_answer_is_held_against_the_newest_request_and_not_the_one_of_the_batch_before() -> None:
    deframer, found = rtu_deframer(LINE), Transactions()
    chunks = spaced([READ, READ_2, ANSWER, READ, ANSWER])  # which asks for more than the answer has
    batch = join_batches([deframer.feed(Block.from_chunks(chunks)), deframer.close()])
    parts = [replace(batch, rows=batch.rows[:1]), replace(batch, rows=batch.rows[1:])]
    told = TransactionRows.joined([*map(found.feed, parts), found.close()])
    assert (told.late.tolist(), told.mistaken.tolist()) == ([True, False, False], [False, False, False])


def test_what_a_write_writes_is_told_once_when_its_batches_are_joined() -> None:
    deframer = rtu_deframer(LINE)
    writes = [adu("1110000100020400070008"), adu("111000010002")] * 3
    batch = join_batches([*map(deframer.feed, spaced(writes)), deframer.close()])
    confirmed = confirmed_values(batch, decode(batch))
    assert (confirmed.rows.tolist(), confirmed.address.tolist()) == ([1, 3, 5], [1, 1, 1])


def test_the_next_request_ends_the_wait_and_nothing_else_does() -> None:
    first, second, last = transactions(spaced([READ, READ_2, READ]))
    assert (first.t_next_ns, second.t_next_ns) == (second.t_start_ns, last.t_start_ns)
    assert last.t_next_ns == NEVER and last.t_request_ns > last.t_start_ns


@given(st.binary(max_size=6), st.binary(max_size=3), st.binary(max_size=3), st.binary(max_size=6))
def test_what_two_share_at_their_ends(head: bytes, one: bytes, two: bytes, tail: bytes) -> None:
    a, b = head + one + tail, head + two + tail
    assert len(head + tail) <= shared(a, b) <= min(len(a), len(b)) and shared(a, b) == shared(b, a)
    assert shared(a, a) == len(a) and shared(a + b"\1", a + b"\2") == len(a)
    assert shared(b"\1" + a, b"\2" + a) == len(a)
