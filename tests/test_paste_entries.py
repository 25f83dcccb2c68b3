"""Pastes as people post them: logs that say things twice, that lost their line breaks, that show echoes and noise."""

import json
from datetime import UTC
from pathlib import Path

import pytest
from buses import adu

from analyzer.cli import main
from analyzer.paste import Paste, PastedFrame, PastedNoise, read
from dissectors.crc import crc_bytes


def with_crc(data: bytes) -> bytes:
    return data + crc_bytes(data)


ASK = with_crc(bytes.fromhex("110300640004"))
REPLY = with_crc(bytes.fromhex("110308000A000B000C000D"))


def hexed(data: bytes, sign: str = " ") -> str:
    return data.hex(sign)


def hashed(data: bytes) -> str:
    return " ".join(f"0x{octet:x}" for octet in data)


def pieces(paste: Paste) -> list[tuple[str, str]]:
    return [
        (piece.role.name.lower() if isinstance(piece, PastedFrame) else "noise", hexed(data_of(piece)))
        for piece in paste.pieces
    ]


def data_of(piece: PastedFrame | PastedNoise) -> bytes:
    return piece.adu.data if isinstance(piece, PastedFrame) else piece.data


def of(*named: tuple[str, bytes]) -> list[tuple[str, str]]:
    return [(name, hexed(data)) for name, data in named]


def test_entries_that_lost_their_line_breaks_are_entries() -> None:
    entry = "[21:07:{:02}][D][uart_debug:114]: >>> " + hexed(ASK, ":").upper()
    other = "[21:07:{:02}][D][modbus_controller:039]: Modbus command to device=17 register=0x64 no response received"
    text = " ".join(line.format(second) for second in (8, 9) for line in (entry, entry, other))
    paste = read(text)
    assert pieces(paste) == of(*[("request", ASK)] * 4)
    times = [piece.t_start_ns for piece in paste.pieces if isinstance(piece, PastedFrame)]
    assert times[1] is not None
    assert times[2] == times[1] + 10**9


def test_what_one_library_says_of_a_read_in_parts_counts_once() -> None:
    stamp = "2026-03-0{} 10:00:0{},250 DEBUG logging:103 "
    said = []
    for second, part in enumerate((ASK[:4], ASK[4:]), 1):
        said += [f"recv: {hashed(part)} old_data:  addr=None", f"Handling data: {hashed(part)}"]
        said += [f"Processing: {hashed(ASK[: 4 * second])}"]
    said += [f"Getting Frame - {hashed(ASK[1:-2])}", f"Resetting frame - Current Frame in buffer - {hashed(ASK)}"]
    text = "\n".join(stamp.format(1, i) + words for i, words in enumerate(said))
    assert pieces(read(text)) == of(("request", ASK))


def test_bytes_that_a_library_calls_unexpected_are_those_received() -> None:
    said = [f">>>>> send: {hashed(ASK)}"]
    for i in range(5):
        said += [f">>>>> recv: 0x{REPLY[i]:x} extra data: {hashed(REPLY[:i])}"]
        said += [f">>>>> extra:  unexpected data: {hashed(REPLY[: i + 1])}"]
    paste = read("\n".join(said))
    assert pieces(paste)[0] == ("request", hexed(ASK))
    assert b"".join(data_of(piece) for piece in paste.pieces) == ASK + REPLY[:5]


def test_an_event_that_two_handlers_log_is_one() -> None:
    lines = [
        f"2026-03-01 10:00:00,{milli} DEBUG {name}{words}"
        for milli, words in ((120, f"SEND: {hashed(ASK)}"), (190, f"RECV: {hashed(REPLY)}"))
        for name in ("logging:103 ", "")
    ]
    assert pieces(read("\n".join(lines))) == of(("request", ASK), ("response", REPLY))
    later = lines[0].replace(",120", ",620")
    assert pieces(read("\n".join([lines[0], later]))) == of(*[("request", ASK)] * 2)


@pytest.mark.parametrize(
    ("sent", "received"),
    [
        ("write <Buffer {}>", "resp <Buffer {}>"),
        ("Will write to instrument (expecting 13 bytes back): {} (8 bytes)", "Response from instrument: {} (8 bytes)"),
    ],
)
def test_an_echo_is_no_copy_of_what_was_sent(sent: str, received: str) -> None:
    octets = hexed(ASK)
    assert pieces(read(f"{sent.format(octets)}\n{received.format(octets)}\n")) == of(*[("request", ASK)] * 2)


