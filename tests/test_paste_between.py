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
    "text",
    [
        "40001: 250\n40002: 300\n40003: 1000\n40004: 1234",
        "2026-11-21 10:15:03 ERROR modbus timeout, slave 5, retry 3",
        "Помогите, не работает обмен с частотником, адрес 1, скорость 9600. Ошибка 0x0B постоянно.",
        "inst = minimalmodbus.Instrument('/dev/ttyUSB0', 1)\nprint(inst.read_register(0x10, 1))",
    ],
)
def test_where_nothing_is_a_byte_none_is_read(text: str) -> None:
    with pytest.raises(HexError):
        read(text)
