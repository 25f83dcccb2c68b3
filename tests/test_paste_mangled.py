"""What dumps leave out, keyboards and forums change, and lost line breaks join: read as it was meant."""

from __future__ import annotations

import pytest
from buses import adu
from paste_readings import bytes_read

from analyzer.paste import PastedFrame, read

REQUEST, ANSWER = adu("2B0300A0 0002"), adu("2B0304 00CE 1DFA")
LONG = adu("2B0360" + "00" * 90 + "0102 0304 0506")
BOTH = [("request", REQUEST.hex()), ("response", ANSWER.hex())]


def pieces(text: str) -> list[tuple[str, str]]:
    return [
        (piece.role.name.lower(), piece.adu.data.hex())
        if isinstance(piece, PastedFrame)
        else ("noise", piece.data.hex())
        for piece in read(text).pieces
    ]


def dump(data: bytes, offset: str, *, words: bool = False) -> str:
    """Rows of 16 bytes; those like the one above are one `*`."""
    rows: list[str] = []
    for at in range(0, len(data), 16):
        row = data[at : at + 16]
        if at and row == data[at - 16 : at] and len(row) == 16:
            if rows[-1] != "*":
                rows.append("*")
            continue
        rows.append(f"{at:{offset}} {row.hex(' ', -2) if words else row.hex(' ')}")
    return "\n".join([*rows, f"{len(data):{offset}}"])


@pytest.mark.parametrize("offset", ["08x", "07o", "06x", "07x"])
@pytest.mark.parametrize("before", [b"", REQUEST, adu("2B10 0001 0003 06 0000 0000 0000")])
def test_rows_that_a_dump_leaves_out_are_there(offset: str, before: bytes) -> None:
    if offset == "07x" and not before:
        return  # as well octal
    text = dump(before + LONG, offset)
    assert "\n*\n" in text
    assert pieces(text)[-1] == ("response", LONG.hex())
    assert sum(len(data) for _, data in pieces(text)) == 2 * len(before + LONG)


def test_rows_that_xxd_leaves_out_are_there() -> None:
    rows = dump(REQUEST + LONG, "08x", words=True).splitlines()[:-1]
    text = "\n".join(row.replace(" ", ": ", 1) for row in rows)
    assert pieces(text) == [("request", REQUEST.hex()), ("response", LONG.hex())]


@pytest.mark.parametrize("width", [39, 75])
def test_digits_broken_within_a_byte_are_whole(width: int) -> None:
    digits = LONG.hex()
    text = "\n".join(digits[at : at + width] for at in range(0, len(digits), width))
    assert pieces(f"{REQUEST.hex(' ')}\n\n{text}") == [("request", REQUEST.hex()), ("response", LONG.hex())]


def test_bytes_run_together_without_zeros_are_parted_as_their_check_value_says() -> None:
    sent, received = ("".join(f"{octet:X}" for octet in data) for data in (REQUEST, ANSWER))
    assert pieces(f"Sent: {sent}\nReceived: {received}") == BOTH
    assert pieces(f"{sent}\n{received}") == BOTH
    assert not list(read(f"Sent: {sent[:-1]}\nReceived: {received[1:]}").frames())


def test_a_star_elsewhere_leaves_nothing_out() -> None:
    text = f"{REQUEST.hex(' ')}\n*\n{ANSWER.hex(' ')}\n*\n00000400 and so on"
    assert pieces(text) == BOTH


def test_millions_of_rows_are_not_written_again() -> None:
    text = "00000000 " + "00 " * 16 + "\n*\n7ffffff0 " + REQUEST.hex(" ")
    assert ("request", REQUEST.hex()) in pieces(text)


@pytest.mark.parametrize("sign", [" ", ", ", "; "])
@pytest.mark.parametrize("marks", [("TX", "RX"), ("Запрос:", "Ответ:")])
def test_several_turns_in_one_line_are_all_read(marks: tuple[str, str], sign: str) -> None:
    turn = f"{marks[0]} {REQUEST.hex(' ')}{sign}{marks[1]} {ANSWER.hex(' ')}"
    assert pieces(sign.join([turn] * 3)) == BOTH * 3


@pytest.mark.parametrize("marks", [("Tx:", "Rx:"), ("TX>", "RX>"), ("tx: ", "rx: ")])
def test_a_mark_hard_behind_a_byte_begins_a_line(marks: tuple[str, str]) -> None:
    turn = f"{marks[0]}{REQUEST.hex(' ').upper()}{marks[1]}{ANSWER.hex(' ').upper()}"
    assert pieces(turn * 2) == BOTH * 2


@pytest.mark.parametrize("sign", ["0×", "0х", "Ox", "О×", "oX"])
def test_what_stands_in_place_of_0x_is_it(sign: str) -> None:
    sent, received = (" ".join(f"{sign}{octet:02X}" for octet in data) for data in (REQUEST, ANSWER))
    assert pieces(f"шлю {sent}\nпришло {received}") == BOTH


def test_letters_of_another_alphabet_before_an_h_are_digits() -> None:
    sent, received = (" ".join(f"{octet:02X}h" for octet in data) for data in (REQUEST, ANSWER))
    assert "CEh" in received
    assert pieces(f"запрос: {sent}\nответ: {received.replace('CEh', 'СЕh')}") == BOTH


def test_blanks_within_bytes_are_none() -> None:
    for data in (REQUEST, ANSWER):
        assert bytes_read(f"Tx: {data[:2].hex(' ')} {' '.join(data[2:-1].hex())} {data[-1:].hex()}") == data


def test_letters_in_place_of_all_digits_are_digits() -> None:
    read_by_machine = adu("01010001 0001")
    text = read_by_machine[:6].hex(" ").replace("0", "O").replace("1", "l")
    assert "0" not in text
    assert pieces(f"{text} {read_by_machine[6:].hex(' ')}") == [("request", read_by_machine.hex())]
    assert pieces(f"{text} {read_by_machine[6:].hex(' ').translate(str.maketrans('01', 'OI'))}") == [
        ("request", read_by_machine.hex())
    ]


def test_what_a_debugger_repeats_is_there_as_often() -> None:
    body = ", ".join(f"0x{octet:x}" for octet in LONG)
    zeros = ", ".join(["0x0"] * 90)
    assert zeros in body
    assert pieces("$1 = {" + body.replace(zeros, "0x0 <repeats 90 times>") + "}") == [("response", LONG.hex())]


@pytest.mark.parametrize("behind", ["00", "0000", "FF"])
@pytest.mark.parametrize("label", ["", "buf "])
def test_what_stands_behind_an_answer_makes_no_request_of_it(behind: str, label: str) -> None:
    answer = adu("2B0302 0311")
    text = label + (answer + bytes.fromhex(behind)).hex(" ")
    assert pieces(text) == [("response", answer.hex()), ("noise", behind.lower())]


@pytest.mark.parametrize("label", ["raw: ", "what came = ", "bytes [", "Принято (hex): "])
def test_a_byte_of_letters_behind_a_sign_is_no_word(label: str) -> None:
    assert pieces(f"{label}FF 00 {ANSWER.hex(' ')}") == [("noise", "ff00"), BOTH[1]]
    assert pieces(f"man sah de {ANSWER.hex(' ')}") == [BOTH[1]]
