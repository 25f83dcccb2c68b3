"""Conversations as manuals, web logs, oscilloscopes and chats write them: fields by lines, escapes, clocks of all kinds."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Final

from pastes import Message, Style, dump, lines_of, shown, spaced, word


def _parts(message: Message) -> list[tuple[str, bytes]]:
    """The fields of a frame, as a manual names them."""
    body = message.data[2:-2]
    fields = [("Slave address", message.data[:1]), ("Function code", message.data[1:2])]
    if message.data[1] & 0x80:
        fields.append(("Exception code", body))
    elif message.sent or message.data[1] in (5, 6, 15, 16):
        fields += [("Starting address", body[:2]), ("Quantity", body[2:4])]
        fields += [("Byte count", body[4:5]), ("Data", body[5:])] if body[4:] else []
    else:
        fields += [("Byte count", body[:1]), ("Data", body[1:])]
    return [*fields, ("CRC", message.data[-2:])]


def _fields(form: Callable[[str, bytes], str], head: Callable[[Message], str], between: str = "\n") -> Style:
    """A heading, and a line a field."""
    return lambda log, rng: "\n\n".join(
        head(m) + between + "\n".join(form(name, value) for name, value in _parts(m)) for m in log
    )


def _two_reads(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    """What comes in comes in pieces, under a word without a sign."""
    out = []
    for message in log:
        cut = len(message.data) if message.sent else 4
        out += [f"{message.clock} {word(message, 'OUT', 'IN ')} {spaced(message.data[:cut])}"]
        out += [f"{message.clock} IN  {spaced(message.data[cut:])}"] if message.data[cut:] else []
    return "\n".join(out)


def _od_characters(message: Message) -> str:
    names = {0: "\\0", 7: "\\a", 8: "\\b", 9: "\\t", 10: "\\n", 11: "\\v", 12: "\\f", 13: "\\r"}
    cells = [f"{names.get(b) or (chr(b) if 0x20 <= b < 0x7F else f'{b:03o}'):>4}" for b in message.data]
    rows = [f"{at:07o}" + "".join(cells[at : at + 16]) for at in range(0, len(cells), 16)]
    return "\n".join([*rows, f"{len(cells):07o}"])


def _packets(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    out = ["No.     Time           Source                Destination           Protocol Length Info"]
    for i, message in enumerate(log, 1):
        ends = "192.168.1.10          192.168.1.20", "192.168.1.20          192.168.1.10"
        out += [
            f"{i:7d} {message.ms / 1000:.6f}    {word(message, *ends)}          TCP      {54 + len(message.data)}     Data",
            "",
        ]
        out += [
            dump(message.data, lambda at, row: f"{at:04x}  {row[:8].hex(' ')}  {row[8:].hex(' '):<24} {shown(row)}"),
            "",
        ]
    return "\n".join(out)  # fmt: skip


def _vertical(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    octets = [(m.ms + 1.04 * i, b) for m in log for i, b in enumerate(m.data)]
    return "Packet\tTime\tData\tError\n" + "\n".join(
        f"{k}\t{t:.3f} ms\t{b:02X}h\t" for k, (t, b) in enumerate(octets, 1)
    )


POSTS: Final[dict[str, Style]] = {
    "fields a line": _fields(lambda n, v: f"{n}: {spaced(v)}", lambda m: word(m, "Request", "Response")),
    "fields a line 0x": _fields(lambda n, v: f"{n} = {' '.join(f'0x{b:02X}' for b in v)}", lambda m: word(m, "Request", "Response")),
    "fields in a table": _fields(lambda n, v: f"| {n} | {spaced(v)} |", lambda m: word(m, "Request", "Response") + ":", "\n\n| Field | Value |\n|---|---|\n"),
    "fields in a list": _fields(lambda n, v: f"- {spaced(v)} ({n})", lambda m: word(m, "Request", "Response") + ":"),
    "Russian fields": _fields(lambda n, v: f"{spaced(v)} – {n}", lambda m: word(m, "Запрос:", "Ответ:")),
    "frame, then its fields": _fields(lambda n, v: f"  {spaced(v)} - {n}", lambda m: word(m, "Request: ", "Response: ") + spaced(m.data)),
    "frame, then its fields 0x": _fields(lambda n, v: f"  {n}: 0x{v.hex()}", lambda m: word(m, "TX ", "RX ") + m.data.hex()),
    "escapes in JSON": lines_of(lambda m: json.dumps({"log": f"[modbus] {word(m, 'TX', 'RX')}\t{spaced(m.data)}\r\n", "stream": "stdout", "time": f"2026-11-21T{m.clock}123456Z"})),
    "quotes in JSON": lines_of(lambda m: json.dumps({"msg": f'frame "{m.data.hex()}" {word(m, "sent", "received")}', "lvl": "D"})),
    "comma seconds": lambda log, rng: "Zeit [s];Richtung;Daten;Wert\n" + "\n".join(f'{str(m.ms / 1000).replace(".", ",")};{word(m, "TX", "RX")};"{spaced(m.data)}";"230,4 V"' for m in log),
    "quoted seconds": lines_of(lambda m: f'"{m.ms / 1000:.3f}","{word(m, "OUT", "IN")}",' + ",".join(f'"{b:02X}"' for b in m.data)),
    "minutes": lines_of(lambda m: f"{m.clock[3:]} {word(m, 'TX', 'RX')} {spaced(m.data)}"),
    "plus ms": lines_of(lambda m: f"+{m.ms} ms {word(m, 'TX', 'RX')}: {spaced(m.data)}"),
    "two clocks": lines_of(lambda m: f"INFO   | jvm 1    | 2026/11/21 {m.clock[:8]} | D [ModbusTransport] [{m.clock}]: {word(m, 'TX', 'RX')}: {m.data.hex()}"),
    "list of packets": _packets,
    "tshark fields": lambda log, rng: "\n".join(f"{i}\t{m.ms / 1000:.9f}\t{m.data.hex(':')}" for i, m in enumerate(log, 1)),
    "who to whom": lines_of(lambda m: f"{word(m, 'Master -> Slave', 'Slave -> Master')}: {spaced(m.data)}"),
    "devices by arrows": lines_of(lambda m: f"{word(m, 'PC→PLC', 'PLC→PC')} : “ {spaced(m.data)} ”"),
    "reads in pieces": _two_reads,
    "od -c": lines_of(_od_characters),
    "vertical": _vertical,
    "web command": lines_of(lambda m: f"http://192.168.4.1/cm?cmnd=SerialSend5%20{m.data.hex().upper()}"),
    "Kotlin array": lines_of(lambda m: f"val {word(m, 'tx', 'rx')} = byteArrayOf(" + ", ".join(f"0x{b:02x}" + (".toByte()" if b > 0x7F else "") for b in m.data) + ")"),
    "Rust casts": lines_of(lambda m: f"let {word(m, 'tx', 'rx')} = vec![" + ", ".join(f"0x{b:02x} as u8" for b in m.data) + "];"),
    "sketch and its output": lambda log, rng: "#define RE 8\nSoftwareSerial mod(2, 3); // RX, TX\nvoid setup() { Serial.begin(9600); delay(1000); }\n" + "\n".join(f"const byte {word(m, 'query', 'expected')}{i}[] = {{{', '.join(f'0x{b:02X}' for b in m.data)}}};" for i, m in enumerate(log)) + "\nbyte values[11];\nNitrogen: 255 mg/kg",
    "status codes beside": lines_of(lambda m: f"{m.clock} 0x{m.ms % 65536:04X} [{word(m, 'TX', 'RX')}] {spaced(m.data)} rc=0x00 st=0x{m.ms % 256:02X}"),
    "MQTT decimals": lines_of(lambda m: f"2026-11-21T{m.clock}+0100 gw/{word(m, 'tx', 'rx')} {json.dumps({'data': list(m.data), 'v': -1.5})}"),
    "chat": lines_of(lambda m: f"{word(m, 'Alexey P', 'Dmitry (SCADA)')}, [21.11.2026 {m.clock[:5]}]\n{word(m, 'шлю ', 'пришло ')}{m.data.hex().upper()}\n"),
    "Tasmota console": lines_of(lambda m: word(m, f"{m.clock} CMD: SerialSend5 {m.data.hex().upper()}", f'{m.clock} RSL: RESULT = {{"SerialReceived":"{m.data.hex().upper()}"}}')),
    "scope lister": lambda log, rng: "Time,Tx,Rx,Error\n" + "\n".join(f"{m.ms / 1000 + i * 0.00104:.5E}," + word(m, f"{b:02X},", f",{b:02X}") + "," for m in log for i, b in enumerate(m.data)),
}  # fmt: skip
