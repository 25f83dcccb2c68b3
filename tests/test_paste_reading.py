"""Pasted bytes: every way of writing them, every envelope, whole, damaged and cut."""

from itertools import pairwise

import pytest
from buses import adu
from hypothesis import example, given, settings
from hypothesis import strategies as st

import analyzer
from analyzer.paste import PastedFrame, PastedNoise, PasteError, read, tree
from captures.errors import HexError
from dissectors.length_rules import Role

REQUEST = "11 03 00 6B 00 03 76 87"
ANSWER = "11 03 06 AE 41 56 52 43 40 49 AD"
MBAP = "00 01 00 00 00 06 11 03 00 6B 00 03"


def kinds(paste):
    """Pieces in short: direction, whether the check value is right, pasted bytes."""
    return [
        (piece.role.name.lower(), piece.check_ok, piece.length)
        if isinstance(piece, PastedFrame)
        else ("noise", None, piece.length)
        for piece in paste.pieces
    ]


@pytest.mark.parametrize(
    "text",
    [
        REQUEST,
        "1103006B00037687",
        "1103006b00037687",
        "0x11,0x03,0x00,0x6B,0x00,0x03,0x76,0x87",
        r"\x11\x03\x00\x6B\x00\x03\x76\x87",
        r"\x11 \x03 \x00 \x6B \x00 \x03 \x76 \x87",
        r"\x11, \x03, \x00, \x6B, \x00, \x03, \x76, \x87",
        "[11][03][00][6B][00][03][76][87]",
        "11-03-00-6B-00-03-76-87",
        "11:03:00:6B:00:03:76:87",
        "b'\\x11\\x03\\x00k\\x00\\x03v\\x87'",
        "[12:00:01.123] TX 11 03 00 6B 00 03 76 87",
        "2026-11-21 10:15:31.234 INFO sent: 11 03 00 6B 00 03 76 87",
        "  11 03 00 6B\n  00 03 76 87\n",
    ],
)
def test_one_request_however_it_is_written(text):
    paste = read(text)
    assert paste.protocol == "rtu"
    assert kinds(paste) == [("request", True, 8)]


def test_ascii_mode():
    paste = read(":1103006B00037E")
    assert paste.protocol == "ascii"
    assert paste.why == "ASCII: 1 frame between colon and line end, LRC correct"
    assert [frame.adu.data.hex() for frame in paste.frames()] == ["1103006b00037e"]
    first = paste.pieces[0]
    assert isinstance(first, PastedFrame) and not first.also


def test_ascii_mode_with_a_wrong_lrc_says_what_was_computed():
    paste = read(":1103006B00037F")
    assert kinds(paste) == [("request", False, 17)]
    assert "LRC wrong: received 7F, computed 7E" in tree(paste)
    assert paste.holds_a_frame


@pytest.mark.parametrize(
    ("text", "envelope", "said"),
    [
        (
            "11 03 00 6B 00 03",
            "auto",
            "RTU: the header fits, the end with the CRC is cut off, and there is no MBAP header",
        ),
        ("11 03 00 6B 00 03 76 88", "auto", "RTU: the header fits, but no CRC matches, and there is no MBAP header"),
        ("11 03 00 6B 00 03 76 87", "tcp", "no frame: no MBAP header (protocol 0, a length)"),
        ("11 03 00 6B 00 03 76 87", "ascii", "no frame: no ASCII frame (colon to line end)"),
        ("00 01 00 00 00 06 11 03 00 6B 00 03", "tcp", "TCP: MBAP headers (protocol 0, a length)"),
    ],
)
def test_the_headline_names_only_what_is_there(text, envelope, said):
    assert read(text, envelope=envelope).why == said


def test_ascii_mode_given_as_hex_of_its_characters():
    paste = read(b":1103006B00037E\r\n".hex(" "))
    assert (paste.protocol, kinds(paste)) == ("ascii", [("request", True, 17)])


