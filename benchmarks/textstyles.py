"""Texts drawn from a grammar of how tools, programs and people write bytes down, with the truth of what they show.

A text is a conversation written in a style: stamp x speaker x writing x tail, a way of joining (rows of a dump, reads
in pieces, wraps, a byte a line), a way of saying it again, damage, and everyday lines between, each a row of a table.
The rows of a table at even places are there to fit on, those at odd places to tell a score on (`half`); conversations
are drawn anew for each seed. All of it is made here; nothing is anybody's text.
"""

# ruff: noqa: ARG005 - a row of a table is a function whether it needs its arguments or not

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import Final, NamedTuple, TypeVar

from dissectors.crc import crc_bytes, lrc

Row = TypeVar("Row")


class Said(NamedTuple):
    """A frame on the wire: by the client or not, and when, in ms; `kind` is frame, damaged or stray."""

    data: bytes
    sent: bool
    ms: int
    kind: str = "frame"

    @property
    def role(self) -> str:
        return "request" if self.sent else "response"


@dataclass(frozen=True, slots=True)
class Drawn:
    """A text with what it shows, and the names of the rows that it was drawn from."""

    text: str
    said: tuple[Said, ...]
    timed: bool
    rows: tuple[str, ...]


def _clock(ms: int) -> tuple[int, int, int, int]:
    seconds, milli = divmod(ms + 36_000_000, 1000)
    return seconds // 3600 % 24, seconds // 60 % 60, seconds % 60, milli


def hms(ms: int, sign: str = ".") -> str:
    hour, minute, second, milli = _clock(ms)
    return f"{hour:02}:{minute:02}:{second:02}{sign}{milli:03}"


STAMPS: Final[dict[str, Callable[[int], str]]] = {
    "none": lambda ms: "",
    "clock": lambda ms: f"{hms(ms)} ",
    "brackets": lambda ms: f"[{hms(ms)}] ",
    "iso": lambda ms: f"2026-03-14T{hms(ms)}Z ",
    "nothing": lambda ms: "",
    "comma": lambda ms: f"2026-03-14 {hms(ms, ',')} ",
    "day first": lambda ms: f"14.03.2026 {hms(ms)} ",
    "epoch": lambda ms: f"{1773482400 + ms // 1000}.{ms % 1000:03}000: ",
    "ticks": lambda ms: f"I ({ms}) ",
    "colon ms": lambda ms: f"{hms(ms, ':')} | ",
    "elapsed": lambda ms: f"[{ms / 1000:12.6f}] ",
    "paren": lambda ms: f"({hms(ms)}) ",
    "slashes": lambda ms: f"2026/03/14 {hms(ms)}412 ",
    "with ms": lambda ms: f"{ms} ms: ",
    "zone": lambda ms: f"2026-03-14 {hms(ms)}+0200 ",
    "tick bar": lambda ms: f"[V] {ms}| ",
    "seconds": lambda ms: f"{hms(ms)[:8]} ",
    "arrow": lambda ms: f"{hms(ms)} -> ",
}  # fmt: skip
UNTIMED: Final = ("none", "nothing", "seconds")

SPEAKERS: Final[dict[str, tuple[str, str]]] = {
    "tx": ("TX: ", "RX: "),
    "none": ("", ""),
    "tx in brackets": ("[TX] ", "[RX] "),
    "angles": (">> ", "<< "),
    "words": ("Request: ", "Response: "),
    "sent": ("Sent ", "Received "),
    "send": ("SEND: ", "RECV: "),
    "arrows": ("-> ", "<- "),
    "hosts": ("PLC->Drive: ", "Drive->PLC: "),
    "call": ("write ", "read "),
    "dash": ("tx - ", "rx - "),
    "russian": ("Запрос: ", "Ответ: "),
    "chinese": ("发送：", "接收："),
    "german": ("Gesendet: ", "Empfangen: "),
    "logger": ("DEBUG modbus.rtu send ", "DEBUG modbus.rtu recv "),
    "trace": ("[D][uart:114]: >>> ", "[D][uart:114]: <<< "),
    "upper": ("OUT ", "IN "),
    "master": ("Master: ", "Slave: "),
    "port": ("/dev/ttyS1 tx: ", "/dev/ttyS1 rx: "),
    "unknown": ("Lähetys: ", "Vastaus: "),
    "query": ("Query  = ", "Answer = "),
    "spanish": ("Enviado: ", "Recibido: "),
}  # fmt: skip


def _escaped(data: bytes) -> str:
    return "".join(chr(b) if 0x20 < b < 0x7F and b not in b"\\'\"" else f"\\x{b:02x}" for b in data)


def each(form: str, between: str = " ") -> Callable[[bytes], str]:
    return lambda data: between.join(form.format(b) for b in data)


