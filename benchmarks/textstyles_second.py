"""Styles of text by another hand: rows that `textstyles` does not have, drawn in the same way; what is fitted on the
even ones is told on the odd ones. `styled` writes any conversation in any of them: a style must change no frame.
"""

# ruff: noqa: ARG005 - a row of a table is a function whether it needs its arguments or not

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random
from typing import Final, NamedTuple

from textstyles import DAMAGES, Drawn, Said, conversation, damaged, each, half, hms

STAMPS: Final[dict[str, Callable[[int], str]]] = {
    "none": lambda ms: "",
    "log4j": lambda ms: f"2026-03-14 {hms(ms, ',')} [main] INFO  ",
    "syslog": lambda ms: f"Mar 14 {hms(ms)[:8]} gw1 modbusd[812]: ",
    "angle": lambda ms: f"<{hms(ms)}> ",
    "logcat": lambda ms: f"03-14 {hms(ms)}  1234  1250 D Modbus: ",
    "s suffix": lambda ms: f"{ms / 1000:.3f}s ",
    "epoch ms": lambda ms: f"{1773482400000 + ms} ",
    "us": lambda ms: f"[{ms * 1000} us] ",
    "semicolon": lambda ms: f"{hms(ms)}; ",
    "pipe": lambda ms: f"2026-03-14 {hms(ms)} | ",
    "node": lambda ms: f"2026-03-14T{hms(ms)}Z modbus-serial ",
    "go": lambda ms: f"2026/03/14 {hms(ms)[:8]}.{ms % 1000:03}000 ",
    "plus": lambda ms: f"+{ms / 1000:.3f} ",
    "hash": lambda ms: f"#{ms} ",
    "rust": lambda ms: f"[2026-03-14T{hms(ms)}Z DEBUG tokio_modbus] ",
    "zephyr": lambda ms: f"[00:{hms(ms)[3:8]}.{ms % 1000:03},000] <dbg> modbus: ",
    "us date": lambda ms: f"03/14/2026 {hms(ms)[:8]}.{ms % 1000:03} ",
    "csv": lambda ms: f"{ms / 1000:.6f},",
    "zephyr tick": lambda ms: f"[{ms:010d}] ",
    "tab": lambda ms: f"{hms(ms)}\t",
}
UNTIMED: Final = ("none", "syslog")
SPEAKERS: Final[dict[str, tuple[str, str]]] = {
    "colon": ("TX:", "RX:"),
    "tx size": ("Tx [{}]: ", "Rx [{}]: "),
    "mb": ("MB_SEND ", "MB_RECV "),
    "to from": ("to slave: ", "from slave: "),
    "equals": ("tx=", "rx="),
    "func": ("uart_write(): ", "uart_read(): "),
    "host": ("HOST -> DEV ", "DEV -> HOST "),
    "sending": ("Sending frame: ", "Received frame: "),
    "q a": ("Q: ", "A: "),
    "arrows u": ("→ ", "← "),
    "polish": ("Wysłano: ", "Odebrano: "),
    "json": ('{{"dir":"tx","data":"', '{{"dir":"rx","data":"'),
    "ascii arrows": ("==> ", "<== "),
    "cmd": ("cmd ", "rsp "),
    "bytes written": ("Bytes written: ", "Bytes read: "),
    "brackets dir": ("(out) ", "(in) "),
    "turkish": ("Gönderilen: ", "Alınan: "),
    "serial": ("[serial] tx> ", "[serial] rx> "),
    "req resp": ("REQ ", "RSP "),
    "master": ("Master TX -> ", "Slave RX <- "),
}
WRITINGS: Final[dict[str, Callable[[bytes], str]]] = {
    "pairs": each("{:02X}"),
    "low pairs": each("{:02x}"),
    "0x upper": each("0X{:02X}"),
    "0x,": each("0x{:02x}", ","),
    "braces": lambda data: "{" + ", ".join(f"0x{b:02X}" for b in data) + "}",
    "bytes.fromhex": lambda data: f"bytes.fromhex('{data.hex()}')",
    "bytearray": lambda data: "bytearray(b'" + "".join(f"\\x{b:02x}" for b in data) + "')",
    "paren pairs": each("({:02X})", ""),
    "underscore": each("{:02x}", "_"),
    "percent": each("%{:02X}", ""),
    "slash": each("{:02X}", "/"),
    "js array": lambda data: f"[ {', '.join(map(str, data))} ]",
    "solid low": lambda data: data.hex(),
    "java": lambda data: "[" + ", ".join(str(b - 256 if b > 127 else b) for b in data) + "]",
    "hh": each("{:02X}H"),
    "0x solid": lambda data: "0x" + data.hex(),
    "quoted pairs": lambda data: '"' + data.hex(" ").upper() + '"',
    "vec": lambda data: "[" + ", ".join(f"{b:#04x}" for b in data) + "]",
    "colons up": each("{:02X}", ":"),
    "trailing": lambda data: "".join(f"{b:02X} " for b in data),
    "tabs": each("{:02X}", "\t"),
    "uint8": lambda data: f"Uint8Array({len(data)}) [{', '.join(map(str, data))}]",
}
TAILS: Final[dict[str, Callable[[Said, Random], str]]] = {
    "none": lambda said, rng: "",
    "nothing": lambda said, rng: "",
    "brackets n": lambda said, rng: f" [{len(said.data)}]",
    "took": lambda said, rng: f" in {rng.randrange(1, 90)}ms",
    "hash": lambda said, rng: f"  # {'request' if said.sent else 'response'}",
    "crc": lambda said, rng: " crc=ok",
    "semicolon": lambda said, rng: ";",
    "bytes": lambda said, rng: f" - {len(said.data)} bytes",
    "status": lambda said, rng: " status=0",
    "fc": lambda said, rng: f" <fc {said.data[1]}>",
    "rtt": lambda said, rng: f" rtt {rng.randrange(1, 90) / 10}ms",
    "comma": lambda said, rng: ",",
    "retry": lambda said, rng: " (try 1/3)",
    "unit": lambda said, rng: f" unit={said.data[0]}",
}
_WORD, _LONG = 1 << 16, 1 << 32
EVERYDAY: Final[dict[str, Callable[[Random], str]]] = {
    "kv": lambda rng: f"cpu={rng.randrange(100)}% mem={rng.randrange(1000)}M up={rng.randrange(99999)}s",
    "systemd": lambda rng: (
        f"Mar 14 10:0{rng.randrange(9)}:11 host systemd[1]: Started Session {rng.randrange(999)} of user root."
    ),
    "http": lambda rng: (
        f'192.168.1.{rng.randrange(255)} - - [14/Mar/2026:10:00:{rng.randrange(10, 59)} +0000] "GET / HTTP/1.1" 200 77'
    ),
    "esp dump": lambda rng: (
        f"A{rng.randrange(16)} : 0x{rng.randrange(_LONG):08x}  A{rng.randrange(16)} : 0x{rng.randrange(_LONG):08x}"
    ),
    "backtrace": lambda rng: (
        "Backtrace: "
        + " ".join(f"0x400{rng.randrange(1 << 20):05x}:0x3ffb{rng.randrange(_WORD):04x}" for _ in range(3))
    ),
    "df": lambda rng: (
        f"/dev/mmcblk0p2  {rng.randrange(10**8)} {rng.randrange(10**7)} {rng.randrange(10**7)}  {rng.randrange(99)}% /"
    ),
    "ip6": lambda rng: "inet6 " + ":".join(f"{rng.randrange(1 << 16):x}" for _ in range(8)) + "/64 scope global",
    "ip link": lambda rng: (
        "link/ether " + ":".join(f"{rng.randrange(256):02x}" for _ in range(6)) + " brd ff:ff:ff:ff:ff:ff"
    ),
    "c assert": lambda rng: f"assert failed: xQueueGenericSend queue.c:{rng.randrange(999)} (pxQueue)",
    "regs": lambda rng: "holding registers 40001..40010: " + " ".join(str(rng.randrange(65536)) for _ in range(10)),
    "yaml": lambda rng: (
        f"- address: {rng.randrange(255)}\n  register_count: {rng.randrange(9)}\n  name: Voltage L{rng.randrange(4)}"
    ),
    "url": lambda rng: (
        f"see https://example.org/t/{rng.randrange(10**5)}/{rng.randrange(99)}?id={rng.randrange(16**8):08x}"
    ),
    "mixed": lambda rng: (
        f"Slave 0x{rng.randrange(1, 64):02X} timeout after {rng.randrange(100, 999)} ms, 3 retries left"
    ),
    "csv": lambda rng: ",".join(str(rng.randrange(4096)) for _ in range(6)),
    "spanish": lambda rng: f"El esclavo {rng.randrange(1, 30)} no responde desde las 10:{rng.randrange(10, 59)}",
    "polish": lambda rng: f"Błąd sumy kontrolnej, urządzenie {rng.randrange(1, 30)}, próba {rng.randrange(9)}",
    "order": lambda rng: (
        f"Order no. {rng.randrange(10**8)}, 24.03.2026, EUR {rng.randrange(999)},{rng.randrange(10, 99)}"
    ),
    "git": lambda rng: f"{rng.randrange(16**7):07x} fix CRC order (#{rng.randrange(999)})",
    "python": lambda rng: (
        f"ModbusIOException: No Response received from the slave/Unable to decode response ({rng.randrange(999)})"
    ),
    "temps": lambda rng: (
        f"T1 {rng.randrange(10, 90)} T2 {rng.randrange(10, 90)} T3 {rng.randrange(10, 90)} T4 {rng.randrange(10, 90)}"
    ),
    "hex dump addr": lambda rng: f"heap_caps: 0x3ffb{rng.randrange(_WORD):04x} size 0x{rng.randrange(_WORD):04x}",
    "json": lambda rng: (
        f'{{"ts":{1773482400000 + rng.randrange(9999)},"values":[{rng.randrange(99)},{rng.randrange(99)}, 7]}}'
    ),
}