def test_mbap():
    paste = read(MBAP)
    assert paste.protocol == "tcp"
    assert kinds(paste) == [("request", None, 12)]
    assert "MBAP" in paste.why


def test_mbap_request_and_answer_are_paired_by_transaction():
    paste = read(f"{MBAP} 00 02 00 00 00 06 11 03 00 00 00 01 00 01 00 00 00 09 11 03 06 AE 41 56 52 43 40")
    assert kinds(paste) == [("request", None, 12), ("request", None, 12), ("response", None, 15)]
    assert [frame.request_start for frame in paste.frames()] == [None, None, 0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("03 00 00 00 0A", ["read 10 holding registers from 0 (40001)"]),
        ("03 00 6B 00 02\n03 04 02 2B 00 64", ["read 2 holding registers from 107 (40108)", "2 registers: 555 100"]),
        ("10 00 01 00 02 04 00 0A 01 02", ["write 2 registers from 1 (40002): 10 258"]),
    ],
)
def test_a_pdu_alone_as_documents_show_it(text, said):
    paste = read(text)
    assert paste.protocol == "pdu" and [frame.summary() for frame in paste.frames()] == said
    frame = next(paste.frames())
    line = frame.to_json(0)
    assert (line["protocol"], line["unit"], line["crc_ok"]) == ("pdu", None, None)
    assert str(tree(paste)).splitlines()[2] == f"request   {said[0]}"


def test_what_lacks_only_its_crc_is_no_pdu_alone():
    assert read("11 03 00 6B 00 03").protocol == "rtu"


@given(st.binary(min_size=1, max_size=60))
def test_any_bytes_as_a_pdu_are_covered_by_fields(data):
    (frame,) = read(data.hex(" "), "pdu").frames()
    assert frame.adu.pdu == data and sum(field.length for field in frame.fields()) == len(data)
    assert frame.summary() and "unit" not in {field.name for field in frame.fields()}


def test_request_with_its_answer():
    paste = read(f"{REQUEST} {ANSWER}")
    request, answer = paste.frames()
    assert kinds(paste) == [("request", True, 8), ("response", True, 11)]
    assert (answer.request, answer.request_start) == (request.adu.pdu, 0)
    assert [field.address for field in answer.fields()[3].fields] == [107, 108, 109]


def test_a_stream_with_noise_is_split():
    paste = read(f"00 {REQUEST} {ANSWER} FF FE {REQUEST}")
    assert kinds(paste) == [
        ("noise", None, 1), ("request", True, 8), ("response", True, 11), ("noise", None, 2), ("request", True, 8),
    ]  # fmt: skip


def test_an_echo_can_be_either_and_both_are_shown():
    paste = read("11 05 00 AC FF 00 4E 8B")
    (frame,) = paste.frames()
    assert (frame.role, frame.also) == (Role.REQUEST, Role.RESPONSE)
    assert frame.confidence == 0.5
    line = next(paste.to_json())
    assert line["also"]["direction"] == "response"
    assert line["also"]["fields"]
    assert "or response" in tree(paste)


def test_two_of_them_are_a_request_and_its_answer():
    paste = read("11 05 00 AC FF 00 4E 8B 11 05 00 AC FF 00 4E 8B")
    assert kinds(paste) == [("request", True, 8), ("response", True, 8)]
    assert all(frame.also is None for frame in paste.frames())


def test_bytes_that_differ_as_request_and_as_answer_show_both_trees():
    paste = read(adu("110103000010").hex(" "))  # 16 coils from 768 asked for, or 3 bytes of coils
    (frame,) = paste.frames()
    assert (frame.role, frame.also) == (Role.REQUEST, Role.RESPONSE)
    text = tree(paste)
    assert "request   unit 17: read 16 coils from 768 (00769)" in text
    assert "or response  unit 17: 24 coils" in text
    asked = read(f"{adu('110100000018').hex(' ')} {adu('110103000010').hex(' ')}")
    assert [(frame.role, frame.also) for frame in asked.frames()] == [(Role.REQUEST, None), (Role.RESPONSE, None)]


