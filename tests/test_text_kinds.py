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


def bytes_of(text: str) -> list[str]:
    return [piece.adu.data.hex() if isinstance(piece, PastedFrame) else piece.data.hex() for piece in read(text).pieces]


def test_a_lone_byte_is_read_where_a_column_tells_sizes() -> None:
    rows = [
        f"line 3;{2 + i / 10:.1f};Answer;{len(data)};{data.hex().upper()};"
        for i, data in enumerate((ASKED, ANSWER) * 3)
    ]
    rows.insert(3, "line 3;2.25;?;1;00;Fault")
    assert "00" in bytes_of("\n".join(rows))


def test_a_lone_byte_is_read_below_a_line_that_announces_it() -> None:
    text = "".join(
        f"#{i} came in, {len(data)} bytes\n0000  {data.hex(' ')}\n" for i, data in enumerate((ASKED, b"\x00", ANSWER))
    )
    assert bytes_of(text * 2).count("00") == 2


def test_a_row_with_an_error_in_a_cell_of_its_own_is_read() -> None:
    spoilt = bytearray(ANSWER)
    spoilt[4] ^= 0x10
    rows = [
        f"{i},{i / 1000:.6f},{byte:#04x}{',Parity,' if i == 11 else ',,'}"
        for i, byte in enumerate(ASKED + spoilt + ASKED + ANSWER)
    ]
    assert "".join(bytes_of("No,Time,Data,Error,\n" + "\n".join(rows))) == (ASKED + spoilt + ASKED + ANSWER).hex()


def test_a_buffer_shown_behind_each_piece_that_comes_is_said_already() -> None:
    def shown(i: int) -> str:
        ask, first, rest, whole = (data.hex(" ") for data in (ASKED, ANSWER[:4], ANSWER[4:], ANSWER))
        return (
            f"12:00:0{i}.1 sent {{ data: <Buffer {ask}> }}\n"
            f"12:00:0{i}.2 got {{ data: <Buffer {first}>, all: <Buffer {first}> }}\n"
            f"12:00:0{i}.3 got {{ data: <Buffer {rest}>, all: <Buffer {whole}> }}\n"
        )

    assert "".join(bytes_of("".join(map(shown, range(3))))) == (ASKED + ANSWER).hex() * 3
