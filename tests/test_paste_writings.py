"""What stands beside bytes: signs that some are left out, values that look like a mail's escapes, numbers of lines."""

from __future__ import annotations

from pathlib import Path

from paste_readings import bytes_read, frames_read

import captures
from analyzer.analysis import Analysis
from analyzer.paste import judge, read
from analyzer.tables.schema import Kind

ASKS, ANSWERS = "01 03 00 00 00 02 C4 0B", "01 03 04 00 11 00 22 2A 2F"


def hexed(text: str) -> bytes:
    return bytes.fromhex(text)


def test_bytes_behind_those_that_are_left_out_are_read() -> None:
    text = f"TX: {ASKS}\nRX: 01 03 14 00 00 00 01 ... 00 02 ... C4 20"
    assert bytes_read(text) == hexed(ASKS + "01 03 14 00 00 00 01 00 02 C4 20")
    assert [one.why for one in read(text).unread] == ["the text omits bytes after the first 7"]
    assert bytes_read(f"TX: {ASKS}\nRX: 01 03 14 00 00 … C4 20") == hexed(ASKS + "01 03 14 00 00 C4 20")
    assert bytes_read(f"TX: {ASKS}\nRX: 01 03 14 00 00 ... 20 more bytes") == hexed(ASKS + "01 03 14 00 00")


def test_a_value_at_a_lines_end_is_no_escape_of_a_mail() -> None:
    frame = bytes.fromhex("01 10 00 10 00 03 06 00 9A 00 00 00 00 BF 09")
    assert bytes_read("TX: 01 10 00 10 00 03 06 00 9A 00 00 00 00 CRCL=BF CRCH=09") == frame
    assert bytes_read(f"Sent =3D {ASKS}=20") == hexed(ASKS)
    valued = bytes.fromhex("01 04 00 E5 00 01 20 3D")
    assert bytes_read("; ".join(f"b{i}={octet:02X}h" for i, octet in enumerate(valued))) == valued


def test_a_dumps_pairs_that_could_be_decimals_are_hex() -> None:
    rows = [
        "12 01 00 00 00 09 02 01 06 04 4C 00 00 00 00 C7",
        "00 C6 00 C7 12 03 00 00 00 06 02 06 01 00 00 00",
        "12 03 00 00 00 06 02 06 01 00 00 00",
    ]
    text = "\n".join(f"{16 * i:08x}  {row}" for i, row in enumerate(rows))
    assert bytes_read(f"{text}\n0000002c") == hexed(" ".join(rows))


def test_numbers_of_lines_need_neighbours_that_count_on() -> None:
    both = [("request", hexed(ASKS).hex()), ("response", hexed(ANSWERS).hex())]
    assert frames_read(f"  41 {ASKS}\n  42 {ANSWERS}") == both
    assert bytes_read(f"  41 {ASKS}\n  44 {ANSWERS}") == b"\x41" + hexed(ASKS) + b"\x44" + hexed(ANSWERS)


def test_nobody_answers_himself(tmp_path: Path) -> None:
    """A log of one side's writes has no answers, of the other no requests; where a sniffer marks both alike it has."""
    write = "01 06 00 01 00 07 99 C8"
    for lines, roles in (
        ([f"01.100 TX: {write}", f"02.100 TX: {write}"], ["request", "request"]),
        ([f"01.100 RX: {write}", f"02.100 RX: {write}"], ["response", "response"]),
        (
            [f"01.100 TX: {write}", f"02.100 TX: {write}", f"02.130 RX: {write}", f"03.100 TX: {ASKS}"],
            ["request", "request", "response", "request"],
        ),
        (
            [f"01.100 RX: {write}", f"01.130 RX: {write}", f"02.100 RX: {ASKS}", f"02.130 RX: {ANSWERS}"],
            ["request", "response"] * 2,
        ),
    ):
        text = "\n".join(f"10:00:{line}" for line in lines)
        assert [role for role, _ in frames_read(text)] == roles, text
        path = tmp_path / "log.txt"
        path.write_text(text)
        rows = Analysis(captures.open(path, judge=judge)).rows()
        assert [Kind(kind).name.lower() for kind in rows.kind] == roles, text


def test_ascii_frames_stand_end_to_end_and_behind_a_words_colon() -> None:
    asks, answers = ":010300000002FA", ":01030400110022C5"
    both = [("request", asks[1:].lower()), ("response", answers[1:].lower())]
    assert frames_read(asks + answers) == both
    assert frames_read(f"Query{asks}\nResponse{answers}") == both


def test_frames_whose_crc_is_turned_round_are_bytes_in_any_writing() -> None:
    turned = hexed("01 03 00 00 00 02 0B C4") + hexed("01 03 04 00 11 00 22 2F 2A")
    first, second = turned[:8], turned[8:]
    for text in (
        f"TX: {', '.join(map(str, first))}\nRX: {', '.join(map(str, second))}",
        f"tx = {list(first)}\nrx = {list(second)}",
        f"bus/set {first.hex()}\nbus/get {second.hex()}",
        f"{' '.join(f'{byte:b}'.zfill(8) for byte in first)}\n{' '.join(f'{byte:b}'.zfill(8) for byte in second)}",
    ):
        assert bytes_read(text) == turned, text
    number = "TX: 01 03 00 00 00 02 CRC: 0x0BC4"  # with its high byte first, as numbers are written
    assert frames_read(number) == [("request", hexed(ASKS).hex())]


def test_bytes_a_line_are_read_whatever_they_look_like() -> None:
    answer = hexed("01 03 04 00 56 00 28 9A 39")  # damaged, with bytes that look decimal
    lines = [f"10:00:01.130 RX: {byte:02X}" for byte in answer]
    assert bytes_read("\n".join([f"10:00:01.100 TX: {ASKS}", *lines])) == hexed(ASKS) + answer