@pytest.mark.parametrize(("role", "direction"), [("request", "request"), ("response", "response"), ("auto", "request")])
def test_a_role_that_the_user_knows(role, direction):
    (frame,) = read("11 06 00 01 00 03 9A 9B", role=role).frames()
    assert frame.role.name.lower() == direction
    assert (frame.also is None) == (role != "auto")


def test_marks_of_a_log_tell_the_direction():
    (frame,) = read("RX: 11 06 00 01 00 03 9A 9B").frames()
    assert (frame.role, frame.also) == (Role.RESPONSE, None)
    server = read(f"RX: {REQUEST}\nTX: {ANSWER}\nRX: 11 06 00 01 00 03 9A 9B")
    assert [frame.role.name for frame in server.frames()] == ["REQUEST", "RESPONSE", "REQUEST"]


def test_a_wrong_crc_is_told_and_the_fields_are_read():
    paste = read("11 03 00 6B 00 03 76 88")
    assert kinds(paste) == [("request", False, 8)]
    text = tree(paste)
    assert "CRC wrong: received 76 88, computed 76 87" in text
    assert "107 (0x006B, 40108)" in text
    assert paste.holds_a_frame


@pytest.mark.parametrize(
    ("text", "missing", "known"),
    [
        ("11", 3, False),
        ("11 03", 2, False),
        ("11 03 00 6B 00 03", 2, True),
        ("11 03 00 6B 00 03 76", 1, True),
        ("11 03 06 AE 41 56", 5, True),
        ("00 01 00 00 00 06 11 03", 4, True),
    ],
)
def test_a_cut_frame_says_what_is_missing(text, missing, known):
    paste = read(text)
    (frame,) = paste.frames()
    assert (frame.missing, frame.length_known, frame.check_ok) == (missing, known, False)
    assert not paste.holds_a_frame
    assert next(paste.to_json())["missing"] == missing
    assert f"cut: needs {'' if known else 'at least '}{missing} more byte" in tree(paste)


def test_a_frame_that_only_lacks_its_crc_is_told_it():
    request = "11 03 00 6B 00 03 76 87"
    assert f"the whole frame: {request}" in tree(read(request[:17]))


@pytest.mark.parametrize("cut", [1, 2])
def test_a_request_without_its_crc_is_offered_whole(cut: int) -> None:
    """Also where one byte of the CRC is there; what is cut elsewhere, or whole, is offered as nothing."""
    for body in ("010300000002", "05 10 00 00 00 01 02 00 05", "11 06 00 01 00 03"):
        whole = adu(body)
        paste = read(whole[:-cut].hex(" "))
        (line,) = paste.to_json()
        assert (paste.protocol, line["missing"], line["to_send"]) == ("rtu", cut, whole.hex())
        assert whole.hex(" ").upper() in tree(paste)
        assert "to_send" not in next(read(whole.hex()).to_json())
        assert "to_send" not in next(read(whole[:-3].hex()).to_json())


def test_a_cut_frame_after_whole_ones():
    paste = read(f"{REQUEST} {ANSWER} 11 03 00 6B")
    assert kinds(paste)[:2] == [("request", True, 8), ("response", True, 11)]
    assert list(paste.frames())[-1].missing == 4
    assert paste.holds_a_frame


@pytest.mark.parametrize("size", [9, 12, 16, 18])
def test_an_answer_that_the_end_of_the_paste_cuts_has_no_wrong_crc(size):
    whole = adu("11030E" + bytes(range(14)).hex())
    paste = read(f"Tx: {adu('1103006B0007').hex(' ')}\nRx: {whole[:size].hex(' ')}")
    _, answer = paste.frames()
    assert (answer.missing, answer.length_known, answer.role) == (len(whole) - size, True, Role.RESPONSE)
    assert "CRC wrong" not in tree(paste) and f"cut: needs {len(whole) - size} more byte" in tree(paste)
    assert [field.name for field in answer.fields()].count("crc") == (size == len(whole) - 1)


