"""Cases seen on real buses and in other tools' trackers, each with the reading that is right."""

from __future__ import annotations

from dataclasses import replace

import pytest
from buses import CHAR_NS, LINE, adu, deframed, spaced

from captures.chunks import Block, Chunk
from dissectors.crc import crc_bytes

READ = adu("1103006b0003")
ANSWER = bytes.fromhex("110306ae415652434049ad")


def untimed(*pieces: bytes) -> list[Chunk]:
    return [Chunk(0, b"".join(pieces))]


def test_the_example_of_the_specification() -> None:
    assert deframed(untimed(READ, ANSWER)).frames() == [(0, 8, "request", True), (8, 11, "response", True)]


def test_an_answer_whose_beginning_checks_by_chance_is_one_frame() -> None:
    answer = bytes.fromhex("04031c3fe915180302000102020003180200030b06c6390701010000000000 0dee")
    request = adu("04030000000e")
    for feed in (
        untimed(request, answer),
        spaced([request, answer]),
        [*spaced([request]), *_bytes(answer, 10**9 + 10**8)],
    ):
        assert deframed(feed).good() == [request, answer]


def _bytes(data: bytes, start: int) -> list[Chunk]:
    return [Chunk(start + (i + 1) * CHAR_NS, data[i : i + 1]) for i in range(len(data))]


@pytest.mark.parametrize("stray", [b"\0", b"\0\0", b"\xff", b"\xfe\0"])
def test_stray_bytes_of_a_switching_driver_belong_to_no_frame(stray: bytes) -> None:
    stream = [READ, stray, ANSWER, stray] * 10
    assert deframed(untimed(*stream)).good() == [READ, ANSWER] * 10


def test_a_frame_that_ends_in_00_keeps_its_last_byte() -> None:
    frame = next(f for n in range(65536) if (f := adu(f"010402{n:04x}"))[-1] == 0)
    assert deframed(untimed(adu("010400000001"), frame)).good() == [adu("010400000001"), frame]


def test_stray_00_after_a_short_answer() -> None:
    request, answer = adu("010400000001"), adu("0104020301")
    assert deframed(untimed(request, answer, b"\0", request, answer)).good() == [request, answer, request, answer]


def test_a_master_that_answers_after_two_characters_is_deframed_all_the_same() -> None:
    chunks, now = [], 10**9
    for frame in [READ, ANSWER] * 20:
        now += int(2.1 * CHAR_NS)
        for byte in frame:
            now += CHAR_NS
            chunks.append(Chunk(now, bytes([byte])))
    assert deframed(chunks).good() == [READ, ANSWER] * 20


def test_holes_of_40_and_120_ms_inside_frames() -> None:
    chunks, now = [], 10**9
    for frame in [READ, ANSWER] * 6:
        now += 200_000_000
        for part, hole in ((frame[:3], 0), (frame[3:6], 40_000_000), (frame[6:], 120_000_000)):
            now += hole + len(part) * CHAR_NS
            chunks.append(Chunk(now, part))
    assert deframed(chunks).good() == [READ, ANSWER] * 6


