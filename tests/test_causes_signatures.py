"""What is read from a few bytes behind a request, whatever they are."""

from __future__ import annotations

from bursts import answer_of, frame, read_of
from hypothesis import given
from hypothesis import strategies as st

from analyzer.causes.exchanges import Ending
from analyzer.causes.rawbytes import KnownRequests
from analyzer.causes.samples import Sample, SampleRow
from analyzer.causes.signatures import AnswerDamage, Behind, Signature, signature
from analyzer.tables.schema import Kind

COILS = frame(32, 1, 0, 0, 0, 24)
OTHER = frame(32, 4, 0, 64, 0, 2)
REFUSED = frame(32, 0x81, 2)


def _read(*data: bytes, usual: bytes | None = None) -> Signature:
    """What stands behind a request for 24 coils, in such pieces of noise."""
    pieces = tuple(
        SampleRow(int(Kind.NOISE), False, False, 0, 10_000_000 + 2_000_000 * i, 11_000_000 + 2_000_000 * i, 0, each)
        for i, each in enumerate(data)
    )
    sample = Sample(32, 1, COILS, Ending.GARBAGE, 8, 0, 0, 500_000_000, pieces, usual, 32)
    return signature(sample, 1e6, KnownRequests.of([COILS, OTHER, read_of(7)]), off_ns=0.0)


def test_a_request_in_two_pieces_is_one_and_no_answer_without_its_head() -> None:
    """It is as long as the answer that is due, and its check value is right."""
    assert len(OTHER) == 8
    assert _read(OTHER[:1], OTHER[1:]).damage is AnswerDamage.CROSSED


def test_an_answer_whose_rest_came_with_the_next_request_is_whole() -> None:
    answer = frame(32, 1, 3, 1, 2, 3)
    assert _read(answer[:3], answer[3:] + OTHER[:4]).damage is AnswerDamage.NONE
    assert _read(answer[:3], answer[4:] + OTHER[:4]).damage is not AnswerDamage.NONE
    assert _read(answer[:3] + answer[3:] + OTHER[:4]).damage is not AnswerDamage.NONE


def test_a_refusal_in_two_pieces_is_one() -> None:
    assert _read(REFUSED[:2], REFUSED[2:]).damage is AnswerDamage.NONE


def _behind_an_answer(*data: bytes, then: SampleRow | None = None) -> Behind:
    """What such pieces of noise, and that row, behind a good answer to a request for 24 coils are."""
    good = SampleRow(int(Kind.RESPONSE), True, True, 32, 10_000_000, 18_000_000, 0, frame(32, 1, 3, 1, 2, 3))
    pieces = tuple(
        SampleRow(int(Kind.NOISE), False, False, 0, 20_000_000 + 2_000_000 * i, 21_000_000 + 2_000_000 * i, 0, each)
        for i, each in enumerate(data)
    )
    sample = Sample(32, 1, COILS, Ending.OK, 8, 0, 0, 500_000_000, (good, *pieces, *([then] if then else ())), None, 7)
    return signature(sample, 1e6, KnownRequests.of([COILS, OTHER, read_of(7)]), off_ns=0.0).behind


def test_the_next_request_and_its_answer_whole_but_in_pieces_are_nothing_that_collided() -> None:
    request, answer = read_of(7), answer_of(7, 1234)
    assert _behind_an_answer(request, answer[:3], answer[3:]) is Behind.NOTHING
    assert _behind_an_answer(request + answer[:3], bytes((answer[3] ^ 8,)) + answer[4:]) is not Behind.NOTHING
    assert _behind_an_answer(request[:5], answer) is not Behind.NOTHING


def test_an_answer_to_a_request_in_pieces_is_no_second_one() -> None:
    """As where a tap hands over the rest of a request with what comes next, a minute later."""
    answer = SampleRow(int(Kind.RESPONSE), True, False, 32, 90_000_000, 95_000_000, 0, frame(32, 4, 4, 0, 1, 0, 2))
    assert _behind_an_answer(OTHER[:5], OTHER[5:], then=answer) is Behind.NOTHING
    assert _behind_an_answer(OTHER[:5], OTHER[6:], then=answer) is Behind.ANSWER
    assert _behind_an_answer(then=answer) is Behind.ANSWER


_WHOLE = st.binary(min_size=2, max_size=12).map(lambda body: frame(*body))
_LIKE = st.one_of(st.binary(max_size=12), _WHOLE, st.sampled_from([COILS, OTHER, REFUSED, frame(32, 1, 3, 1, 2, 3)]))


@given(st.lists(_LIKE, min_size=1, max_size=3), st.sampled_from([None, frame(32, 1, 3, 1, 2, 3)]))
def test_any_bytes_are_read(pieces: list[bytes], usual: bytes | None) -> None:
    found = _read(*pieces, usual=usual)
    assert found.length <= sum(map(len, pieces))
    assert all(0 <= bit <= 9 for bit in found.flips)
