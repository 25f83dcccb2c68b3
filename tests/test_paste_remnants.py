"""What a paste shows of frames that are not whole: read by what was asked, and nothing said that it cannot carry."""

from __future__ import annotations

import pytest
from buses import adu
from hypothesis import example, given
from hypothesis import strategies as st

from analyzer.paste import Paste, PastedFrame, read

ASKED, ANSWER = adu("07040120 0002"), adu("07040400e1 01c8")
REFUSED = adu("078402")


def conversation(received: bytes, more: str = "") -> Paste:
    return read(f"TX: {ASKED.hex(' ')}\nRX: {received.hex(' ')}\n{more}")


def said(paste: Paste) -> list[tuple[str, str, int]]:
    return [
        (piece.role.name.lower(), piece.adu.data.hex(), piece.missing)
        if isinstance(piece, PastedFrame)
        else ("noise", piece.data.hex(), 0)
        for piece in paste.pieces
    ]


@pytest.mark.parametrize("before", ["", "00", "2a0000", "1d"])
@pytest.mark.parametrize("length", [5, 7, 8])
def test_an_answer_that_came_shifted_and_cut_is_the_answer(before: str, length: int) -> None:
    """As a receiver gives it that had bytes left over, and stops at the number that it expects."""
    *noise, answer = said(conversation(bytes.fromhex(before) + ANSWER[:length]))[1:]
    assert noise == ([("noise", before, 0)] if before else [])
    assert answer == ("response", ANSWER[:length].hex(), len(ANSWER) - length)


@pytest.mark.parametrize("length", [3, 6, 7])
def test_a_request_that_comes_back_cut_is_its_echo(length: int) -> None:
    assert said(conversation(ASKED[:length]))[1] == ("request", ASKED[:length].hex(), len(ASKED) - length)


@pytest.mark.parametrize("refused", [REFUSED[:3], REFUSED[:4]])
def test_a_refusal_without_its_crc_is_one(refused: bytes) -> None:
    frame = conversation(refused).pieces[1]
    assert isinstance(frame, PastedFrame) and frame.exception == 2 and frame.missing == 5 - len(refused)


def test_frames_whose_crcs_are_not_shown_are_frames_of_which_nothing_is_wrong() -> None:
    paste = read("\n".join(frame[:-2].hex(" ") for frame in (ASKED, ANSWER, ASKED, REFUSED)))
    assert [(role, missing) for role, _, missing in said(paste)] == [("request", 2), ("response", 2)] * 2
    assert [[finding.code for finding in frame.findings] for frame in paste.frames()] == [[], [], [], ["exception"]]


def test_no_frame_runs_on_from_one_line_into_the_next() -> None:
    assert said(conversation(ANSWER[:7], "the value: 7F FF FF FF"))[1:] == [
        ("response", ANSWER[:7].hex(), 2),
        ("noise", "7fffffff", 0),
    ]


@pytest.mark.parametrize("stray", ["fe064180020202020702c2", "7f7effffeb7519", "5aa50506"])
def test_bytes_that_answer_nothing_are_none(stray: str) -> None:
    assert said(conversation(bytes.fromhex(stray)))[1:] == [("noise", stray, 0)]


def test_lines_of_another_protocol_are_no_cut_frame() -> None:
    paste = read("12: Sent=FE0221000103\n13: Received=FE036100000102FF\n14: Sent=FE0145C0088C\n")
    assert not list(paste.frames())


@pytest.mark.parametrize("form", ["RX: {}", "[RX] {} (all of it)", "recv {}", "{}"])
@pytest.mark.parametrize("stray", [b":", b">", b"\xff", b"\xab", b"\x02"])
def test_a_byte_before_a_frame_is_not_lost(form: str, stray: bytes) -> None:
    assert said(read(form.format((stray + ANSWER).hex(" "))))[0] == ("noise", stray.hex(), 0)


