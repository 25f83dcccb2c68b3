"""Pasted text to bytes: every way of writing them, and what must not become bytes."""

from __future__ import annotations

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from captures.errors import HexError
from captures.hexwords import Words, read_paste, read_text

REQUEST = bytes.fromhex("1103006b00037687")
ANSWER = bytes.fromhex("110306022b00000064c8ba")
TIME = 43_201_123_000_000  # 12:00:01.123

SHAPES = [
    "11 03 00 6B 00 03 76 87",
    "11 03 00 6b 00 03 76 87",
    "11  03  00  6B  00  03  76  87",
    "11 03  00 6B   00 03 76 87",
    "11\t03\t00\t6B\t00\t03\t76\t87",
    "1103006B00037687",
    "1103 006B 0003 7687",
    "1103006B 00037687",
    "0x1103006B00037687",
    "0x11,0x03,0x00,0x6B,0x00,0x03,0x76,0x87",
    "0x11 0x3 0x0 0x6b 0x0 0x3 0x76 0x87",
    "{0x11, 0x03, 0x00, 0x6B, 0x00, 0x03, 0x76, 0x87}",
    "const uint8_t frame[] = { 0x11, 0x03, 0x00, 0x6B, 0x00, 0x03, 0x76, 0x87 }; // read",
    "[0x11, 0x03, 0x00, 0x6B, 0x00, 0x03, 0x76, 0x87]",
    r"\x11\x03\x00\x6B\x00\x03\x76\x87",
    r"\x11\x03\x00k\x00\x03v\x87",
    r"b'\x11\x03\x00k\x00\x03v\x87'",
    r'"\x11\x03\x00\x6b\x00\x03\x76\x87"',
    r"bytearray(b'\x11\x03\x00k\x00\x03v\x87')",
    "[11][03][00][6B][00][03][76][87]",
    "<11><03><00><6B><00><03><76><87>",
    "11-03-00-6B-00-03-76-87",
    "11:03:00:6B:00:03:76:87",
    "11,03,00,6B,00,03,76,87",
    "11, 03, 00, 6B, 00, 03, 76, 87",
    "11;03;00;6B;00;03;76;87",
    "11.03.00.6B.00.03.76.87",
    "11h 03h 00h 6Bh 00h 03h 76h 87h",
    "16#11 16#03 16#00 16#6B 16#00 16#03 16#76 16#87",
    "($11, $03, $00, $6B, $00, $03, $76, $87)",
    "&H11 &H03 &H00 &H6B &H00 &H03 &H76 &H87",
    "10:15:31.223 RX  0000  11 03 00 6b 00 03 76 87                           ...k..v.",
    "     11 03 00 6b 00 03 76 87                           ...k..v.",
    "<Buffer 11 03 00 6b 00 03 76 87>",
    '{"type":"Buffer","data":[17,3,0,107,0,3,118,135]}',
    "0000  11 03 00 6b 00 03 76 87                           ...k..v.",
    "00000000  11 03 00 6b 00 03 76 87                           |...k..v.|",
    "00000000: 1103 006b 0003 7687                      ...k..v.",
    "\t0x0000:  1103 006b 0003 7687                      ...k..v.",
    '"11 03 00 6B 00 03 76 87"',
    "(11 03 00 6B 00 03 76 87)",
    "$ 11 03 00 6B 00 03 76 87",
    "11 03 00 6B 00 03 76 87  # read three registers",
    "11 03 00 6B 00 03 76 87 (8 bytes)",
    "frame: 11 03 00 6B 00 03 76 87",
    "got frame 11 03 00 6B 00 03 76 87 from the slave",
    "payload=1103006B00037687",
    "Slave 17: 11 03 00 6B 00 03 76 87",
    "Length 8: 11 03 00 6B 00 03 76 87",
    "\x1b[0;36m11 03 00 6B 00 03 76 87\x1b[0m",
]


def longest(text: str) -> Words:
    """The most bytes that a text has in one."""
    return max(read_text(text), key=lambda words: len(words.data))


@pytest.mark.parametrize("text", SHAPES)
def test_every_way_of_writing_bytes(text: str) -> None:
    words = longest(text)
    assert words.data == REQUEST
    assert words.text
    assert [found.data for found in read_text(f"\n{text}\n")] == [REQUEST]