def test_whole_frames_inside_a_payload_are_payload() -> None:
    inner = adu("110600010002") + adu("110600010002") + adu("010300000001")
    request, answer = adu("05030000000c"), adu("050318" + inner.hex())
    for feed in (untimed(request, answer, request, answer), spaced([request, answer] * 3)):
        found = deframed(feed).good()
        assert found == [request, answer] * (len(found) // 2)
        assert len(found) >= 4


def test_payloads_that_look_like_frames_all_over() -> None:
    for payload in ("0183" * 64, "0011" * 64):
        request, answer = adu("010300000040"), adu("010380" + payload)
        assert deframed(untimed(request, answer)).good() == [request, answer]


def test_an_unknown_function_is_a_frame_where_its_neighbours_leave_room() -> None:
    request, answer = adu("0141deadbeef"), adu("0141c0ffee00112233")
    assert deframed(untimed(READ, ANSWER, request, answer, READ, ANSWER)).good() == [
        READ,
        ANSWER,
        request,
        answer,
        READ,
        ANSWER,
    ]


def test_diagnostics_with_more_than_two_data_bytes() -> None:
    echo = adu("01080000a5375566")
    assert deframed(spaced([READ, ANSWER, echo, echo, READ, ANSWER])).good() == [READ, ANSWER, echo, echo, READ, ANSWER]


def test_a_damaged_answer_is_a_damaged_frame_not_noise() -> None:
    broken = bytearray(ANSWER)
    broken[5] ^= 0x08
    frames = deframed(spaced([READ, bytes(broken), READ, ANSWER])).frames()
    assert frames == [
        (0, 8, "request", True), (8, 11, "response", False), (19, 8, "request", True), (27, 11, "response", True)
    ]  # fmt: skip


def test_echo_of_a_write_and_a_retry_are_told_apart_by_time() -> None:
    write = adu("11060001beef")
    chunks, now = [], 10**9
    truth = []
    for i in range(60):
        for kind, gap in (
            [("request", 400), ("request", 300), ("response", 5)] if i % 6 == 5 else [("request", 40), ("response", 5)]
        ):
            now += gap * 1_000_000 + 8 * CHAR_NS
            chunks.append(Chunk(now, write if i % 2 else READ if kind == "request" else ANSWER))
            truth.append(kind)
    said = [direction for _, _, direction, _ in deframed(chunks).frames()]
    assert said[40:] == truth[40:]  # by then this line's pauses are known


def test_traffic_that_is_not_modbus_gives_no_frame() -> None:
    nmea = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n" * 200
    assert deframed(untimed(nmea)).good() == []


def test_direction_marks_of_a_log_tell_request_from_answer() -> None:
    write = adu("11060001beef")
    chunks = [Chunk(10**9 + i * 10**8, write, mark=1 + i % 2) for i in range(12)]  # type: ignore[arg-type]
    assert [d for _, _, d, _ in deframed(chunks).frames()] == ["request", "response"] * 6


def test_two_ports_one_a_direction_pair_across_ports() -> None:
    chunks = []
    for i in range(10):
        chunks += [Chunk(10**9 + i * 10**8, READ, port=0), Chunk(10**9 + i * 10**8 + 15_000_000, ANSWER, port=1)]
    rows = deframed(chunks).rows
    assert rows.kind.tolist() == [1, 2] * 10
    assert rows.request[1::2].tolist() == rows.index[::2].tolist()


def test_across_ports_of_known_directions_all_at_once_and_read_by_read_pair_alike() -> None:
    write, lost, line = (
        adu("11060001beef"),
        adu("110600020102"),
        replace(LINE, notes={"directions": "request,response"}),
    )
    chunks = []
    for i in range(40):
        asked, answered = (write, write) if i % 2 else (READ, ANSWER)
        at = 10**9 + i * 10**8
        chunks += [Chunk(at, asked, port=0), Chunk(at + 15_000_000, answered, port=1)]
        if i % 5 == 0:  # one that nobody answers
            chunks.append(Chunk(at + 50_000_000, lost, port=0))
    once, read_by_read = deframed([Block.from_chunks(chunks)], line).rows, deframed(chunks, line).rows
    for rows in (once, read_by_read):
        answers = rows.kind == 2
        assert (answers == (rows.port == 1)).all()
        assert (rows.request[answers] == rows.index[answers] - 1).all()
    assert (once.response_ns == read_by_read.response_ns).all()


@pytest.mark.parametrize("registers", [0x2D, 0x05, 0x03])
def test_a_check_value_that_leaves_the_unit_out_makes_no_frame_of_the_rest(registers: int) -> None:
    """Firmware that computes it over the PDU alone, behind a gateway that sends the unit by itself: what follows the
    unit checks as a frame of its own, of whatever function the byte count is."""
    answer = bytes([3, 2 * registers]) + bytes((7 * i + 1) % 251 for i in range(2 * registers))
    asked = adu(f"0d030075{registers:04x}")
    pieces = [asked + b"\x0d", answer + crc_bytes(answer)] * 8
    others = [adu("0a0404130001") + adu("0a0402ffff"), adu("1b0303ec0002") + adu("1b030400112233")]
    found = deframed(spaced([*others * 6, *pieces], gap_ns=60_000_000))
    size = len(answer) + 3
    assert found.frames()[-16:] == [
        frame
        for start in range(len(found.data) - 8 * (8 + size), len(found.data), 8 + size)
        for frame in ((start, 8, "request", True), (start + 8, size, "response", False))
    ]