@given(st.binary(min_size=1, max_size=12), st.integers(0, 9))
@example(bytes.fromhex("9efc315dcb"), 2)  # without FC, which is a field's name elsewhere, the CRC is right
def test_every_byte_of_a_received_line_is_in_one_piece(stray: bytes, length: int) -> None:
    paste = read(f"TX: {ASKED.hex(' ')} \nRX: {(stray + ANSWER[:length]).hex(' ')} \n")
    pieces = [piece.adu.data if isinstance(piece, PastedFrame) else piece.data for piece in paste.pieces]
    assert b"".join(pieces) == b"".join([ASKED, stray, ANSWER[:length]])


def test_a_text_without_times_tells_of_no_two_senders() -> None:
    wrong = adu("07040121 0003")[:-1] + b"\0"
    paste = conversation(wrong, f"TX: {ASKED.hex(' ')}\nRX: {ANSWER.hex(' ')}\n")
    assert "collision" not in {finding.code for frame in paste.frames() for finding in frame.findings}


def test_a_request_behind_which_other_bytes_came_is_not_said_to_have_got_none() -> None:
    answered = conversation(b"\x07\0\0\0\0", f"TX: {ASKED.hex(' ')}\nRX: {ANSWER.hex(' ')}\n")
    silent = read(f"TX: {ASKED.hex(' ')}\n" * 2 + f"RX: {ANSWER.hex(' ')}\n")
    codes = [[finding.code for finding in frame.findings] for frame in answered.frames()]
    assert "no-response" not in codes[0] and "no-response" in [f.code for f in next(silent.frames()).findings]


def test_an_answer_that_is_shown_again_accuses_no_second_device() -> None:
    lines = f"TX: {ASKED.hex(' ')}\nRX: {ANSWER.hex(' ')}\n"
    again = read(lines + "\n" * 20 + f"as the monitor has it:\nresponse: {ANSWER.hex(' ')}\n")
    assert not any(finding.code == "duplicate-response" for frame in again.frames() for finding in frame.findings)


def test_one_header_of_another_protocol_leaves_the_rest_modbus_tcp() -> None:
    lines = ["0020 0001 0006 010300000001", "0021 0000 0006 010300000001", "0021 0000 0005 0103023039"]
    paste = read("\n".join(bytes.fromhex(line).hex(" ") for line in lines))
    assert paste.protocol == "tcp" and [kind for kind, *_ in said(paste)] == ["noise", "request", "response"]


def test_an_echo_of_which_all_wide_bytes_changed_tells_how_many_bits_arrive() -> None:
    ask = adu("0103 0000 000a")
    heard = ask[:-2] + b"\x05\x1e"  # of C5 CD
    [found] = read(f"sent {ask.hex(' ')}\nreceived {heard.hex(' ')}").pieces[1].findings
    assert (found.code, found.numbers["data_bits"]) == ("echo", 5)
    assert "5 data bits" in found.cause


def test_an_echo_with_one_byte_off_tells_no_number_of_bits() -> None:
    ask = adu("0103 0000 000a")
    heard = ask[:-1] + b"\x0d"
    [found] = read(f"sent {ask.hex(' ')}\nreceived {heard.hex(' ')}").pieces[1].findings
    assert found.code == "echo" and "data_bits" not in found.numbers


def test_bytes_beside_frames_say_what_they_are() -> None:
    _, newline, _, after = read(f"TX: {ASKED.hex(' ')} 0D 0A\nRX: {ANSWER.hex(' ')} 00").pieces
    assert [piece.findings[0].text for piece in (newline, after)] == [
        "2 bytes, a newline (0D, 0A), right after the frame of the client",
        "1 byte of 00 or FF right after the frame of unit 7",
    ]


def test_stretches_that_begin_alike_are_an_envelope_and_the_first_is_nothing() -> None:
    one, two = (f"55 AA EB 90 {i:02X} 4D 12 7F {i + 3:02X} 31" for i in (1, 9))
    text = f"{ASKED.hex()}\n{one}\n{ANSWER.hex()}\n{ASKED.hex()}\n{two}\n{ANSWER.hex()}"
    first, second = (piece for piece in read(text).pieces if not isinstance(piece, PastedFrame))
    assert not first.findings
    assert "begin like earlier ones: 55 AA" in second.findings[0].text


