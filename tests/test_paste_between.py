"""What people and programs write between frames: numbers, addresses, counts and values, none of which is a byte."""

from __future__ import annotations

import pytest

from analyzer.paste import read
from captures.errors import HexError

ASKS, ANSWERS = "0B 03 00 10 00 02 C5 64", "0B 03 04 00 FA 01 2C 70 4F"
WRITINGS = [
    f"TX: {ASKS}\n{{}}\nRX: {ANSWERS}",
    f"10:01:02.500 >> {ASKS}\n{{}}\n10:01:02.530 << {ANSWERS}",
    f"Запрос {ASKS.replace(' ', '')}\n{{}}\nОтвет {ANSWERS.replace(' ', '')}",
]
BETWEEN = [
    "Register 40001 -> 1234",
    "reply values -> 25 26 27",
    "values read: 16 25 30",
    "unit 01 fc 03",
    "unit 01 FC 03 timed out",
    "TX pin 17, RX pin 16",
    "received 8 bytes",
    "send() returned 8",
    "Tx=123 Rx=121 Err=2 ID=1 F=03 SR=1000ms",
    "ответ: 250",
    "返回值：250",
    "收到 7 字节",
    "Answer: 0x00FA",
    "Send to ac:a7:04:f4:03:ec failed",
    "wifi: connected to AA-BB-CC-DD-EE-FF, ip 192.168.1.57",
    "Received CRC C4 0B, calculated 0B C4",
    "Прибор ТРМ210, адрес 16, скорость 9600, 8N1, регистр 0x0102 (258)",
    "Тел. +7 (495) 123-45-67",
    "values: 00FA 0064",
    "no response",
    "ответ не получен",
    "Функции 01 02 03 04 05 06 0F 10 поддерживаются",
    "https://example.com/d/11-03-00-10",
    "Be Ad",
    "Posted by user42 on 25.11.2026 at 10:15",
    "Сергей, 10:15 PM",
]


@pytest.mark.parametrize("writing", WRITINGS)
@pytest.mark.parametrize("between", BETWEEN)
def test_what_stands_between_is_no_byte(writing: str, between: str) -> None:
    pieces = read(writing.format(between)).pieces
    assert [piece.adu.data.hex(" ").upper() if hasattr(piece, "adu") else piece.data for piece in pieces] == [
        ASKS,
        ANSWERS,
    ]


@pytest.mark.parametrize(
    "words",
    [
        "registers 40001-40010 timeout",
        "ИНН 7701234567",
        "Цена 12 500 руб, срок 2-3 дня",
        "modpoll -m rtu -a 11 -r 17 -c 2 -b 9600 -p none",
        "DC 24 V, AC 230 V",
        "FC 302",
        "speeds 1200 2400 4800 9600 19200",
        "MAC: 00:1A:2B:3C:4D:5E",
        "git commit 1a2b3c4d5e6f",
        "WriteFile ( 0x1a4, 8 ) = TRUE",
        "main.rs:42:5 panicked",
        "Offset  0  1  2  3  4  5  6  7   8  9  A  B  C  D  E  F",
    ],
)
def test_of_words_and_numbers_beside_frames_nothing_is_said(words: str) -> None:
    assert [one.why for one in read(WRITINGS[0].format(words)).unread if not one.empty] == []


@pytest.mark.parametrize(
    "text",
    [
        "40001: 250\n40002: 300\n40003: 1000\n40004: 1234",
        "2026-11-21 10:15:03 ERROR modbus timeout, slave 5, retry 3",
        "Помогите, не работает обмен с частотником, адрес 1, скорость 9600. Ошибка 0x0B постоянно.",
        "Клеммы 11, 12, 13, 14. Функции: 01, 02, 03, 04, 05, 06, 0F, 10",
        "10:15",
        "inst = minimalmodbus.Instrument('/dev/ttyUSB0', 1)\nprint(inst.read_register(0x10, 1))",
    ],
)
def test_where_nothing_is_a_byte_none_is_read(text: str) -> None:
    with pytest.raises(HexError):
        read(text)


def record(address: int, kind: int, data: bytes = b"") -> str:
    """A line of a program in Intel HEX."""
    line = bytes((len(data),)) + address.to_bytes(2, "big") + bytes((kind,)) + data
    return f":{(line + bytes((-sum(line) & 0xFF,))).hex().upper()}"


PROGRAM = [
    record(0, 4, b"\x08\x00"),
    record(0x310, 0, bytes(range(1, 17))),
    record(0x320, 0, b"\xff\x02"),
    record(0, 1),
]


def test_the_lines_of_a_program_are_no_frames_of_ascii_mode() -> None:
    with pytest.raises(HexError, match="Intel HEX"):
        read("\n".join(["It refuses my firmware:", *PROGRAM]))


def test_a_request_that_looks_like_a_line_of_a_program_is_one() -> None:
    ask = record(0x0300, 0, b"\x00\x02")  # of unit 2, with a right LRC
    assert [frame.adu.unit for frame in read(f"Tx {ask}\nTx {ask}").frames()] == [2, 2]