def test_a_buffer_that_repeats_what_was_read_in_other_words_is_one_of_them():
    read_bytes = bytes.fromhex("01 E8 48 A4 3D 01 00 00 A4 48 02")
    stamp = "2024-09-13 15:37:09"
    shown = "".join(f"\\x{byte:02x}" for byte in read_bytes)
    paste = read(
        f"{stamp}.734 DEBUG recv: {' '.join(map(hex, read_bytes))}\n{stamp}.734 DEBUG Frame - [b'{shown}'] not ready"
    )
    assert b"".join(piece.data for piece in paste.pieces if isinstance(piece, PastedNoise)) == read_bytes
    assert "the same bytes as in line 1" in tree(paste)


def test_a_frame_explained_field_by_field_is_no_answer_to_itself():
    paste = read(
        'I want to see "11 06 00 01 00 03 9A 9B"\n\nwhere:\n\n11: the unit\n06: the function\n0001: the register\n'
        "0003: the value\n9A9B: the CRC"
    )
    assert [frame.role for frame in paste.frames()] == [Role.REQUEST]


def test_frames_that_a_log_puts_on_one_line_are_all_read():
    frames = [adu("010300800001"), adu("0103020400"), adu("010300810001")]
    words = ["send", "recv", "send"]
    paste = read(
        " >>>>> ".join(f"{word}: {' '.join(map(hex, frame))}" for word, frame in zip(words, frames, strict=True))
    )
    assert [frame.adu.data for frame in paste.frames()] == frames


def test_a_right_lrc_behind_a_colon_by_chance_is_no_ascii_frame():
    paste = read("D (1994) POLL RCV buffer:: 03 04 15 39 43 68")
    assert not list(paste.frames())
    assert [piece.data for piece in paste.pieces if isinstance(piece, PastedNoise)] == [bytes.fromhex("030415394368")]


def test_a_list_of_requests_says_nothing_of_answers():
    requests = [adu(f"0103000{i}0001").hex() for i in range(4)]
    listed = read("\n".join(f'Buffer.from("{request}", "hex"),' for request in requests))
    assert not any(frame.findings for frame in listed.frames())
    logged = read("\n".join(f"12:00:0{i}.000 modbus: {requests[0]}" for i in range(4)))
    assert "no-response" in {found.code for frame in logged.frames() for found in frame.findings}


@pytest.mark.parametrize(
    "text",
    [
        "0x09 -> unit\n0x04 -> code\n0x01 -> address high\n0x2C -> address low\n0x00 -> count high\n0x02 -> count low",
        "Request:\n09 ClientID\n04 Function\n012C Start\n0002 Quantity",
        "[0] 09\n[1] 04\n[2] 01\n[3] 2C\n[4] 00\n[5] 02",
        "9\n4\n1\n2C\n0\n2",
        "09\n04\n01\n2c\n00\n02",
        "char query[] = {\n0x09,\n0x04,\n0x01,\n0x2C,\n0x00,\n0x02\n};",
        "char query[] = {0x09, 0x04, 0x01, 0x2C,\n  0x00, 0x02};",
    ],
)
def test_a_frame_a_byte_a_line_without_its_crc(text):
    (frame,) = read(text).frames()
    assert (frame.adu.data.hex(), frame.role, frame.missing) == ("0904012c0002", Role.REQUEST, 2)


@pytest.mark.parametrize(
    "text",
    [
        "0x00 -> voltage\n0x01 -> current\n0x02 -> power\n0x03 -> energy",
        "status 0x01\nstatus 0x03\nstatus 0x00\nstatus 0x01",
        "temperature 25\nhumidity 40\npressure 99\nlevel 12",
    ],
)
def test_numbers_beside_words_are_no_bytes(text):
    with pytest.raises(HexError):
        read(text)