class LineStyle(NamedTuple):
    """Names of rows."""

    stamp: str
    speaker: str
    writing: str
    tail: str


def style(rng: Random, which: str) -> LineStyle:
    """A style drawn from half of the tables' rows, or from all."""
    stamp, speaker, writing, tail = (rng.choice(half([*table], which)) for table in (STAMPS, SPEAKERS, WRITINGS, TAILS))
    if speaker == "json":
        writing, tail = rng.choice(("pairs", "low pairs", "solid low")), "none"
    return LineStyle(stamp, speaker, writing, tail)


def styled(said: Sequence[Said], way: LineStyle, rng: Random) -> list[str]:
    """A line a frame."""
    lines = []
    for one in said:
        word = SPEAKERS[way.speaker][not one.sent].format(len(one.data))
        end = '"}' if way.speaker == "json" else TAILS[way.tail](one, rng)
        lines.append(f"{STAMPS[way.stamp](one.ms)}{word}{WRITINGS[way.writing](one.data)}{end}")
    return lines


def drawn(seed: int, which: str = "all") -> Drawn:
    """The text of a seed; of which half of the tables' rows."""
    rng = Random(f"second {which} {seed}")
    envelope = rng.choice(("rtu", "rtu", "rtu", "rtu", "rtu", "tcp"))
    way = style(rng, which)
    everyday = [rng.choice(half([*EVERYDAY], which)) for _ in range(rng.randrange(4))]
    damage = rng.choice(DAMAGES) if envelope == "rtu" else "none"
    said = damaged(conversation(rng, envelope), damage, rng)
    lines = []
    for line in styled(said, way, rng):
        lines.append(line)
        if everyday and rng.random() < 0.4:
            lines.append(EVERYDAY[rng.choice(everyday)](rng))
    if everyday:
        lines = [EVERYDAY[everyday[0]](rng), *lines, EVERYDAY[everyday[-1]](rng)]
    rows = (envelope, *way, "line", "none", damage, *everyday)
    return Drawn("\n".join(lines) + "\n", tuple(said), way.stamp not in UNTIMED, rows)
