"""Lines of logs as programs and people write them: a time, a label, bytes in a notation, words behind; a few lines."""

from __future__ import annotations

from random import Random
from typing import Final

from attack.inputs import spoilt
from attack.target import FRAMES

_TIMES: Final = (
    "",
    "",
    "2026-11-21 10:45:00.123 ",
    "[10:45:00] ",
    "10:45:00,5\t",
    "0.000602 ",
    "1763718300.25: ",
    "21.11.2026 10:45 ",
    "2026-11-21T10:45:00Z ",
    "Nov 21 10:45:00 host app[1]: ",
    "+12 ms ",
    "00:00:00.000000001 ",
    "99:99:99 ",
    "[    1.5] ",
)
_LABELS: Final = (
    "",
    "",
    "TX: ",
    "RX: ",
    "> ",
    "<- ",
    "Send ",
    "recv(8) = ",
    "[TX] ",
    "Запрос: ",
    "Ответ: ",
    "IRP_MJ_WRITE Length 8: ",
    "COM3 -> ",
    "slave 17 ",
    "DEBUG:root:SEND: ",
    "read [8]: ",
    "modbus[3] ",
    "Tx:000012-",
    "len=8 data=",
    "b'",
    '"data": "',
)
_BEHIND: Final = (
    "",
    "",
    "",
    "  |..k..v|",
    " CRC OK",
    " (8 bytes)",
    "'",
    '"',
    " ...",
    " // read",
    ", crc=7687",
    "\x1b[0m",
    "]",
)
_BETWEEN: Final = (" ", " ", "", ",", ", ", "-", ":", "  ", "\t", "|", "][", " 0x", "\\x", ";")
_FORMS: Final = (
    "{:02X}",
    "{:02x}",
    "0x{:02X}",
    "0x{:x}",
    "{:d}",
    "{:03d}",
    "\\x{:02x}",
    "[{:02X}]",
    "{:02X}h",
    "%{:02X}",
    "{:08b}",
)
_TOKENS: Final = (b"0x", b":", b" TX ", b"11 03", b"..", b"\xe2\x80\x93", b"\t", b"|", b"00000010  ", b"\x1b[31m")


def log_lines(chance: Random) -> bytes:
    """A few lines of one log; one in four is spoilt."""
    time, label, between, form = map(chance.choice, (_TIMES, _LABELS, _BETWEEN, _FORMS))
    lines = []
    for _ in range(chance.choice((1, 1, 1, 2, 3, 6))):
        data = bytearray(chance.choice(FRAMES) if chance.random() < 0.9 else chance.randbytes(chance.randint(1, 12)))
        if chance.random() < 0.2:
            data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        if chance.random() < 0.1:
            data = data[chance.randrange(len(data)) :]
        if chance.random() < 0.2:
            time, label = chance.choice(_TIMES), chance.choice(_LABELS)
        written = between.join(form.format(byte) for byte in data)
        if chance.random() < 0.1:
            written = ":" + data[:-2].hex().upper() + f"{-sum(data[:-2]) & 0xFF:02X}"
        lines.append(f"{time}{label}{written}{chance.choice(_BEHIND)}")
    text = chance.choice(("\n", "\n", "\r\n", " ", "\n\n")).join(lines).encode()
    return spoilt(chance, [text], _TOKENS)[:2000] if chance.random() < 0.25 else text