def test_a_short_last_row_belongs_to_its_dump():
    answer = adu("0A040C" + "0101 0202 0303 0404 0505 7070".replace(" ", "")).hex(" ")
    rows = f"received 17 bytes\n {answer[:47]} |................|\n 7e |~|"
    assert (
        b"".join(piece.data if isinstance(piece, PastedNoise) else piece.adu.data for piece in read(rows).pieces)[-1:]
        == b"~"
    )


def test_bytes_beside_others_that_are_not_read_are_told():
    paste = read("TX 11 03 00 6B 00 03 + CRC 1B 0A")
    assert [(one.line, one.why) for one in paste.unread] == [(1, "'1B 0A' beside the bytes may also be bytes")]


def test_words_are_not_called_bytes():
    paste = read("RTUutilsReceiver /dev/ttyUSB0 at 192.168.1.10\n11 03 00 6B 00 03 76 87")
    assert "may be anything" not in tree(paste)


def test_a_chance_prefix_with_a_right_crc_is_not_taken():
    answer = "04 03 1C 3F E9 15 18 03 02 00 01 02 02 00 03 18 02 00 03 0B 06 C6 39 07 01 01 00 00 00 00 00 0D EE"
    assert kinds(read(answer)) == [("response", True, 33)]


def test_a_vendors_function_and_an_unusual_length():
    assert kinds(read("01 41 05 01 45 DD 9E")) == [("request", True, 7)]
    lines = read("01 41 05 01 45 DD 9E\n01 41 05 0A 45 00 00 07 4E F6 FF FF FF FF D8 3E".replace("05 0A", "05 0a"))
    assert [frame.length for frame in lines.frames()] == [7, 16]


@pytest.mark.parametrize("text", ["48 65 6C 6C 6F", "DE AD BE EF", "7E 80 33 00 FE 0D", "00 00 00 00 00 00"])
def test_what_is_no_frame(text):
    paste = read(text)
    assert not paste.holds_a_frame
    assert all(isinstance(piece, PastedNoise) for piece in paste.pieces)
    assert paste.why.startswith("no frame")


@pytest.mark.parametrize("text", ["", "   \n", "hello world", "zz", "11 03 00 6"])
def test_what_holds_no_bytes_is_one_line(text):
    with pytest.raises(HexError) as caught:
        read(text)
    assert "\n" not in str(caught.value)


def test_a_paste_beyond_reason_is_refused():
    with pytest.raises(PasteError, match="rtuscope export"):
        read("00" * (1 << 20) + "11")


def test_long_pastes_are_split():
    paste = read(" ".join([REQUEST, ANSWER] * 400))
    assert len(paste.pieces) == 800
    assert [frame.request_start for frame in paste.frames()][-1] == paste.pieces[-2].start


def test_times_of_a_log_are_kept():
    text = f"[12:00:01.100] TX {REQUEST}\n[12:00:01.120] RX {ANSWER}\n[12:00:01.200] TX 99 98"
    request, answer = list(read(text).frames())[:2]
    assert request.t_end_ns is not None and answer.t_end_ns is not None
    assert answer.t_end_ns - request.t_end_ns == 20_000_000
    assert next(read(REQUEST).to_json())["t_end_ns"] is None


def test_a_write_asked_again_is_a_request_as_it_is_in_a_capture(tmp_path):
    poll, word = "01 03 00 10 00 01 85 CF", "01 03 02 00 07 F9 86"
    write = "05 06 00 20 00 01 48 44"
    lines, now = [], 0.0
    for pause, frame in ([(12, poll), (15, word)] * 3 + [(12, write), (500, write), (488, poll), (15, word)]) * 3:
        now += pause / 1000
        lines.append(f"10:00:{now:06.3f}  {frame}")
    text = "\n".join(lines)
    (tmp_path / "bus.log").write_text(text + "\n", encoding="utf-8")
    frames = list(read(text).frames())
    captured = analyzer.open(tmp_path / "bus.log").frames()
    assert [frame.role.name.lower() for frame in frames] == [str(frame.direction) for frame in captured]
    assert [frame.role.name for frame in frames if frame.function == 6] == ["REQUEST"] * 6


