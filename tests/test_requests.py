"""Which requests a unit does not serve, why, and what to ask instead; and when there is no reason at all."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scripts import package

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause, numbers_kept, told_again
from analyzer.core import analyse
from analyzer.languages import telling
from analyzer.paste import read, tree
from analyzer.requests.advice import advice
from analyzer.requests.asked import Request, request_of
from analyzer.requests.corrections import REASONS, corrected
from analyzer.requests.got import Got, visits_of
from analyzer.requests.reasons import Unserved, unserved
from captures.chunks import Capture
from dissectors.crc import crc_bytes, crc_ok

_BUSES = package("ask_devices")
FLAWS, ODD, flawed, odd = _BUSES.FLAWS, _BUSES.ODD, _BUSES.flawed, _BUSES.odd
chunks_of = package("ask_line").chunks_of
_OK, _SILENT = int(Got.ANSWER), int(Got.SILENCE)
Answer = Callable[[int, Request], int]  # the number of a round, a request: what it gets


def _reasons(polls: Sequence[Request], answer: Answer, rounds: int = 20) -> list[Unserved]:
    """The reasons of a unit that is asked these in turn."""
    visits = [(i, answer(turn, poll)) for turn in range(rounds) for i, poll in enumerate(polls)]
    return unserved(7, np.array(visits, np.int64), lambda number: polls[number])


def _read(address: int, quantity: int, function: int = 3) -> Request:
    return Request(7, function, address, quantity)


def _write(address: int, value: int = 5) -> Request:
    return Request(7, 6, address, 1, value.to_bytes(2, "big"))


@pytest.mark.parametrize("code", [_SILENT, 3])
def test_a_unit_that_gives_few_registers_is_asked_for_fewer_at_once(code: int) -> None:
    polls = [_read(0, 8), _read(8, 8), _read(0, 20), _read(4, 12)]
    (found,) = _reasons(polls, lambda _, poll: code if poll.quantity > 8 else _OK)
    assert (found.reason, found.is_silent) == ("quantity", code == _SILENT)
    assert [(ask.address, ask.quantity) for ask in found.ask_instead[:3]] == [(0, 8), (8, 8), (16, 4)]


@pytest.mark.parametrize("code", [_SILENT, 1])
def test_a_unit_without_06_is_written_by_16(code: int) -> None:
    (found,) = _reasons([_read(0, 4), _write(9, 513)], lambda _, poll: code if poll.function == 6 else _OK)
    assert found.reason == "write-function"
    assert [ask.pdu.hex() for ask in found.ask_instead] == ["1000090001020201"]


@pytest.mark.parametrize("code", [_SILENT, 2, 3])
def test_a_register_number_is_no_address(code: int) -> None:
    polls = [_read(0, 8), _read(40, 4), _read(40001, 2), _read(40011, 4)]
    (found,) = _reasons(polls, lambda _, poll: code if (poll.address or 0) > 9999 else _OK)
    assert found.reason == "register-number"
    assert [(ask.address, ask.quantity) for ask in found.ask_instead] == [(0, 2), (10, 4)]


def test_registers_that_the_other_function_reads_are_asked_for_by_that() -> None:
    polls = [_read(0, 40, 4), _read(500, 4), _read(8, 4), _read(20, 6)]
    (found,) = _reasons(polls, lambda _, poll: 2 if poll.function == 3 and (poll.address or 0) < 100 else _OK)
    assert found.reason == "read-function"
    assert {ask.function for ask in found.ask_instead} == {4}


def test_frames_of_bits_and_of_registers_tell_a_buffer() -> None:
    polls = [_read(0, 17), _read(0, 260, 1), _read(0, 20), _read(0, 300, 1)]
    (found,) = _reasons(polls, lambda _, poll: _SILENT if poll.longest_frame > 40 else _OK)
    assert found.reason == "answer-too-long"
    assert max(ask.longest_frame for ask in found.ask_instead) <= 40


def test_what_ends_behind_the_last_address_is_cut_there() -> None:
    (found,) = _reasons([_read(0, 8), _read(65530, 8)], lambda _, poll: 2 if poll.end > 65536 else _OK)
    assert (found.reason, found.ask_instead) == ("range-end", (_read(65530, 6),))


@pytest.mark.parametrize("code", [5, 6, 8, 0x0A, 0x0B])
def test_states_are_no_reasons(code: int) -> None:
    assert not _reasons([_read(0, 8), _read(0, 20)], lambda _, poll: code if poll.quantity > 8 else _OK)


def test_a_unit_that_never_answers_has_no_reason() -> None:
    assert not _reasons([_read(0, 8), _read(0, 20)], lambda *_: _SILENT)


def test_spells_in_which_nothing_is_answered_are_no_reason() -> None:
    assert not _reasons([_read(0, 8), _read(0, 20)], lambda turn, _: _SILENT if turn % 10 > 5 else _OK)


def test_a_probe_of_a_unit_asleep_is_no_reason() -> None:
    """Only the probe is asked while it sleeps, all else while it does not."""
    spells = (([0, 1] * 9, _OK), ([0], _SILENT), ([2] * 30, _SILENT), ([0, 1] * 9, _OK))
    visits = [(number, got) for numbers, got in spells for number in numbers]
    polls = [_read(0, 8), _read(20, 4), _read(0, 1)]
    assert not unserved(7, np.array(visits, np.int64), lambda number: polls[number])


@pytest.mark.parametrize("code", [2, 3, 4])
def test_a_unit_in_local_mode_refuses_writes_for_no_reason_of_theirs(code: int) -> None:
    assert not _reasons([_read(0, 8), _write(3)], lambda _, poll: code if poll.function == 6 else _OK)


def test_a_refusal_alone_tells_of_a_function_and_of_what_cannot_be() -> None:
    """Of a unit that is asked for nothing else."""
    (found,) = _reasons([_write(9)], lambda *_: 1)
    assert found.reason == "write-function"
    (found,) = _reasons([_read(40001, 2)], lambda *_: 2)
    assert (found.reason, found.ask_instead) == ("register-number", (_read(0, 2),))
    assert not _reasons([_read(0, 2)], lambda *_: 2)


def test_an_empty_log_is_no_reason() -> None:
    assert not _reasons([_read(0, 8), _read(9, 20)], lambda _, poll: 4 if poll.quantity > 8 else _OK)


@given(st.lists(st.sampled_from((_OK, _SILENT, int(Got.DAMAGE), 2)), min_size=1, max_size=60))
def test_retries_end_as_the_last_of_them_does(got: list[int]) -> None:
    again = np.arange(len(got)) < len(got) - 1
    visits = visits_of(np.zeros(len(got), np.int64), np.array(got, np.int64), again)
    assert visits[-1].tolist() == [0, got[-1]]
    assert not [code for _, code in visits.tolist()[:-1] if code in (_SILENT, Got.DAMAGE)]


_requests = st.one_of(
    st.builds(Request, st.integers(1, 247), st.sampled_from((1, 2, 3, 4)), st.integers(0, 65535), st.integers(1, 2100)),
    st.builds(Request, st.integers(1, 247), st.just(6), st.integers(0, 65535), st.just(1), st.just(b"\x12\x34")),
    st.builds(Request, st.integers(1, 247), st.just(5), st.integers(0, 65535), st.just(1), st.just(b"\xff\0")),
)


@given(_requests, st.sampled_from(REASONS), st.lists(_requests, max_size=4))
def test_corrections_are_whole_requests_of_the_same_unit(asked: Request, reason: str, well: list[Request]) -> None:
    for ask in corrected(reason, asked, [request for request in well if request.unit == asked.unit]):
        assert crc_ok(ask.adu)
        assert ask.unit == asked.unit
        assert request_of(ask.unit, ask.pdu) == ask
        assert asked.is_read <= ask.is_read, "in place of a read nothing is written"


@given(_requests)
def test_a_request_is_read_as_it_is_made(asked: Request) -> None:
    assert request_of(asked.unit, asked.pdu) == asked


@pytest.mark.parametrize(
    ("pdu", "code", "reason", "instead"),
    [
        ("0400000005", 1, "read-function", ["0300000005"]),
        ("0600090001", 1, "write-function", ["1000090001020001"]),
        ("2b0e0100", 1, "function", []),
        ("03ffff0008", 2, "range-end", ["03ffff0001"]),
        ("03ffff0008", None, "range-end", ["03ffff0001"]),
        ("039c410002", 2, "register-number", ["0300000002"]),
        ("0475310002", 3, "register-number", ["0400000002"]),
        ("0300000080", 3, "quantity", ["030000007d", "03007d0003"]),
        ("03ff83007e", 3, "range-end", ["03ff83007d"]),
    ],
)
def test_advice_of_a_request_and_its_exception(pdu: str, code: int | None, reason: str, instead: list[str]) -> None:
    found = advice(17, bytes.fromhex(pdu), code)
    assert found is not None
    assert (found.reason, [ask.pdu.hex() for ask in found.ask_instead]) == (reason, instead)


@given(
    st.sampled_from((5, 6, 15, 16, 22, 23)),
    st.binary(max_size=12),
    st.sampled_from((None, 1, 2, 3)),
    st.integers(0, 255),
)
def test_no_advice_writes_what_the_request_does_not_hold(
    function: int, body: bytes, code: int | None, unit: int
) -> None:
    """A cut or impossible write: what would be sent is no more than was meant, and can be sent."""
    told = advice(unit, bytes((function,)) + body, code)
    for instead in told.ask_instead if told is not None else ():
        assert len(instead.adu) <= 256 and (instead.is_read or len(instead.data) <= len(body))


@pytest.mark.parametrize(("pdu", "code"), [("0300000005", None), ("039c410002", None), ("0300000005", 2), ("03", 2)])
def test_no_advice_where_the_request_may_be_right(pdu: str, code: int | None) -> None:
    assert advice(17, bytes.fromhex(pdu), code) is None


def _rtu(body: str) -> str:
    data = bytes.fromhex(body)
    return (data + crc_bytes(data)).hex(" ")


def test_parse_says_it_in_one_line() -> None:
    paste = read(f"{_rtu('11039C410002')}\n{_rtu('118302')}")
    shown = tree(paste)
    assert shown.count("ask instead") == 1
    assert f"ask instead: {_rtu('110300000002').upper()}" in shown
    assert list(paste.to_json())[1]["ask_instead"] == [_rtu("110300000002").replace(" ", "")]


def _causes(drawn: Any, random: Random) -> list[Cause]:
    capture = Capture.of(drawn.header, chunks_of(drawn, "precise", random))
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
    return causes_of(ledger)


@pytest.mark.parametrize("kind", FLAWS)
def test_drawn_devices_have_the_reason_first(kind: str) -> None:
    random = Random(f"{kind} 5")
    drawn = flawed(kind, random)
    cause = _causes(drawn, random)[0]
    first = cause.to_json()
    assert first["reason"] in drawn.reasons
    assert first["units"] == [drawn.unit]
    asks = [bytes.fromhex(ask) for ask in first["ask_instead"]]
    answers = [drawn.devices[ask[0]].answer(ask[1:-2]) for ask in asks]
    assert answers
    assert all(answer is not None and answer[0] < 0x80 for answer in answers)
    with telling("ru"):
        words = told_again(cause.cause, numbers_kept(cause.numbers))
    assert words is not None
    asked = {bytes((unit,)) + pdu for unit, pdu in drawn.polls}
    new = [ask for ask in asks if ask[:-2] not in asked][:1]
    assert all(ask.hex(" ").upper() in words.remedy for ask in new)
    assert not any(ask.hex(" ").upper() in words.remedy for ask in asks if ask[:-2] in asked)  # it helps nobody
    assert not re.search(r"[A-Za-z]{4,}|None|[][{}|]", f"{words.text} {words.share} {words.remedy}")


@pytest.mark.parametrize("kind", ODD)
def test_odd_buses_have_no_reason(kind: str) -> None:
    random = Random(f"{kind} 5")
    assert not [cause for cause in _causes(odd(kind, random), random) if "reason" in cause.to_json()]


def test_a_write_whose_retry_reads_like_its_answer_fails_all_the_same() -> None:
    random = Random("write-function ftdi16 1002")
    drawn = flawed("write-function", random)
    capture = Capture.of(drawn.header, chunks_of(drawn, "ftdi16", random))
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
    assert causes_of(ledger)[0].to_json()["reason"] == "write-function"


def test_requests_of_one_check_value_are_no_retries() -> None:
    """04 of 6 registers from 18 and of 10 from 450 have the same CRC at unit 24."""
    random = Random("read-function irq 1001")
    drawn = flawed("read-function", random)
    capture = Capture.of(drawn.header, chunks_of(drawn, "irq", random))
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
    assert causes_of(ledger)[0].to_json()["reason"] == "read-function"
