"""What stands beside frames that are damaged, and around those that are not: read, or left alone."""

from __future__ import annotations

import pytest
from buses import adu

from analyzer.paste import PastedFrame, PasteError, judge, read
from captures.errors import HexError

REQUEST, ANSWER = adu("07040120 0002"), adu("07040400e1 01c8")
GARBLED = ANSWER[:5] + b"\x13" + ANSWER[6:]


def pieces(text: str) -> list[bytes]:
    try:
        found = read(text).pieces
    except (HexError, PasteError):
        return []
    return [piece.adu.data if isinstance(piece, PastedFrame) else piece.data for piece in found]


def received(form: str, data: bytes) -> str:
    return "\n".join(form.format(b=b) for b in data)


@pytest.mark.parametrize(
    "form",
    [
        "[11:54:49][V][modbus:042]: Modbus received Byte  {b} (0X{b:x})",
        "[11:54:49][VV][uart:042]:     Read 0b{b:08b} (0x{b:02X})",
        "received: {b} = 0x{b:02X}",
    ],
)
def test_a_byte_in_two_bases_is_one_whatever_its_crc(form: str) -> None:
    text = f"Modbus write: {REQUEST.hex('.')} (8)\n{received(form, GARBLED)}"
    assert b"".join(pieces(text)) == REQUEST + GARBLED


@pytest.mark.parametrize(
    "text",
    [
        "a list of SQLSTATE codes\nSQLSTATE codes for errors\nthe SQLSTATE code",
        "fold 1\nfold level here is 1\nfold 3\nfold level here is 3\nlevel 2\nlevel 1",
        "1.  item one\n2.  item two\n3.  item three\n4.  item four\n5.  item five\n6.  item six\n7.  item seven",
        "1 latin1\n1 latin2\n1 koi8-r\n1 koi8-u\n2 cp932\n2 euc-kr\n2 euc-cn\n2 cp949\nu utf-8\nu ucs-2",
    ],
)
def test_numbers_of_other_things_are_no_damaged_frames(text: str) -> None:
    assert pieces(text) == []


def test_registers_in_two_bases_below_frames_are_no_bytes() -> None:
    registers = "\n".join(f"register {n} = {v} (0x{v:02X})" for n, v in enumerate((5, 3, 9, 2, 7, 1)))
    assert pieces(f"TX: {REQUEST.hex(' ')}\nRX: {ANSWER.hex(' ')}\n{registers}") == [REQUEST, ANSWER]


def test_a_check_value_quoted_in_an_error_is_none_of_the_frame() -> None:
    text = (
        f"MinimalModbus debug mode. Will write to instrument: {REQUEST.hex(' ')} (8 bytes)\n"
        f"MinimalModbus debug mode. Response from instrument: {REQUEST[:7].hex(' ')} (7 bytes)\n"
        r"her Checksum error in rtu mode: '\x02\xd4' instead of 'S\xf8' ."
    )
    assert b"".join(pieces(text)) == REQUEST + REQUEST[:7]


def test_fields_explained_below_a_frame_are_not_said_again() -> None:
    relay = adu("0105 0003 ff00")
    fields = "\n".join(
        f"| `{cell.hex(' ').upper()}` | {name} |"
        for cell, name in (
            (relay[:1], "Device address"),
            (relay[1:2], "Functiecode"),
            (relay[2:4], "Coil-adres"),
            (relay[4:6], "Waarde"),
            (relay[6:], "CRC16"),
        )
    )
    above = f"```\n{relay.hex(' ')}\n```\n\n| Bytes | Betekenis |\n|---|---|\n"
    assert pieces(f"{above}{fields}\n\nDe server stuurt hetzelfde bericht") == [relay]