def test_a_refusal_of_another_unit_with_a_wrong_crc_is_no_answer() -> None:
    assert said(conversation(bytes.fromhex("55aaeb84020527121131")))[1] == ("noise", "55aaeb84020527121131", 0)


def test_nothing_but_zeros_is_told_as_a_low_line() -> None:
    assert "every byte is 00" in read("00 00 00 00").why


WRONG = bytes.fromhex("0704012000021234"), bytes.fromhex("0704012200021234")


@pytest.mark.parametrize("between", ["\n", " ", "\nTX: "])
def test_frames_of_which_no_crc_is_right_are_frames_all_of_them(between: str) -> None:
    paste = read(("TX: " * ("TX" in between)) + between.join(frame.hex(" ") for frame in WRONG))
    assert said(paste) == [("request", frame.hex(), 0) for frame in WRONG]
    assert [frame.adu.check_computed is not None for frame in paste.frames()] == [True, True]


def test_lines_of_which_most_are_no_frames_are_none() -> None:
    lines = [
        "1a 2b 3c 4d 5e 6f 70 81",
        "92 a3 b4 c5 d6 e7 f8 09",
        "0a 1b 2c 3d 4e 5f",
        WRONG[0].hex(" "),
        "77 88 99 aa",
    ]
    assert not any(frame.length == len(WRONG[0]) for frame in read("\n".join(lines)).frames())


@pytest.mark.parametrize("place", ["00 00", "ff ff"])
def test_what_keeps_the_place_of_a_crc_is_told(place: str) -> None:
    (frame,) = read(f"{ASKED[:-2].hex(' ')} {place}").frames()
    (finding,) = frame.findings
    assert finding.code == "crc-error" and finding.text.startswith(place.upper())
    assert ASKED[-2:].hex(" ").upper() in finding.remedy


def test_a_damaged_request_that_comes_back_behind_a_stray_byte_is_it() -> None:
    shown = "".join(f"[{byte:02X}]" for byte in WRONG[0])
    paste = read(f"{shown}\nthe other end shows:\n[FF]{shown}")
    frame = ("request", WRONG[0].hex(), 0)
    assert said(paste) == [frame, ("noise", "ff", 0), frame]


@pytest.mark.parametrize("frame", [ASKED, ANSWER])
def test_a_frame_without_its_unit_is_told_with_it(frame: bytes) -> None:
    (piece,) = read(frame[1:].hex(" ")).pieces
    assert not isinstance(piece, PastedFrame)
    (finding,) = piece.findings
    assert finding.code == "byte-missing" and "with 07 as byte 0" in finding.text and "unit" in finding.cause


def test_of_an_answer_that_ends_behind_its_first_byte_its_length_is_told() -> None:
    paste = read(f"{ASKED.hex(' ')}\n07\n{ASKED.hex(' ')}\n07\n{ASKED.hex(' ')}")
    told = [finding.text for piece in paste.pieces for finding in piece.findings if finding.code == "truncated"]
    assert len(told) == 2 and all("one of 9 bytes" in text for text in told)


@pytest.mark.parametrize("left_out", [0, 2])
def test_the_last_request_of_a_text_may_have_got_its_answer(left_out: int) -> None:
    shown = ASKED[: len(ASKED) - left_out].hex(" ")
    paste = read("\n".join(f"12:00:0{i}.250 TX: {shown}" for i in range(4)))
    silent = [any(finding.code == "no-response" for finding in frame.findings) for frame in paste.frames()]
    assert silent == [True, True, True, False]


def test_stretches_before_frames_that_begin_with_the_same_byte_are_an_envelope() -> None:
    lines = ["TX: a5 17 00 10 45 " + ASKED.hex(" ") + " 08 15", "RX: a5 3b 00 10 15 " + ANSWER.hex(" ") + " 09 15"]
    told = [finding.text for piece in read("\n".join(lines)).pieces for finding in piece.findings]
    assert any("begin like earlier ones: A5" in text for text in told)
