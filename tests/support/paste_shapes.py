"""Shapes of pasted text that taught the readers something: what stands beside bytes and is none, and bytes in disguise."""

from __future__ import annotations

import base64
import json
from typing import Final

from pastes import Style, dump, lines_of, ox, shown, spaced, word

_RULER: Final = "00 01 02 03 04 05 06 07 08 09 0A 0B 0C 0D 0E 0F"


def _rows(count: int, form: str, between: str) -> Style:
    """An array over several lines."""
    return lines_of(
        lambda m: between.join(
            ", ".join(form.format(b) for b in m.data[at : at + count]) for at in range(0, len(m.data), count)
        ).join(("array([", "], dtype=uint8)"))
    )


SHAPES: Final[dict[str, Style]] = {
    "PulseView": lines_of(lambda m: "\n".join(f"{m.ms * 1000 + i * 1146}-{m.ms * 1000 + i * 1146 + 1040} UART: {word(m, 'TX', 'RX')} data: {b:02X}" for i, b in enumerate(m.data))),
    "0b": lines_of(lambda m: ", ".join(f"0b{b:08b}" for b in m.data)),
    "xxd -b": lines_of(lambda m: "\n".join(f"{at:08x}: {' '.join(f'{b:08b}' for b in m.data[at : at + 6]):<53}  {shown(m.data[at : at + 6])}" for at in range(0, len(m.data), 6))),
    "MATLAB": lines_of(lambda m: f"{word(m, 'tx', 'rx')} =\n\n  1×{len(m.data)} uint8 row vector\n\n" + "".join(f"{b:6d}" for b in m.data) + "\n"),
    "numpy rows": _rows(8, "{:3d}", ",\n       "),
    "C rows": _rows(8, "0x{:02x}", ",\n    "),
    "PowerShell": lines_of(lambda m: f"\n           {_RULER}\n\n" + dump(m.data, lambda at, row: f"{at:08X}   {row.hex(' ').upper():<47}  {shown(row)}")),
    "HxD": lines_of(lambda m: f"Offset(h) {_RULER}\n\n" + dump(m.data, lambda at, row: f"{at:08X}  {row.hex(' ').upper():<47}  {shown(row)}")),
    "radare": lines_of(lambda m: "- offset -   0 1  2 3  4 5  6 7  8 9  A B  C D  E F  0123456789ABCDEF\n" + dump(m.data, lambda at, row: f"0x{at:08x}  {row.hex(' ', -2):<39}  {shown(row)}")),
    "short offsets": lines_of(lambda m: "\n".join(f"{at:03X}: {spaced(m.data[at : at + 8])}" for at in range(0, len(m.data), 8))),
    "dump with its length": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:08x}  {row[:8].hex(' '):<23}  {row[8:].hex(' '):<23}  |{shown(row)}|") + f"\n{len(m.data):08x}\n"),
    "count before": lines_of(lambda m: f"{m.clock} {word(m, 'Serial OUT', 'Serial IN')} {len(m.data)} {spaced(m.data)}"),
    "fields apart": lines_of(lambda m: f"{word(m, 'TX', 'RX')} | ID {m.data[0]:02X} | FC {m.data[1]:02X} | {spaced(m.data[2:-2])} | CRC {spaced(m.data[-2:])}"),
    "indices": lines_of(lambda m: f"{word(m, 'TX', 'RX')} " + " ".join(f"[{i}]={b:02X}" for i, b in enumerate(m.data))),
    "indices 0x": lines_of(lambda m: f"{word(m, 'TX', 'RX')} " + " ".join(f"{i}:0x{b:02X}" for i, b in enumerate(m.data))),
    "Python prompt": lines_of(lambda m: word(m, f">>> ser.write(bytes.fromhex('{m.data.hex()}'))\n{len(m.data)}", f">>> ser.read(100).hex()\n'{m.data.hex()}'")),
    "JSON with epoch": lines_of(lambda m: json.dumps({"ts": 1700000000000 + m.ms, "dir": word(m, "tx", "rx"), "data": m.data.hex()})),
    "InfluxDB": lines_of(lambda m: f'rs485,dir={word(m, "tx", "rx")} frame="{m.data.hex()}" {1700000000000000000 + m.ms * 10**6}'),
    "base64 in JSON": lines_of(lambda m: json.dumps({"topic": f"rs485/{word(m, 'tx', 'rx')}", "data": base64.b64encode(m.data).decode()})),
    "columns of a table": lambda log, rng: "request,response\n" + "\n".join(f"{a.data.hex()},{b.data.hex()}" for a, b in zip(log[::2], log[1::2], strict=True)),
    "station named": lambda log, rng: "波特率9600，8位数据位，1位停止位，无校验，从机地址01\n" + "\n".join(f"{word(m, '上位机发送', '下位机返回')}：{spaced(m.data)}" for m in log),
    "wrapped at 40": lines_of(lambda m: "\n".join(f"[{m.clock}] {word(m, 'TX', 'RX')}: {spaced(m.data)}"[at : at + 40] for at in range(0, len(f"[{m.clock}] TX: {spaced(m.data)}"), 40))),
    "values beneath": lines_of(lambda m: f"{m.clock} {word(m, 'TX', 'RX')}: {ox(m.data)}\n    unit={m.data[0]} fc={m.data[1]} crc={m.data[-2]:02X}{m.data[-1]:02X} OK"),
    "arrow between names": lines_of(lambda m: f"{word(m, 'PC->Device', 'Device->PC')}: {spaced(m.data)}"),
    "Device Monitoring Studio": lambda log, rng: "\n".join(f"{i:06d}: {word(m, 'Write Request (DOWN)', 'Read Request (UP)')}, 21.11.2026 {m.clock}0000 +0.0\n\n" + dump(m.data, lambda at, row: f" {row.hex(' ')}   {shown(row)}") + "\n" for i, m in enumerate(log)),
    "check value apart": lines_of(lambda m: f"{word(m, '[TX]', '[RX]')} {m.data[:-2].hex()} {spaced(m.data[-2:])}"),
    "words that begin as bytes": lines_of(lambda m: f"{word(m, 'sent', 'got')} {m.data.hex()} after {m.ms % 90 + 2} ms"),
    "all in one line": lambda log, rng: ", ".join(spaced(m.data) for m in log),
    "hex, then decimal": lines_of(lambda m: f"{word(m, 'TX', 'RX')} HEX: {spaced(m.data)}\n{word(m, 'TX', 'RX')} DEC: {' '.join(map(str, m.data))}"),
}  # fmt: skip