def test_rows_of_an_explanation_with_an_arrow_are_no_answer() -> None:
    asked, answer = "0001 0000 0006 0103 000a 0002", "0001 0000 0007 0103 0400 01f0 0d"
    text = (
        f"modbus: send {bytes.fromhex(asked).hex(' ')}\nmodbus: recv {bytes.fromhex(answer).hex(' ')}\n"
        "The frame that was sent, decoded:\n\n03 << Function Code 3\n00 0a \n00 02 << 2 registers that should be read\n"
    )
    assert pieces(text) == [bytes.fromhex(asked), bytes.fromhex(answer)]


def test_what_a_frame_carries_is_not_said_again() -> None:
    refused = bytes.fromhex("0004 0000 0003 018302")
    text = (
        f"tcp-response buffer <Buffer {refused.hex(' ')}> +0ms\n"
        f"response-factory fc 131 payload <Buffer {refused[7:].hex(' ')}> +0ms"
    )
    assert pieces(text) == [refused]


def test_fields_of_any_width_over_several_lines() -> None:
    data = adu("0310 0016 0006 0c 00fb 01f4 0004 00b4 00b5 0022")
    rows = (
        f"{data[:1].hex()}    {data[1:2].hex()}    {data[2:4].hex()}   {data[4:6].hex()}  {data[6:7].hex()}  \n"
        f"{data[7:9].hex()}  {data[9:11].hex()}  {data[11:13].hex()}   \n"
        f"{data[13:15].hex()}  {data[15:17].hex()}  {data[17:19].hex()}\n{data[19:].hex(' ')}"
    )
    assert pieces(f"it should receive\n{rows}\nbut I just received the first half") == [data]


def test_bytes_of_ascii_mode_that_lost_their_line_breaks() -> None:
    frame = b":070302000AEA\r\n"
    text = " ".join(f"[N] {71921 + 3 * i}| RTUutils.cpp    [ 373] receive: {b:02X}" for i, b in enumerate(frame))
    paste = read(
        f"{text}\n[D] Raw buffer received: @3FFB39A0/6:\n  | 0000: {bytes.fromhex(frame[1:13].decode()).hex(' ')}"
    )
    assert [piece.adu.data.hex() for piece in paste.frames()] == ["070302000aea"]


@pytest.mark.parametrize(
    "form",
    [
        "Got 9 bytes: {digits} \nCRC error",
        ">>> binascii.hexlify(ser.read(20))\nb'{hex}'",
        "DEBUG read {hex}",
        "Slave answers: {pairs}",
    ],
)
def test_an_answer_with_a_wrong_crc_below_a_right_request(form: str) -> None:
    bad = ANSWER[:-1] + bytes((ANSWER[-1] ^ 0x21,))
    digits, sent = " ".join(f"{b:X}" for b in bad), " ".join(f"{b:X}" for b in REQUEST)
    said = form.format(digits=digits, hex=bad.hex(), pairs=bad.hex(" "))
    assert pieces(f"Sending: {sent} \n{said}")[-1] == bad


def test_a_buffer_that_did_not_fill_is_said_once() -> None:
    text = (
        f"  modbus-serial   data: <Buffer {REQUEST.hex(' ')}>,\n  modbus-serial   unitid: 7,\n"
        f"  modbus-serial   data: <Buffer {ANSWER[:4].hex(' ')}>,\n"
        f"  modbus-serial   buffer: <Buffer {ANSWER[:4].hex(' ')}> }} +12ms"
    )
    assert pieces(text) == [REQUEST, ANSWER[:4]]


@pytest.mark.parametrize("data", [REQUEST, ANSWER, REQUEST + ANSWER, GARBLED])
def test_a_judge_of_damaged_frames_goes_by_their_lengths(data: bytes) -> None:
    cut = data[:-1] + bytes((data[-1] ^ 0xFF,))
    assert [(span.start, span.end) for span in judge(cut)] in ([], [(0, len(REQUEST))])
    spans = judge(cut, damaged=True)
    assert spans and spans[0].start == 0
    assert judge(data[:5], damaged=True) == []