@pytest.mark.parametrize(
    ("text", "mark", "t_ns"),
    [
        ("12:00:01.123 TX {}", 1, TIME),
        ("[12:00:01.123] RX: {}", 2, TIME),
        ("[12:00:01,123] {}", 0, TIME),
        ("12:00:01:123 : {}", 0, TIME),
        ("(12:00:01.123) -> {}", 1, TIME),
        ("12:00:01.123 << {}", 2, TIME),
        ("12:00:01.123\t>>>\t{}", 1, TIME),
        ("<- {}", 2, None),
        ("> {}", 1, None),
        ("Sent: {}", 1, None),
        ("Received 8 bytes: {}", 2, None),
        ("Request: {}", 1, None),
        ("RECV {}", 2, None),
        ("1970-01-01 12:00:01.123 {}", 0, TIME),
        ("1970-01-01T12:00:01.123Z TX {}", 1, TIME),
        ("1970-01-01T14:00:01.123+02:00 TX {}", 1, TIME),
        ("01.01.1970 12:00:01.123 [TX] - {}", 1, TIME),
        ("1970/01/01 12:00:01.123 {}", 0, TIME),
        ("43201.123 {}", 0, TIME),
        ("[43201.123000] TX {}", 1, TIME),
        ("43201123 ms: {}", 0, TIME),
        ("1226390000.123,{}", 0, 1_226_390_000_123_000_000),
        ("1700000000123 {}", 0, 1_700_000_000_123_000_000),
        ("12:00:01.123 PM RX {}", 2, TIME),
        ("Nov 21 12:00:01 host app[123]: TX {}", 1, 43_201 * 10**9),
    ],
)
def test_times_and_marks_around_the_bytes(text: str, mark: int, t_ns: int | None) -> None:
    words = longest(text.format("11 03 00 6B 00 03 76 87"))
    assert (words.data, words.mark, words.t_ns) == (REQUEST, mark, t_ns)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "add",
        "dead",
        "face",
        "Facade",
        "be added",
        "dead beef",
        "deadbeef",
        "a decade ago",
        "12:00:01",
        "12:00:01.123",
        "2026-11-21",
        "2026-11-21 12:00:01",
        "21.11.2026 10:15:31.234",
        "length=8 from=0 to=7",
        "received 8 bytes",
        "Slave 17 timeout after 1000 ms",
        "error 0x10 happened",
        "port 502 opened",
        "id 12345678 opened",
        "COM3 opened at 9600 baud, 8N1",
        "v1.2.3",
    ],
)
def test_words_times_dates_and_sizes_are_not_bytes(text: str) -> None:
    with pytest.raises(HexError, match=r"no hex bytes|nothing to read"):
        read_text(text)


@pytest.mark.parametrize("sign", ["#", "//", ";", "--"])
def test_comments_hold_bytes_like_any_other_line(sign: str) -> None:
    assert [words.data for words in read_text(f"{sign} 11 03 00 6B 00 03 76 87")] == [REQUEST]


@pytest.mark.parametrize("text", ["baudrate=9600", "Set rtu baudrate=19200", "baudrate=115200", "address = 1000"])
def test_settings_among_bytes_are_not_bytes(text: str) -> None:
    assert [words.data for words in read_text(f"{text}\n11 03 00 6B 00 03 76 87")] == [REQUEST]


@pytest.mark.parametrize(
    "text",
    [
        "17 3 0 107 0 3 118 135",
        "17,3,0,107,0,3,118,135",
        "bytes([17, 3, 0, 107, 0, 3, 118, 135])",
        "[17][03][00][107][00][03][118][135]",
        "<017><003><000><107><000><003><118><135>",
        "10:15:31.123 RX: 17 3 0 107 0 3 118 135",
    ],
)
def test_decimal_bytes(text: str) -> None:
    assert [words.data for words in read_text(text)] == [REQUEST]


def test_decimal_numbers_beside_hex_are_not_bytes() -> None:
    text = "values: 17 3 0 107 0 3 118 135\n11 03 00 6B 00 03 76 87"
    assert [words.data for words in read_text(text)] == [REQUEST]
    for numbers in ("100 200 300 400", "1 2 3", "17 3 0 7"):
        with pytest.raises(HexError):
            read_text(numbers)


def test_characters_beside_sixteen_bytes_with_a_gap_between_eights() -> None:
    data = bytes.fromhex("110314AE41565243404900410042004300440045")
    first, last = data[:16], data[16:]
    shown = "".join(chr(byte) if 0x20 < byte < 0x7F else "." for byte in data)
    dump = (
        f"RX  0000  {first[:8].hex(' ')}  {first[8:].hex(' ')}  {shown[:16]}\n    0010  {last.hex(' ')}    {shown[16:]}"
    )
    assert b"".join(words.data for words in read_text(dump)) == data
    assert [words.data for words in read_text(f"RX: {first[:8].hex(' ')}  {first[8:].hex(' ')}")] == [first]
    assert [words.data for words in read_text("  7E 32 35  ~25")] == [b"~25"]


@pytest.mark.parametrize(
    ("text", "mark"), [("Запрос: {}", 1), ("Передано {}", 1), ("Ответ: {}", 2), ("принято: {}", 2)]
)
def test_russian_words_are_marks(text: str, mark: int) -> None:
    words = longest(text.format("11 03 00 6B 00 03 76 87"))
    assert (words.data, words.mark) == (REQUEST, mark)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("11 03 0 6B", "'0' at column 7"),
        ("1103006", "'1103006' at column 1"),
        ("11 3 0 6B 0 3 76 87", "'3' at column 4"),
        ("TX 11 03 00 6B 0", "'0' at column 16"),
        ("0x11,0x03,0x006", "0x006 at column 13"),
        (r"\x11\x0", "column 5"),
        ('{"type":"Buffer","data":[17,300]}', "300 is not a byte"),
    ],
)
def test_halves_of_bytes_are_refused_with_their_place(text: str, said: str) -> None:
    with pytest.raises(HexError) as caught:
        read_text(text)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    beside = read_paste(f"11 03 00 6B\n{text}")
    assert beside.words[0].data == REQUEST[:4]
    assert [(line.line, said in line.why) for line in beside.unread] == [(2, True)], "told, and the rest is read"


