"""A tap that hears answers only, and frames whose counts are not so: what is whole is found, and read the right way."""

from __future__ import annotations

import pytest
from buses import LINE, adu, deframed, heard

from analyzer.simulation import TAPS
from analyzer.tables.schema import Kind, Rows
from captures.chunks import Chunk

TWO_READS = bytes.fromhex("230304c36500991400")  # its first 8 bytes check as a request for 25,856 registers
COILS = adu("910103 1d565e")  # the same bytes read as a request for 22,110 coils
ECHO = adu("240675450001")
BUSY = adu("248606")
POLLED = [adu("230302c365"), adu("230304c3650098"), adu("1d0402012c"), adu("24030400000001")]


def frames(chunks: list[Chunk]) -> Rows:
    rows = deframed(chunks, LINE).rows
    return rows[rows.kind != Kind.NOISE]


@pytest.mark.parametrize("tap", sorted(TAPS))
def test_an_answer_is_never_taken_for_a_request_that_no_client_may_send(tap: str) -> None:
    pieces = [*POLLED, TWO_READS, *POLLED, COILS, *POLLED]
    found = frames(heard(pieces, tap, 1))
    assert found.length.tolist() == [len(piece) for piece in pieces]
    assert (found.kind == Kind.RESPONSE).all()


@pytest.mark.parametrize("tap", sorted(TAPS))
def test_what_was_taken_for_a_request_before_a_tap_was_known_hides_nothing_behind_it(tap: str) -> None:
    pieces = [ECHO, *(POLLED * 8), BUSY, ECHO, *POLLED, BUSY, *POLLED]
    found = frames(heard(pieces, tap, 2))
    assert found.length.tolist() == [len(piece) for piece in pieces]
    assert (found.kind[1:] == Kind.RESPONSE).all()


@pytest.mark.parametrize("tap", sorted(TAPS))
@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("020300310004", "02030a7b7fd788b7d71725"),  # a count of ten, eight bytes of data
        ("020300310004", "0203007b7fd788b7d71725"),
        ("031000160002040001 0002", "031000160002"),
    ],
)
def test_a_right_check_value_where_an_answer_is_due_makes_a_frame_whatever_it_counts(
    request_: str, answer: str, tap: str
) -> None:
    poll = [adu("110300000002"), adu("11030400010002")]
    odd = [adu(request_), adu(answer)]
    found = frames(heard([*(poll * 10), *odd, *poll, *odd, *poll], tap, 3))
    assert found.check.all()
    assert found.length.tolist() == [len(piece) for piece in [*(poll * 10), *odd, *poll, *odd, *poll]]
    assert found.kind.tolist() == [Kind.REQUEST, Kind.RESPONSE] * (len(found) // 2)


@pytest.mark.parametrize("tap", sorted(TAPS))
def test_a_write_whose_counts_are_wrong_is_a_frame_between_others(tap: str) -> None:
    poll = [adu("110300000002"), adu("11030400010002")]
    odd = adu("04100016000d0b6cc78b70b8733a59")  # 13 registers, 11 bytes: there are 8
    pieces = [*(poll * 10), odd, *poll, odd, *poll]
    found = frames(heard(pieces, tap, 4))
    assert found.length.tolist() == [len(piece) for piece in pieces]
    assert found.check.all()
    assert found.kind[20] == found.kind[23] == Kind.REQUEST