WRITINGS: Final[dict[str, Callable[[bytes], str]]] = {
    "pairs": each("{:02X}"),
    "low pairs": each("{:02x}"),
    "0x": each("0x{:02x}"),
    "solid": lambda data: data.hex().upper(),
    "dashes": each("{:02X}", "-"),
    "colons": each("{:02x}", ":"),
    "short 0x": each("0x{:x}"),
    "brackets": each("[{:02X}]", ""),
    "0x commas": each("0x{:02X}", ", "),
    "dots": each("{:02X}", "."),
    "decimals": lambda data: f"[{', '.join(map(str, data))}]",
    "bare decimals": each("{}"),
    "escapes": lambda data: "b'" + "".join(f"\\x{b:02x}" for b in data) + "'",
    "repr": lambda data: f"b'{_escaped(data)}'",
    "one digit": each("{:X}"),
    "buffer": lambda data: f"<Buffer {data.hex(' ')}>",
    "h behind": each("{:02X}h"),
    "dollars": each("${:02X}"),
    "quotes": lambda data: "[" + ", ".join(f"'{b:02x}'" for b in data) + "]",
    "angles": each("<{:02X}>", ""),
    "fours": lambda data: " ".join(data.hex()[i : i + 4] for i in range(0, 2 * len(data), 4)),
    "commas": each("{:02X}", ","),
    "quoted solid": lambda data: f'"{data.hex()}"',
    "two blanks": each("{:02X}", "  "),
    "16#": each("16#{:02X}", ", "),
    "bars": each("{:02X}", " | "),
    "base 10 of three": each("{:03d}"),
    "semicolons": each("{:02x}", ";"),
}  # fmt: skip

TAILS: Final[dict[str, Callable[[Said, Random], str]]] = {
    "none": lambda said, rng: "",
    "count": lambda said, rng: f" ({len(said.data)} bytes)",
    "nothing": lambda said, rng: "",
    "took": lambda said, rng: f" ({rng.randrange(1, 900) / 10} ms)",
    "plus": lambda said, rng: f" +{rng.randrange(1, 99)}ms",
    "comment": lambda said, rng: f"  // unit {said.data[0]}",
    "ok": lambda said, rng: "  OK",
    "length": lambda said, rng: f" len={len(said.data)}",
    "bare took": lambda said, rng: f" {rng.randrange(10, 99)}.{rng.randrange(10)}ms",
    "shown": lambda said, rng: "  |" + "".join(chr(b) if 0x20 < b < 0x7F else "." for b in said.data) + "|",
    "dot": lambda said, rng: ".",
    "crc ok": lambda said, rng: " CRC OK",
    "port": lambda said, rng: f" @192.168.{rng.randrange(9)}.{rng.randrange(1, 99)}:4001",
    "json": lambda said, rng: f' {{"n":{rng.randrange(9)},"ok":true}}',
}

EVERYDAY: Final[dict[str, Callable[[Random], str]]] = {
    "json long": lambda rng: json.dumps({"id": rng.randrange(10**7, 10**9), "U": [230.1, rng.randrange(9)]}),
    "wait": lambda rng: "waiting for the next cycle",
    "traceback": lambda rng: f'  File "/opt/app/poll.py", line {rng.randrange(10, 900)}, in read',
    "address": lambda rng: f"connected to 10.0.{rng.randrange(250)}.{rng.randrange(250)}:502",
    "pointer": lambda rng: f"free heap {rng.randrange(10**5)} at 0x3ffb{rng.randrange(1 << 16):04x}",
    "stack": lambda rng: " ".join(f"{rng.randrange(1 << 32):08x}" for _ in range(4)),
    "ls": lambda rng: f"-rw-r--r-- 1 root root {rng.randrange(10**6)} Mar 14 10:{rng.randrange(60):02} config.yaml",
    "date": lambda rng: f"2026-03-{rng.randrange(1, 28):02}",
    "uuid": lambda rng: "session " + "-".join(f"{rng.randrange(16**n):0{n}x}" for n in (8, 4, 4, 4, 12)),
    "price": lambda rng: f"Total 12 {rng.randrange(100, 999)} RUB, VAT 20%",
    "mac": lambda rng: "wlan0 " + ":".join(f"{rng.randrange(256):02x}" for _ in range(6)) + " up",
    "phone": lambda rng: f"tel +7 495 {rng.randrange(100, 999)} {rng.randrange(10, 99)} {rng.randrange(10, 99)}",
    "register": lambda rng: f"register {rng.randrange(100)} = {rng.randrange(65536)} (0x{rng.randrange(65536):04X})",
    "russian": lambda rng: f"Прибор молчит, тайм-аут {rng.choice((100, 500))} мс, попытка {rng.randrange(1, 4)} из 3",
    "version": lambda rng: f"firmware v{rng.randrange(9)}.{rng.randrange(20)} build {rng.randrange(10**7)}",
    "values": lambda rng: f"values: [{', '.join(str(rng.randrange(1000)) for _ in range(4))}]",
    "german": lambda rng: f"Gerät {rng.randrange(1, 30)} antwortet nicht (Versuch {rng.randrange(1, 4)})",
    "state": lambda rng: f"temperature {rng.random() * 50:.2f} humidity {rng.random() * 100:.1f}",
    "chinese": lambda rng: f"温度 {rng.randrange(10, 40)} 湿度 {rng.randrange(10, 90)}",
    "boot": lambda rng: f"rst:0x1 (POWERON_RESET),boot:0x13 (FLASH_BOOT), entry 0x400{rng.randrange(1 << 20):05x}",
    "hash": lambda rng: f"commit {rng.randrange(16**40):040x}",
    "config": lambda rng: f"baudrate=9600 parity=N databits=8 stopbits=1 timeout={rng.randrange(100, 999)}",
    "french": lambda rng: f"Tension phase 1 : {rng.randrange(220, 240)},{rng.randrange(10)} V",
    "empty": lambda rng: "",
    "table": lambda rng: f"{rng.randrange(40001, 49999)} | holding | {rng.randrange(65536)} | 0.1 | V",
    "gps": lambda rng: f"$GPGGA,1235{rng.randrange(10, 59)},4807.038,N,01131.000,E,1,08,0.9,545.4,M*47",
}  # fmt: skip