def test_ascii_frames_are_kept_as_characters() -> None:
    for text in (":1103006B00037E", "12:00:01.123 TX :1103006B00037E", ":1103006B00037E\\r\\n"):
        words = longest(text)
        assert words.ascii
        assert words.data == b":1103006B00037E\r\n"
    words = longest("Sent:1103006B00037687")
    assert not words.ascii


def test_a_request_and_its_answer_on_one_line() -> None:
    sent, answer = REQUEST.hex(" "), ANSWER.hex(" ")
    assert [(w.data, w.mark) for w in read_text(f"TX: {sent} RX: {answer}")] == [(REQUEST, 1), (ANSWER, 2)]
    assert [(w.data, w.mark) for w in read_text(f"{sent} -> {answer}")] == [(REQUEST, 0), (ANSWER, 0)]


def test_lines_of_text_each_with_their_number() -> None:
    text = f"opening the port\n12:00:01.123 TX {REQUEST.hex(' ')}\n\nwaiting\n12:00:01.150 RX {ANSWER.hex(' ')}\n"
    assert read_text(text) == [
        Words(REQUEST, 1, TIME, 2, text.splitlines()[1]),
        Words(ANSWER, 2, TIME + 27_000_000, 5, text.splitlines()[4]),
    ]


DATA = bytes(range(0x30, 0x58))
DUMPS = {
    "hexdump -C": lambda part, at: f"{at:08x}  {part[:8].hex(' ')}  {part[8:].hex(' ')}  |{part.decode()}|",
    "xxd": lambda part, at: f"{at:08x}: {part.hex(' ', 2)}  {part.decode()}",
    "wireshark": lambda part, at: f"{at:04x}  {part.hex(' ')}   {part.decode()}",
    "od": lambda part, at: f"{at:07o} {part.hex(' ')}",
}


@pytest.mark.parametrize("tool", DUMPS)
def test_the_lines_of_a_dump_are_put_together(tool: str) -> None:
    lines = [DUMPS[tool](DATA[at : at + 16], at) for at in range(0, len(DATA), 16)]
    end = {"hexdump -C": [f"{len(DATA):08x}"], "od": [f"{len(DATA):07o}"]}.get(tool, [])
    found = read_text("\n".join(lines + end))
    assert [words.data for words in found] == [DATA]
    again = read_text("\n".join([*lines, *end, *lines]))
    assert [words.data for words in again] == [DATA, DATA], "a dump that begins anew is another one"


def test_text_beside_the_bytes_of_a_dump_is_not_bytes() -> None:
    words = longest("00000000: 6162 2063 6420 6566 2031 3233 3420 ab12  ab cd ef 12 34 ")
    assert words.data == b"ab cd ef 1234 \xab\x12"


@given(st.binary(min_size=2, max_size=60), st.sampled_from([" ", "-", ":", ",", ", ", "", "]["]), st.booleans())
def test_any_bytes_in_any_shape_come_back(data: bytes, between: str, upper: bool) -> None:
    pairs = [f"{byte:02X}" if upper else f"{byte:02x}" for byte in data]
    text = between.join(pairs)
    text = f"[{text}]" if between == "][" else text
    if (between == "" and text.isalpha()) or (between == ":" and len(data) < 4):
        return  # a word, or a time of day
    assert b"".join(words.data for words in read_text(f"TX {text}")) == data


@given(st.text(max_size=80) | st.text("0123456789abcdefxX\\[]<>:-,. \"'TRtrh\n", max_size=80))
def test_no_text_crashes(text: str) -> None:
    try:
        for words in read_text(text):
            assert words.data
            assert words.line >= 1
    except HexError as error:
        assert str(error)


def test_escapes_between_quotes_that_never_close_take_little_time() -> None:
    start = time.process_time()
    assert read_text("'\\x01\" " * 10_000)
    assert time.process_time() - start < 5


def test_a_long_line_takes_little_time() -> None:
    data = bytes(1_000_000)
    start = time.process_time()
    assert [words.data for words in read_text(data.hex())] == [data]
    assert time.process_time() - start < 2


@pytest.mark.parametrize("text", ["11  x" + " " * 900_000 + "y", "1\t" * 400_000])
def test_no_line_takes_for_ever(text: str) -> None:
    with pytest.raises(HexError):
        read_text(text)


def test_a_long_line_of_short_words_is_read_to_its_end() -> None:
    words = longest("1\tIRP_MJ_READ\t" + "ab\t" * 300_000)
    assert set(words.data) == {0xAB}