def test_the_json_keys_are_those_of_export():
    line = next(read(REQUEST).to_json())
    assert list(line) == [
        "index", "start", "length", "t_start_ns", "t_end_ns", "protocol", "direction", "unit", "function", "name",
        "exception", "crc_ok", "request_start", "taken_for_start", "unsure", "response_time_ns", "hex", "fields",
        "address", "quantity", "values", "summary", "time", "confidence", "findings",
    ]  # fmt: skip
    assert line["hex"] == "1103006b00037687"
    assert (line["unit"], line["function"], line["name"]) == (17, 3, "Read Holding Registers")


def test_floats_are_hinted_and_every_order_is_there_when_asked():
    paste = read("01 04 00 00 00 02 71 CB " + adu("010404" + "43663333").hex(" "))
    assert "with the next as float: ABCD 230.2" in tree(paste)
    values = tree(paste, values=True)
    assert "1130771251" in values
    assert all(f" {order} " in values for order in ("ABCD", "CDAB", "BADC", "DCBA"))


def test_colour_is_only_there_when_asked():
    assert "\x1b" not in tree(read(REQUEST))
    assert "\x1b[1m" in tree(read(REQUEST), colour=True)


def test_a_devices_string_cannot_move_the_cursor():
    name = b"\x1b[2J\x9bevil\r\n"
    text = tree(read(adu("0111" + f"{len(name):02x}" + name.hex()).hex(" ")))
    assert not any((ord(c) < 32 and c != "\n") or 0x7F <= ord(c) < 0xA0 for c in text)


@settings(deadline=None)
@given(
    st.binary(min_size=1, max_size=400),
    st.sampled_from(["auto", "rtu", "ascii", "tcp"]),
    st.sampled_from(["auto", "request", "response"]),
)
def test_any_bytes_are_read_and_tiled(data, envelope, role):
    paste = read(data.hex(" "), envelope, role)
    check_tiling(paste, len(data))


# what is left of one RTU line would be a frame with the next, but for the Modbus TCP line between them
@example([REQUEST, "00", "01", "00", "\n", MBAP, "\n", "3A 30 31 0D 0A", REQUEST])
@example(["00", REQUEST, "\n", "01", REQUEST])  # two lines number none
@example(["00", MBAP, "\n", "01"])  # nor does what stands before a frame as its bytes do
@example(["11", ANSWER, "\n", "00"])  # 11 bytes behind 11: in nothing but bytes it is no count of them
@settings(deadline=None)
@given(
    st.lists(
        st.sampled_from(["00", "01", "03", "83", "11", "FF", "\n", REQUEST, ANSWER, MBAP, "3A 30 31 0D 0A"]),
        min_size=1,
        max_size=40,
    )
)
def test_plausible_bytes_are_read_and_tiled(words):
    text = " ".join(words)
    if text.strip():
        paste = read(text)
        check_tiling(paste, len(bytes.fromhex(text)))


def check_tiling(paste, size):
    assert paste.pieces[0].start == 0
    assert all(one.start + one.length == two.start for one, two in pairwise(paste.pieces))
    assert paste.pieces[-1].start + paste.pieces[-1].length == size
    assert tree(paste, values=True)
    assert list(paste.to_json(noise=True))


@settings(deadline=None)
@given(st.text(max_size=120))
def test_any_text_is_read_or_refused_in_one_line(text):
    try:
        read(text)
    except HexError as error:
        assert "\n" not in str(error)
