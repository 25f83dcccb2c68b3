"""Logs of tools as captures: bytes, times, marks and ports, and a note for each line that is none of it."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import pytest
from buses import adu

import captures
from analyzer.paste import judge
from captures import Capture, CaptureError, Chunk, Mark

MS = 1_000_000
DAY = 86_400_000 * MS
REQUEST = bytes.fromhex("1103006b00037687")
ANSWER = bytes.fromhex("110306022b00000064c8ba")
SPACED = REQUEST.hex(" ")
ANSWERED = ANSWER.hex(" ")

# What each tool writes for the same two reads, 17 ms apart.
LOGS = {
    "plain": f"{SPACED}\n{ANSWERED}\n",
    "brackets": f"[12:00:01.123] {SPACED}\n[12:00:01.140] {ANSWERED}\n",
    "socat": (
        f"> 2026/11/21 08:01:58.000287290  length=8 from=0 to=7\n {SPACED}                          ...k..v.\n--\n"
        f"< 2026/11/21 08:01:58.000304290  length=11 from=0 to=10\n {ANSWERED}                 ....+....\n--\n"
    ),
    "jpnevulator": (f"2026-11-21 05:09:50.794009: master\n{SPACED}\n2026-11-21 05:09:50.811009: slave\n{ANSWERED}\n"),
    "strace": (
        '04:59:10.118521 write(3, "'
        + "".join(f"\\x{b:02x}" for b in REQUEST)
        + '", 8) = 8\n04:59:10.119000 select(4, [3], NULL, NULL, {tv_sec=0}) = 1 (in [3])\n'
        + '04:59:10.135521 read(3, "'
        + "".join(f"\\x{b:02x}" for b in ANSWER)
        + '", 64) = 11\n04:59:10.136000 read(3, 0x7ffc, 64) = -1 EAGAIN (Resource temporarily unavailable)\n'
        + "04:59:10.140000 +++ exited with 0 +++\n"
    ),
    "Modbus Poll": f"Tx:000001-{SPACED.upper()}\nRx:000002-{ANSWERED.upper()}\n",
    "Modbus Poll, older": f"000001-Tx:{SPACED.upper()}\n000002-Rx:{ANSWERED.upper()}\n",
    "QModMaster": (
        f"[RTU]>Tx > 18:10:41:123 : {REQUEST.hex(' ').upper().replace(' ', '  ')}\n"
        f"[RTU]>Rx > 18:10:41:140 : {ANSWER.hex(' ').upper().replace(' ', '  ')}\n"
    ),
    "pymodbus": (
        "2026-11-21 04:58:09,123 DEBUG logging:103 Current transaction state - SENDING\n"
        f"2026-11-21 04:58:09,123 DEBUG logging:103 send: {' '.join(map(hex, REQUEST))}\n"
        f"2026-11-21 04:58:09,140 DEBUG logging:103 recv: {' '.join(map(hex, ANSWER))} extra data: \n"
        f"2026-11-21 04:58:09,140 DEBUG logging:103 Processing: {' '.join(map(hex, ANSWER))}\n"
    ),
    "libmodbus": (
        "Opening /dev/ttyUSB0 at 19200 bauds (N, 8, 1)\n"
        + "".join(f"[{b:02X}]" for b in REQUEST)
        + "\nWaiting for a confirmation...\n"
        + "".join(f"<{b:02X}>" for b in ANSWER)
        + "\n[107]: \t555\n"
    ),
    "mbpoll -v": (
        "debug enabled\nSet mode=rtu\niGetIntList(17)\nInteger found: 17\niCount=1\nSet rtu baudrate=9600\n"
        "Set rtu parity=none\nSet function=4\nSet start reference=108\nSet number of values=3\n"
        "Set device=/dev/ttyUSB0\nmbpoll 1.0-0 - FieldTalk(tm) Modbus(R) Master Simulator\n"
        "This program comes with ABSOLUTELY NO WARRANTY.\n"
        "This is free software, and you are welcome to redistribute it\n"
        "under certain conditions; type 'mbpoll -w' for details.\n\n"
        "Opening /dev/ttyUSB0 at 9600 bauds (N, 8, 1)\nSet response timeout to 1 sec, 0 us\n"
        "Protocol configuration: Modbus RTU\nSlave configuration...: address = [17]\n"
        "                        start reference = 108, count = 3\n"
        "Communication.........: /dev/ttyUSB0,       9600-8N1 \n"
        "                        t/o 1.00 s, poll rate 1000 ms\n"
        "Data type.............: 16-bit register, output (holding) register table\n\n-- Polling slave 17...\n"
        + "".join(f"[{b:02X}]" for b in REQUEST)
        + "\nWaiting for a confirmation...\n"
        + "".join(f"<{b:02X}>" for b in ANSWER)
        + "\n[108]: \t555\n"
    ),
    "ModScan, decimal": ("".join(f"[{b:03}]" for b in REQUEST) + "\n" + "".join(f"[{b:03}]" for b in ANSWER) + "\n"),
    "Serial Port Monitor, table": (
        "#\tTime\tFunction\tDirection\tStatus\tData\tData (chars)\tData length\tPort\n"
        f"12\t21.11.2026 10:15:31.123\tIRP_MJ_WRITE\tDOWN\tSTATUS_SUCCESS\t{SPACED}\t...k..v.\t8\tCOM3\n"
        f"13\t21.11.2026 10:15:31.140\tIRP_MJ_READ\tUP\tSTATUS_SUCCESS\t{ANSWERED}\t....\t11\tCOM3\n"
    ),
    "Serial Port Monitor, dump": (
        "[23/10/2008 10:38:33.123]\n1  IRP_MJ_DEVICE_CONTROL - Request operates a serial port\n   STATUS_SUCCESS\n"
        "         IOCTL_SERIAL_GET_BAUD_RATE - Returns the baud rate that is currently set for a COM port\n"
        f"            BaudRate - 9600\n{'-' * 40}\n[23/10/2008 10:38:34.123]\n"
        "37  IRP_MJ_WRITE - Request transfers data from a client to a COM port (COM5)\n   STATUS_SUCCESS\n"
        f"         {SPACED}                           ...k..v.\n{'-' * 40}\n[23/10/2008 10:38:34.140]\n"
        "39  IRP_MJ_READ - Request transfers data from a COM port to a client (COM5)\n   STATUS_SUCCESS\n"
        f"         {ANSWERED}                  ...+...d...\n"
    ),
    "Free Serial Analyzer": (
        f"[21/11/2026 10:15:31.123] Written data (COM3)\t\n    {SPACED}   ...k..v.        \t\n"
        f"[21/11/2026 10:15:31.140] Read data (COM3)\t\n    {ANSWERED}   ...+...d..      \t\n"
    ),
    "ESPHome": (
        f"[18:10:41.123][D][uart_debug:113]: >>> {REQUEST.hex(':').upper()}\n"
        "[18:10:41.130][D][sensor:094]: 'Power': Sending state 11.00000 W with 2 decimals of accuracy\n"
        f"\x1b[0;36m[18:10:41.140][D][uart_debug:113]: <<< {ANSWER.hex(':').upper()}\x1b[0m\n"
    ),
    "Node.js": f"<Buffer {SPACED}>\n" + '{"type":"Buffer","data":' + str(list(ANSWER)) + "}\n",
    "PortMon": (
        f"184\t11:26:50.123\tApp\tIRP_MJ_WRITE\tSerial0\tSUCCESS\tLength 8: {SPACED.upper()} \n"
        "185\t11:26:50.130\tApp\tIOCTL_SERIAL_WAIT_ON_MASK\tSerial0\tSUCCESS\t\n"
        f"186\t11:26:50.140\tApp\tIRP_MJ_READ\tSerial0\tSUCCESS\tLength 11: {ANSWERED.upper()} \n"
    ),
    "Docklight": (
        f"21.11.2026 10:15:31.123 [TX] - {SPACED.upper()}\n21.11.2026 10:15:31.140 [RX] - {ANSWERED.upper()}\n"
    ),
    "RealTerm": f"1226390000.123,{SPACED}\n1226390000.140,{ANSWERED}\n",
}
UNTIMED = {"plain", "Modbus Poll", "Modbus Poll, older", "libmodbus", "Node.js", "mbpoll -v", "ModScan, decimal"}
UNMARKED = {"plain", "brackets", "jpnevulator", "Node.js", "RealTerm", "ModScan, decimal"}


def log(folder: Path, text: str | bytes, name: str = "bus.log") -> Capture:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return captures.open(path)


@pytest.mark.parametrize("tool", LOGS)
@pytest.mark.parametrize("name", ["bus.log", "bus.unknown"])
def test_logs_of_tools(tmp_path: Path, tool: str, name: str) -> None:
    capture = log(tmp_path, LOGS[tool], name)
    request, answer = capture.chunks()
    assert (request.data, answer.data) == (REQUEST, ANSWER)
    assert capture.timed is (tool not in UNTIMED)
    assert answer.t_ns - request.t_ns == (0 if tool in UNTIMED else 17 * MS)
    marks = (Mark.NONE, Mark.NONE) if tool in UNMARKED else (Mark.TX, Mark.RX)
    assert (request.mark, answer.mark) == marks
    assert (request.port, answer.port) == ((0, 1) if tool == "jpnevulator" else (0, 0))
    assert not capture.damage


@pytest.mark.parametrize("tool", ["socat", "pymodbus", "Docklight", "ESPHome"])
def test_dates_without_a_zone_are_told_of_whatever_the_layout(tmp_path: Path, tool: str) -> None:
    told = any("without a zone" in notice for notice in log(tmp_path, LOGS[tool]).notices)
    assert told is (tool != "ESPHome")  # which has times of day


def test_bytewise_logs(tmp_path: Path) -> None:
    capture = log(tmp_path, "".join(f"> \t0x{byte:02x}\n" for byte in REQUEST))
    assert [chunk.data for chunk in capture.chunks()] == [REQUEST]  # nothing parts them
    assert {chunk.mark for chunk in capture.chunks()} == {Mark.TX}
    sigrok = "".join(f"{n}-{n + 400} uart-1: {byte:02X}\n" for n, byte in enumerate(REQUEST))
    assert b"".join(chunk.data for chunk in log(tmp_path, sigrok).chunks()) == REQUEST


def test_every_line_that_is_no_bytes_is_noted(tmp_path: Path) -> None:
    capture = log(tmp_path, f"{SPACED}\n\n# a comment\nhello there\n11 03 0\n{SPACED}\n")
    assert [chunk.data for chunk in capture.chunks()] == [REQUEST, REQUEST]
    assert [damage.where for damage in capture.damage] == ["line 4", "line 5"]
    assert "no bytes found in 'hello there'" in capture.damage[0].what
    assert "odd number" in capture.damage[1].what


def test_what_a_tool_left_out_is_noted(tmp_path: Path) -> None:
    assert "8 of 64 bytes" in only_damage(log(tmp_path, _strace_cut()))
    socat = f"> 2026/11/21 08:01:58.000287290  length=12 from=0 to=11\n {SPACED}\n--\n"
    assert "4 bytes that the line above announces" in only_damage(log(tmp_path, socat))
    assert "first 8 bytes only" in only_damage(log(tmp_path, f"<Buffer {SPACED} ... 14 more bytes>\n"))


def _strace_cut() -> str:
    return 'read(3, "' + "".join(f"\\x{b:02x}" for b in REQUEST) + '"..., 64) = 64\n'


def only_damage(capture: Capture) -> str:
    assert [chunk.data for chunk in capture.chunks()] == [REQUEST]
    assert len(capture.damage) == 1
    return capture.damage[0].what


def test_times_of_day_go_on_past_midnight(tmp_path: Path) -> None:
    capture = log(tmp_path, "23:59:59.900 TX 11 03\n00:00:00.100 RX 11 03\n23:00:00 TX 11 03\n01:00:00 RX 11 03\n")
    times = [chunk.t_ns for chunk in capture.chunks()]
    assert times == [DAY - 100 * MS, DAY + 100 * MS, 2 * DAY - 3_600_000 * MS, 2 * DAY + 3_600_000 * MS]
    assert not capture.damage


def test_a_line_without_its_time_gets_the_time_before_and_a_note(tmp_path: Path) -> None:
    capture = log(tmp_path, "12:00:01 TX 11 03\nRX 11 03 06\n12:00:02 TX 11 03\n12:00:03 RX 11 03\n")
    assert [chunk.t_ns // (1000 * MS) for chunk in capture.chunks()] == [43_201, 43_201, 43_202, 43_203]
    assert [damage.where for damage in capture.damage] == ["line 2"]


def test_a_time_above_the_bytes(tmp_path: Path) -> None:
    capture = log(tmp_path, f"12:00:01.123 TX:\n{SPACED[:11]}\n{SPACED[12:]}\n12:00:01.140 RX:\n{ANSWERED}\n")
    chunks = list(capture.chunks())
    assert [chunk.data for chunk in chunks] == [REQUEST, ANSWER], "the lines below one time are one read"
    assert [chunk.mark for chunk in chunks] == [Mark.TX, Mark.RX]
    assert chunks[1].t_ns - chunks[0].t_ns == 17 * MS


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1251"])
@pytest.mark.parametrize("word", ["Frame", "Кадр"])
def test_text_as_windows_writes_it(tmp_path: Path, encoding: str, word: str) -> None:
    lines = LOGS["brackets"].replace("] ", f"] {word}: ").replace("\n", "\r\n")
    capture = log(tmp_path, lines.encode(encoding))
    assert [chunk.data for chunk in capture.chunks()] == [REQUEST, ANSWER]
    assert not capture.damage


def test_words_in_windows_1251_are_read_in_notes_and_marks(tmp_path: Path) -> None:
    capture = log(tmp_path, f"привет\nПринято: {SPACED}\n".encode("cp1251"))
    assert [(chunk.data, chunk.mark) for chunk in capture.chunks()] == [(REQUEST, Mark.RX)]
    assert "привет" in capture.damage[0].what


def test_a_word_behind_much_of_a_long_line_still_tells_its_code_page(tmp_path: Path) -> None:
    capture = log(tmp_path, f"{'-' * 5000} Ответ\nПринято: {SPACED}\n".encode("cp866"))
    assert [(chunk.data, chunk.mark) for chunk in capture.chunks()] == [(REQUEST, Mark.RX)]


@pytest.mark.parametrize(
    ("page", "words", "mark"),
    [
        ("cp866", "Ответ", Mark.RX),
        ("koi8-r", "Запрос", Mark.TX),
        ("gb18030", "收←◆", Mark.RX),
        ("gb18030", "发送数据", Mark.TX),
        ("big5", "發送", Mark.TX),
        ("cp932", "受信", Mark.RX),
        ("euc-kr", "수신", Mark.RX),
        ("cp1252", "réponse", Mark.RX),
    ],
)
def test_words_in_other_code_pages_are_marks(tmp_path: Path, page: str, words: str, mark: Mark) -> None:
    capture = log(tmp_path, f"12:00:01.500 {words}: {SPACED}\n".encode(page))
    assert [(chunk.data, chunk.mark) for chunk in capture.chunks()] == [(REQUEST, mark)]


def test_ascii_mode_frames_keep_their_characters(tmp_path: Path) -> None:
    capture = log(tmp_path, "12:00:01 :1103006B00037E\n12:00:02 :110306022B000000645A\n")
    assert [chunk.data for chunk in capture.chunks()] == [b":1103006B00037E\r\n", b":110306022B000000645A\r\n"]


@pytest.mark.parametrize("first", ["ee", "ae", "be", "ff"])
def test_a_row_of_a_dump_may_begin_with_any_byte(tmp_path: Path, first: str) -> None:
    """Between an offset and the characters, no byte of letters is a word before the bytes."""
    answers = (adu(f"110304{word:08x}") for word in range(0x41200000, 0x41300000))
    answer = next(answer for answer in answers if answer[-1] == int(first, 16))
    data = adu("110300280002") + answer + adu("110300570001") + adu("1103020000")
    rows = [data[at : at + 16] for at in (0, 16)]
    text = "".join(
        f"{16 * n:08x}  {row[:8].hex(' ')}  {row[8:].hex(' ')}  |{'.' * len(row)}|\n" for n, row in enumerate(rows)
    )
    (tmp_path / "bus.log").write_text(text)
    capture = captures.open(tmp_path / "bus.log", judge=judge)
    assert b"".join(chunk.data for chunk in capture.chunks()) == data


def test_a_long_dump_comes_in_pieces(tmp_path: Path) -> None:
    data = bytes(range(256)) * 288  # more than a piece
    lines = (f"{at:08x}  {data[at : at + 16].hex(' ')}" for at in range(0, len(data), 16))
    capture = log(tmp_path, "\n".join(lines), "dump.txt")
    pieces = [chunk.data for chunk in capture.chunks()]
    assert b"".join(pieces) == data
    assert len(pieces) > 1 and max(map(len, pieces)) < 70_000
    assert not capture.damage


@pytest.mark.parametrize(
    ("text", "said"),
    [("just words\nand more\n", "line 1"), ("\n\n# comment\n", "only empty lines"), ("\x00\x01\x02" * 9, "not text")],
)
def test_text_without_bytes_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(CaptureError, match=said):
        log(tmp_path, text)


def test_prose_with_a_number_in_it_is_no_capture(tmp_path: Path) -> None:
    words = "The quick brown fox\n" * 40
    with pytest.raises(CaptureError):
        log(tmp_path, words + "11 03 00 6B\n" + words, "readme.md")


LOGIC2 = """name,type,start_time,duration,data,error
"Async Serial","data",0.0006025,2.375e-05,0xC8,
"Async Serial","data",0.00063,2.375e-05,0x01,"framing"
"Other","data",0.0007,2.375e-05,17,
"Async Serial","idle",0.001,2.375e-05,,
"Async Serial","data",soon,2.375e-05,0x01,
"Async Serial","data",0.002,2.375e-05,0x1FF,
"""
LOGIC1 = "Time [s],Value,Parity Error,Framing Error\n0.000602500000000,0xC8,,\n0.00063,0x01,Error,\n"


def test_tables_of_a_logic_analyser(tmp_path: Path) -> None:
    capture = log(tmp_path, LOGIC2, "logic.csv")
    assert capture.format == "saleae"
    assert list(capture.chunks()) == [
        Chunk(626_372, b"\xc8"),
        Chunk(653_872, b"\x01", errors=(0,)),
        Chunk(723_872, b"\x11", port=1),
    ]
    assert [damage.where for damage in capture.damage] == ["line 6", "line 7"]
    older = log(tmp_path, LOGIC1, "logic.txt")
    assert list(older.chunks()) == [Chunk(602_500, b"\xc8"), Chunk(630_000, b"\x01", errors=(0,))]


def test_other_tables_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CaptureError):
        log(tmp_path, "a,b\nhello,there\n", "table.csv")


def test_other_formats_can_be_added(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from captures import formats
    from captures.formats import Format, binary

    class Entry:
        @staticmethod
        def load() -> Format:
            return Format("vendor", (".vnd",), lambda head: float(head.startswith(b"VENDOR")), binary.FORMAT.read)

    class Broken:
        name, value = "broken", "broken:FORMAT"

        @staticmethod
        def load() -> Format:
            raise ImportError("missing")

    offered = {"rtuscope.captures": [Broken, Entry]}
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: offered.get(group, []))
    formats.foreign_formats.cache_clear()
    try:
        with pytest.warns(UserWarning, match=r"plug-in broken \(broken:FORMAT\) is skipped: ImportError: missing"):
            assert log(tmp_path, "VENDOR\x00", "capture.vnd").format == "vendor"
        assert captures.open(tmp_path / "capture.vnd", format="vendor").format == "vendor"
    finally:
        formats.foreign_formats.cache_clear()


def test_lines_that_end_in_a_carriage_return_alone(tmp_path: Path) -> None:
    capture = log(tmp_path, f"12:00:01.123 TX {SPACED}\r12:00:01.140 RX {ANSWERED}\r")
    request, answer = capture.chunks()
    assert (request.data, answer.data, answer.t_ns - request.t_ns) == (REQUEST, ANSWER, 17 * MS)


def test_a_log_in_space_taken_beforehand(tmp_path: Path) -> None:
    capture = log(tmp_path, f"TX {SPACED}\nRX {ANSWERED}\n".encode() + bytes(300))
    assert [chunk.data for chunk in capture.chunks()] == [REQUEST, ANSWER]


@pytest.mark.parametrize(("head", "empty"), [("Time,TX,RX,Err", ""), ("Time;Tx (hex);Rx (hex)", "--")])
def test_a_column_for_each_direction(tmp_path: Path, head: str, empty: str) -> None:
    sign = "," if "," in head else ";"
    rows = [f"{i / 1000:.4e}{sign}0x{byte:02X}{sign}{empty}" for i, byte in enumerate(REQUEST)]
    rows += [f"{i / 1000 + 0.05:.4e}{sign}{empty}{sign}0x{byte:02X}" for i, byte in enumerate(ANSWER)]
    chunks = list(captures.open(path_of(tmp_path, "\n".join([head, *rows])), judge=judge).chunks())
    by_mark = {mark: b"".join(chunk.data for chunk in chunks if chunk.mark is mark) for mark in (Mark.TX, Mark.RX)}
    assert by_mark == {Mark.TX: REQUEST, Mark.RX: ANSWER}


def test_both_directions_in_one_column_are_none(tmp_path: Path) -> None:
    rows = [f"{i},{i * 1000}.00,{byte:02X}" for i, byte in enumerate(REQUEST)]
    path = path_of(tmp_path, "\n".join(["Id,Time[us],0:UART: RX/TX", *rows]))
    assert {chunk.mark for chunk in captures.open(path, judge=judge).chunks()} == {Mark.NONE}


def test_a_saleae_table_with_decimal_commas(tmp_path: Path) -> None:
    rows = [f"{i / 1000:.6f};0x{byte:02X};;".replace(".", ",") for i, byte in enumerate(REQUEST)]
    path = path_of(tmp_path, "\n".join(["Time [s];Value;Parity Error;Framing Error", *rows]), "table.csv")
    chunks = list(captures.open(path).chunks())
    assert b"".join(chunk.data for chunk in chunks) == REQUEST
    assert chunks[-1].t_ns - chunks[0].t_ns == 7 * MS


def path_of(folder: Path, text: str, name: str = "table.txt") -> Path:
    path = folder / name
    path.write_text(text + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("zero", ["\u1bb0", "\u0660", "\uff10", "\U0001d7d8"])
def test_digits_of_another_script_are_read_as_digits(tmp_path: Path, zero: str) -> None:
    path = path_of(tmp_path, f"{zero}0 00 00 0A\n{REQUEST.hex(' ').replace('0', zero)}", "a.log")
    assert b"".join(chunk.data for chunk in captures.open(path).chunks()).endswith(REQUEST)


def test_a_time_that_no_capture_can_hold_is_none() -> None:
    from analyzer.paste.reading import read

    rows = "".join(f"000602500000000,0x{byte:02X},,\n" for byte in bytes.fromhex("110300 6B0003 0000 0102"))
    paste = read(f"Time [s],Value,Parity Error,Framing Error\n{rows}")
    assert paste.pieces
