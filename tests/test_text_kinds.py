"""Kinds of text whose bytes stand apart: each field in its cell, without check values, beside other numbers."""

from __future__ import annotations

from buses import adu

from analyzer.paste import PastedFrame, read

ASKED, ANSWER = adu("07040120 0002"), adu("07040400e1 01c8")


def right(text: str) -> list[tuple[str, str]]:
    return [(frame.role.name.lower(), frame.adu.data.hex()) for frame in read(text).frames() if frame.is_right]


def test_fields_in_cells_of_their_own_behind_the_rows_number_are_a_frame() -> None:
    rows = [
        f"| {i} | {i / 10:.3f} | → | {data[0]:02X} | {data[1]:02X} | {data[2:-2].hex(' ')} | {data[-2:].hex(' ')} |"
        for i, data in enumerate((ASKED, ANSWER), 1)
    ]
    text = "\n".join(["| # | t | way | unit | fc | data | crc |", "|---|---|---|---|---|---|---|", *rows])
    assert right(text) == [("request", ASKED.hex()), ("response", ANSWER.hex())]


def test_frames_of_a_text_that_leaves_check_values_out_are_not_wrong() -> None:
    bare = [f"{word}: {data[:-2].hex(' ')}" for word, data in (("ask", ASKED), ("answer", ANSWER))]
    whole = f"with the CRC:\n\n {adu('07040130 0001').hex(' ')}\n"
    paste = read("\n".join([*bare, *bare, whole]))
    frames = [piece for piece in paste.pieces if isinstance(piece, PastedFrame)]
    assert [frame.check_ok for frame in frames] == [None] * 4 + [True]
    assert [frame.role.name for frame in frames[:2]] == ["REQUEST", "RESPONSE"]


def test_one_frame_cut_by_two_bytes_among_whole_ones_is_cut() -> None:
    text = f"TX: {ASKED.hex(' ')}\nRX: {ANSWER[:-2].hex(' ')}\nTX: {ASKED.hex(' ')}\nRX: {ANSWER.hex(' ')}\n"
    assert [frame.check_ok for frame in read(text).frames()] == [True, False, True, True]


def test_numbers_of_telephones_and_units_are_no_bytes() -> None:
    frames = f"TX: {ASKED.hex(' ')}\nvalues: read input registers  slave 12\nRX: {ANSWER.hex(' ')}\n" * 2
    paste = read(f"{frames}\nL. Bianchi, tel. 02 55 12 34 80\nтелефон: 02 55 12 34 80\n")
    assert [piece.adu.data for piece in paste.pieces if isinstance(piece, PastedFrame)] == [ASKED, ANSWER] * 2
    assert len(paste.pieces) == 4