def test_an_answer_and_a_stray_zero_of_the_next_line_are_no_illegal_request(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reply = with_crc(bytes.fromhex("11030209C4"))
    text = f"The meter is asked and replies with {hexed(reply)} as it should,\nbut what I get is\n00 {hexed(reply)}\n"
    assert pieces(read(text)) == of(("response", reply), ("noise", b"\0"), ("response", reply))
    path = tmp_path / "post.txt"
    path.write_text(text)
    assert main(["export", str(path), "--noise", "-o", "-"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["hex"] for row in rows] == [reply.hex(), "00", reply.hex()]


@pytest.mark.parametrize("digits", ["02X", "x"])
def test_signed_bytes_without_anything_between(digits: str) -> None:
    lines = [f"{word}: " + "".join(f"0x{octet:{digits}}" for octet in data) for word, data in said_and_heard()]
    assert pieces(read("\n".join(lines))) == of(("request", ASK), ("response", REPLY))


def said_and_heard() -> tuple[tuple[str, bytes], tuple[str, bytes]]:
    return ("Sending", ASK), ("Received", REPLY)


def test_rows_below_a_time_have_it_whatever_their_offsets_look_like() -> None:
    text = ""
    for second, (_, data) in enumerate(said_and_heard()):
        words = " ".join(data[i : i + 2].hex() for i in range(0, len(data), 2))
        text += f"10:00:0{second}.250000 IP 10.0.0.7.50211 > 10.0.0.9.4001: length {len(data)}\n"
        text += f"\t0x0000:  {words:<39}  ................\n"
    paste = read(text)
    assert pieces(paste) == of(("request", ASK), ("response", REPLY))
    times = [piece.t_start_ns for piece in paste.pieces if isinstance(piece, PastedFrame)]
    assert times == [36_000_250_000_000, 36_001_250_000_000]


def test_who_is_responding_is_heard() -> None:
    echo = with_crc(bytes.fromhex("110600640001"))
    for word in ("responding", "responded", "replies", "answered"):
        assert pieces(read(f"the drive {word}: {hexed(echo)}")) == of(("response", echo))


def test_a_cut_answer_before_a_repeated_request_is_no_copy_of_the_whole_one() -> None:
    bracketed, angled = (
        "".join(f"{a}{octet:02X}{b}" for octet in data) for data, a, b in ((ASK, *"[]"), (REPLY, *"<>"))
    )
    said = [bracketed, "Waiting for a confirmation...", angled[:20] + "Bytes flushed (5)", bracketed, angled]
    found = pieces(read("\n".join(said)))
    assert found == of(("request", ASK), ("response", REPLY[:5]), ("request", ASK), ("response", REPLY))


def test_a_buffer_shown_at_each_arrival_is_no_read_of_its_own() -> None:
    said = [f"send: {hashed(ASK)}"]
    for start, end in ((0, 4), (4, 12), (12, 13)):
        said += [f"recv: {hashed(REPLY[start:end])}", f"Processing: {hashed(REPLY[:end])}", "Frame - not ready"]
    assert pieces(read("\n".join(said))) == of(("request", ASK), ("response", REPLY))


def test_a_buffer_that_two_layers_show_at_each_arrival_is_one() -> None:
    stamp = "[2026-03-01T10:00:00.{:03d}Z TRACE codec::rtu] {}::decode({!r})"
    refusal = with_crc(bytes.fromhex("118302"))
    shown = [stamp.format(i, who, refusal[:i]) for i in range(1, 6) for who in ("Codec", "Decoder")]
    assert pieces(read("\n".join(shown))) == of(("response", refusal))


def test_a_buffer_without_its_check_value_below_the_frame_is_no_frame() -> None:
    write = with_crc(bytes.fromhex("11050001FF00"))
    text = f"TX:{hexed(write)}\nRX:{hexed(write)}\nbuf <Buffer {hexed(write[:-2])}>"
    assert pieces(read(text)) == of(("request", write), ("response", write))


def test_two_handlers_with_clocks_of_their_own_log_one_event() -> None:
    said = []
    for second, word, data in ((1, "send", ASK), (2, "recv", REPLY), (3, "send", ASK), (4, "send", ASK)):
        said += [f"2026-03-05 10:00:0{second}.250 DEBUG (MainThread) [pymodbus.logging] {word}: {hashed(data)}"]
        said += [f"2026-03-05 10:00:0{second},251 DEBUG transport:334 {word}: {hashed(data)}"]
    assert pieces(read("\n".join(said))) == of(
        ("request", ASK), ("response", REPLY), ("request", ASK), ("request", ASK)
    )


def captured(text: str, folder: Path) -> list[tuple[str, str]]:
    """Directions and bytes as a capture has them."""
    log, out = folder / "log.txt", folder / "out.jsonl"
    log.write_text(text, encoding="utf-8")
    assert main(["export", str(log), "--format", "jsonl", "-o", str(out), "--overwrite"]) == 0
    return [(row["direction"], hexed(bytes.fromhex(row["hex"]))) for row in map(json.loads, out.open(encoding="utf-8"))]


@pytest.mark.parametrize("body", ["0105000AFF00", "0106000A0003", "010800001234", "01410102"])
@pytest.mark.parametrize(("mark", "direction"), [("TX", "request"), ("RX", "response")])
def test_a_lone_frame_that_reads_both_ways_goes_as_its_mark_says(
    body: str, mark: str, direction: str, tmp_path: Path
) -> None:
    frame = with_crc(bytes.fromhex(body))
    text = f"{mark} {hexed(frame)}\n"
    assert pieces(read(text)) == captured(text, tmp_path) == of((direction, frame))


def test_the_side_that_is_echoed_asks() -> None:
    write = with_crc(bytes.fromhex("0106000A0003"))
    text = f"RX {hexed(write)}\nTX {hexed(write)}\n"
    assert pieces(read(text)) == of(("request", write), ("response", write))


@pytest.mark.parametrize(
    ("body", "direction"),
    [
        ("01030500010002", "response"),
        ("110403 00FA", "response"),
        ("011000000002 0000010002", "request"),
        ("0103 0000", "response"),
    ],
)
def test_a_lone_frame_with_a_wrong_count_is_of_the_side_that_counts(body: str, direction: str, tmp_path: Path) -> None:
    frame = with_crc(bytes.fromhex(body))
    assert pieces(read(hexed(frame))) == captured(hexed(frame), tmp_path) == of((direction, frame))


def test_seconds_with_as_many_decimals_as_a_program_has_are_times(tmp_path: Path) -> None:
    octets = [(2.5 + 0.001 * i, octet) for i, octet in enumerate(ASK)] + [
        (2.6 + 0.001 * i, o) for i, o in enumerate(REPLY)
    ]
    log, out = tmp_path / "log.txt", tmp_path / "out.jsonl"
    log.write_text("".join(f"{at:.15f},'{octet}'\t(0x{octet:02X}),,\n" for at, octet in octets), encoding="utf-8")
    assert main(["export", str(log), "--format", "jsonl", "-o", str(out)]) == 0
    starts = [json.loads(line)["t_start_ns"] for line in out.open(encoding="utf-8")]
    assert starts[1] - starts[0] == 100_000_000


@pytest.mark.parametrize("digits", [0, 1, 3])
def test_a_paste_tells_times_as_a_capture_of_it_does(digits: int, tmp_path: Path) -> None:
    log, out = tmp_path / "log.txt", tmp_path / "out.jsonl"
    moments = ("12:00:00.118", "12:00:00.163", "12:00:01.119", "12:00:01.171")
    pairs = zip(moments, (ASK, REPLY) * 2, strict=True)
    log.write_text("".join(f"{at[: 9 + digits].rstrip('.')} {hexed(data)}\n" for at, data in pairs), encoding="utf-8")
    assert main(["export", str(log), "--format", "jsonl", "-o", str(out), "--tz", "UTC"]) == 0
    names = ("t_start_ns", "t_end_ns", "request_start", "response_time_ns")
    lines = [[line[name] for name in names] for line in map(json.loads, out.open(encoding="utf-8"))]
    frames = read(log.read_text(encoding="utf-8"), zone=UTC).frames()
    assert [[frame.to_json(number)[name] for name in names] for number, frame in enumerate(frames)] == lines
    assert [line[3] for line in lines] == [None, 45_000_000, None, 52_000_000] if digits == 3 else [None] * 4


@pytest.mark.parametrize(
    "text",
    [
        "M->S: {one}\nS->M: {one}\nM->S: {other}\nS->M: {other}",
        "-> {one} <- {one} -> {other} <- {other}",
        "№\tЗапрос\tОтвет\tРегистр\n1\t{one}\t{one}\t40002\n2\t{other}\t{other}\t40003",
        "Вот что шлю и что приходит:\n\n{one}\n{one}\n{other}\n{other}",
        "Request time;Request;Response time;Response\n10:00:00.118;{one};10:00:00.163;{one}\n"
        "10:00:01.118;{other};10:00:01.163;{other}",
    ],
)
def test_writes_and_their_echoes_go_as_the_text_says(text: str, tmp_path: Path) -> None:
    one, other = (with_crc(bytes.fromhex(body)) for body in ("010600010017", "010600020019"))
    text = text.format(one=hexed(one), other=hexed(other))
    both = of(("request", one), ("response", one), ("request", other), ("response", other))
    assert pieces(read(text)) == captured(text, tmp_path) == both


def test_a_line_of_pymodbus_that_is_wrapped_within_bytes_loses_none() -> None:
    text = (
        "ERROR: request ask for id=1 but got id=127, Skipping. >>>>> send: 0x1 0x3 0x0 \n"
        "0x0 0x0 0x1 0x84 0xa >>>>> recv: 0x1 0x3 0x2 0x0 0xfa 0x38 0x7 extra data:"
    )
    frames = [frame.adu.data.hex() for frame in read(text).frames() if frame.check_ok]
    assert frames == ["010300000001840a", "01030200fa3807"]


def test_pymodbus_says_of_a_short_frame_what_it_received() -> None:
    head, rest = "0x7 0x4 0x1", " ".join(f"0x{byte:x}" for byte in adu("07040120 0002")[3:])
    text = (
        f"2026-03-05 09:15:26,303 DEBUG transport:322 recv: {head} old_data:  addr=None\n"
        f"2026-03-05 09:15:26,303 DEBUG rtu:105 Short frame: {head} wait for more data\n"
        f"2026-03-05 09:15:26,319 DEBUG transport:322 recv: {rest} old_data:  addr=None\n"
    )
    assert [frame.adu.data for frame in read(text).frames()] == [adu("07040120 0002")]


def test_a_string_that_stands_twice_in_a_line_is_one() -> None:
    shown = "".join(f"\\x{byte:02x}" for byte in adu("07040120 0002")[:-1])
    paste = read(f"The response is: '{shown}' (plain response: '{shown}')")
    assert [piece.length for piece in paste.pieces] == [7]


def test_a_summary_some_lines_below_repeats_the_answer() -> None:
    answer = adu("07040400e1 01c8").hex(" ")
    summary = "".join(f"[STEP] field {name}\n" for name in "abcdefghij")
    text = f"[STEP] TX (8 bytes): {adu('07040120 0002').hex(' ')}\n[STEP] RX (9 bytes): {answer}\n{summary}"
    assert len(list(read(f"{text}[STEP] Response Hex  : {answer}\n").frames())) == 2


def test_a_frame_of_ascii_mode_is_found_byte_by_byte_behind_others() -> None:
    sent = b"\x26\r:0403020004F3\r\n"
    lines = [f"[N] 719{20 + i}| uart.cpp [ 373] receive: {octet:02X}" for i, octet in enumerate(sent)]
    again = ["[D] Raw buffer received: @3FFB39A0/6:", "  | 0000: 04 03 02 00 04 F3     |......   |"]
    paste = read("\n".join([*lines, *again]))
    assert pieces(paste) == [("noise", "26 0d"), ("response", "04 03 02 00 04 f3")]


@pytest.mark.parametrize(
    ("text", "word"),
    [("11 03 00 6G 00 03 76 87", "6G"), ("11 03 00 6B 00 03 76 87q", "87q"), ("11 03 00 6B 00 0G", "0G")],
)
def test_a_mistyped_byte_is_named(text: str, word: str) -> None:
    [left] = read(text).unread
    assert left.why == f"'{word}' among the bytes is not a byte"


@pytest.mark.parametrize("words", ["ok", "(8 bytes)", "5ms", "-> 3", "; 2nd try"])
def test_words_behind_a_right_frame_are_no_bytes_of_it(words: str) -> None:
    assert not read(f"{ASK.hex(' ')} {words}").unread