JOINS: Final = (
    "line",
    "line",
    "pieces",
    "below",
    "line",
    "rows of 8",
    "soft wrap",
    "byte a line",
    "hard wrap",
    "rows of 16",
)
COPIES: Final = ("none", "none", "none", "handler", "none", "pdu", "grown", "twice")
DAMAGES: Final = ("none", "none", "bit", "none", "cut", "stray", "none", "none")


def _pdus(rng: Random) -> list[tuple[bytes, bytes]]:
    unit, pairs = rng.choice((1, 1, 2, 5, 17, 100, 247)), []
    for _ in range(rng.randrange(2, 6)):
        function, count = rng.choice((3, 3, 3, 4, 4, 1, 2, 5, 6, 16)), rng.choice((1, 2, 2, 4, 9))
        head = bytes((unit, function)) + rng.choice((0, 1, 107, 256, 0x1000, 40000)).to_bytes(2, "big")
        values = b"".join(
            rng.choice((0, rng.randrange(300), rng.randrange(65536))).to_bytes(2, "big") for _ in range(count)
        )
        asks = head + count.to_bytes(2, "big")
        if function < 5 and rng.random() < 0.07:
            pairs.append((asks, bytes((unit, function | 0x80, rng.choice((1, 2, 3, 4))))))
        elif function in (3, 4):
            pairs.append((asks, bytes((unit, function, 2 * count)) + values))
        elif function in (1, 2):
            pairs.append((asks, bytes((unit, function, (count + 7) // 8)) + values[: (count + 7) // 8]))
        elif function == 16:
            pairs.append((asks + bytes((2 * count,)) + values, asks))
        else:
            pairs.append((head + (rng.choice((b"\xff\0", b"\0\0")) if function == 5 else values[:2]),) * 2)
    return pairs


def conversation(rng: Random, envelope: str) -> list[Said]:
    """A few exchanges with times."""
    said, ms, transaction = [], rng.randrange(10**6), rng.randrange(1, 3000)
    for request, answer in _pdus(rng):
        for pdu, sent in ((request, True), (answer, False)):
            ms += rng.randrange(100, 900) if sent else rng.randrange(8, 80)
            if envelope == "tcp":
                data = transaction.to_bytes(2, "big") + b"\0\0" + len(pdu).to_bytes(2, "big") + pdu
            elif envelope == "ascii":
                data = b":" + (pdu + bytes((lrc(pdu),))).hex().upper().encode() + b"\r\n"
            else:
                data = pdu + crc_bytes(pdu)
            said.append(Said(data, sent, ms))
        transaction += 1
    return said


def damaged(said: list[Said], how: str, rng: Random) -> list[Said]:
    """One answer of it damaged, but for the first two frames."""
    i = 3
    one = said[i]
    if how == "bit":
        at = rng.randrange(3, len(one.data))
        broken = one.data[:at] + bytes((one.data[at] ^ 1 << rng.randrange(8),)) + one.data[at + 1 :]
        return [*said[:i], one._replace(data=broken, kind="damaged"), *said[i + 1 :]]
    if how == "cut" and len(one.data) > 5:
        return [
            *said[:i],
            one._replace(data=one.data[: -rng.randrange(1, len(one.data) - 3)], kind="damaged"),
            *said[i + 1 :],
        ]
    if how == "stray":
        return [*said[:i], one._replace(data=b"\0" + one.data, kind="behind a stray"), *said[i + 1 :]]
    return said


def half(table: Sequence[Row], which: str) -> list[Row]:
    """The rows of a table that are for fitting ("fit") or for the score ("held"); "all" of them."""
    return list(table) if which == "all" else list(table)[which == "held" :: 2]


def wrapped(line: str, width: int, soft: bool) -> list[str]:
    """A line as a window or a mail of so many columns breaks it."""
    out = []
    while len(line) > width:
        at = line.rfind(" ", 0, width + 1) if soft else width
        at = at if at > 0 else width
        out.append(line[:at])
        line = line[at:].lstrip(" ") if soft else line[at:]
    return [*out, line]


def _dump(data: bytes, width: int, base: int) -> list[str]:
    shown = "".join(chr(b) if 0x20 < b < 0x7F else "." for b in data)
    return [
        f"{base + at:08x}  {data[at : at + width].hex(' '):<{3 * width}} |{shown[at : at + width]}|"
        for at in range(0, len(data), width)
    ]


def drawn(seed: int, which: str = "all") -> Drawn:
    """The text of a seed; of which half of the tables' rows."""
    rng = Random(f"text {which} {seed}")
    envelope = rng.choice(("rtu", "rtu", "rtu", "rtu", "tcp"))
    said = conversation(rng, envelope)
    stamp = rng.choice(half([*STAMPS], which))
    speaker, writing = rng.choice(half([*SPEAKERS], which)), rng.choice(half([*WRITINGS], which))
    tail = rng.choice(half([*TAILS], which))
    everyday = [rng.choice(half([*EVERYDAY], which)) for _ in range(rng.randrange(4))]
    join, copy = rng.choice(JOINS), rng.choice(COPIES)
    damage = rng.choice(DAMAGES) if envelope == "rtu" else "none"
    said = damaged(said, damage, rng)
    if join in ("rows of 8", "rows of 16"):
        writing, tail = "pairs", "none"
    if join == "byte a line":
        tail = "none"
        writing = (
            writing
            if writing
            not in (
                "solid",
                "fours",
                "quoted solid",
                "repr",
                "decimals",
                "bare decimals",
                "one digit",
                "base 10 of three",
            )
            else "0x"
        )
    if join in ("soft wrap", "hard wrap") or join == "byte a line":
        copy = "none"
    write = WRITINGS[writing]
    base, lines, offset = rng.randrange(1 << 12) * 16, [], 0
    width = rng.choice((40, 50, 64, 72, 80))
    for one in said:
        head = STAMPS[stamp](one.ms)
        word = SPEAKERS[speaker][not one.sent]
        end = TAILS[tail](one, rng)
        if join == "pieces" and len(one.data) > 5:
            at = rng.randrange(2, len(one.data) - 1)
            entry = [f"{head}{word}{write(one.data[:at])}", f"{STAMPS[stamp](one.ms + 3)}{word}{write(one.data[at:])}"]
        elif join == "below":
            entry = [f"{head}{word}".rstrip() or "-", write(one.data) + end]
        elif join.startswith("rows"):
            entry = [f"{head}{word}".rstrip() or "-", *_dump(one.data, 8 if join.endswith("8") else 16, base + offset)]
            offset += len(one.data)
        elif join == "byte a line":
            entry = [f"{head}{word}{write(one.data[i : i + 1])}" for i in range(len(one.data))]
        elif join.endswith("wrap"):
            entry = wrapped(f"{head}{word}{write(one.data)}{end}", width, join == "soft wrap")
        else:
            entry = [f"{head}{word}{write(one.data)}{end}"]
        if copy == "handler":
            entry.append(f"{head}codec: {write(one.data)}")
        elif copy == "pdu" and one.kind == "frame" and envelope == "rtu":
            entry.append(f"{head}decoded pdu {write(one.data[1:-2])}")
        elif copy == "grown" and not one.sent and join == "line":
            entry = [f"{head}buffer {write(one.data[:n])}" for n in sorted({2, len(one.data) // 2, len(one.data)})]
        elif copy == "twice" and stamp not in UNTIMED and join == "line":
            entry = entry * 2
        lines += entry
        if everyday and rng.random() < 0.4:
            lines.append(EVERYDAY[rng.choice(everyday)](rng))
    if everyday:
        lines = [EVERYDAY[everyday[0]](rng), *lines, EVERYDAY[everyday[-1]](rng)]
    return Drawn(
        "\n".join(lines) + "\n",
        tuple(said),
        stamp not in UNTIMED,
        (envelope, stamp, speaker, writing, tail, join, copy, damage, *everyday),
    )
