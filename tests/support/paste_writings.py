"""Conversations as PLCs, keyboards and dump programs write them, and what mail and web pages put between the digits."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from textwrap import wrap
from typing import Final

from pastes import Message, Style, dump, lines_of, ox, shown, spaced, word

_ESCAPES: Final = {0: "\\0", 7: "\\a", 8: "\\b", 9: "\\t", 10: "\\n", 11: "\\v", 12: "\\f", 13: "\\r"}
_HAND_TYPED: Final = str.maketrans("ABCE", "АВСЕ")


def cell(byte: int) -> str:
    """A byte as `od -c` shows it."""
    return f"{_ESCAPES.get(byte, chr(byte) if 0x20 <= byte < 0x7F else f'{byte:03o}'):>4}"


def _of_all(form: Callable[[int, bytes], str], width: int = 16, end: str = "") -> Style:
    """A dump of a file with all of the bytes: a form of each row's offset and bytes, and of the length."""

    def style(log: Sequence[Message], rng: random.Random) -> str:
        data = b"".join(m.data for m in log)
        rows = [form(at, data[at : at + width]) for at in range(0, len(data), width)]
        return "\n".join([*rows, end.format(len(data))] if end else rows)

    return style


def _reversed_words(row: bytes) -> str:
    return " ".join(row[i : i + 4][::-1].hex() for i in range(0, len(row), 4))


def _parted(m: Message, sign: str) -> str:
    return sign.join(m.data.hex()[i : i + 8] for i in range(0, 2 * len(m.data), 8))


def _events(m: Message) -> list[str]:
    """What pymodbus tells of a frame."""
    head = f"2026-03-11 {m.clock.replace('.', ',')} DEBUG"
    if m.sent:
        return [f"{head} transaction:215 SEND: {ox(m.data)}", f"{head} client:72 New Transaction state 'SENDING'"]
    got, pdu = f"{head} transaction:292 RECV: {ox(m.data)}", f"{head} framer:180 Getting Frame - {ox(m.data[1:-2])}"
    return [got, pdu, f"{head} factory:266 Factory Response[ReadHoldingRegistersResponse: 3]"]


def _mailed(width: int, before: str) -> Style:
    """The events, broken where a mail's width ends."""

    def style(log: Sequence[Message], rng: random.Random) -> str:
        parts = [part for m in log for line in _events(m) for part in wrap(line, width, break_on_hyphens=False)]
        return "\n".join(before + part for part in parts)

    return style


def _octal(m: Message) -> str:
    return "".join(f"\\{b:03o}" for b in m.data)


def _char(byte: int) -> str:
    """A byte as gdb shows a char."""
    return chr(byte) if 0x20 <= byte < 0x7F and byte not in (0x27, 0x5C) else f"\\{byte:03o}"


WRITINGS: Final[dict[str, Style]] = {
    "h before": lines_of(lambda m: f"{word(m, 'SND', 'Reply')}: " + " ".join(f"h{b:02X}" for b in m.data)),
    "H before": lines_of(lambda m: f"{word(m, 'Query', 'Reply')}: " + ", ".join(f"H{b:02X}" for b in m.data)),
    "Verilog": lines_of(lambda m: f"{word(m, 'tx', 'rx')} = " + " ".join(f"8'h{b:02X}" for b in m.data)),
    "Cyrillic digits behind 0x": lines_of(lambda m: f"{word(m, 'запрос', 'ответ')}: " + " ".join(f"0х{b:02X}" for b in m.data).translate(_HAND_TYPED)),
    "Greek digits": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}: " + spaced(m.data).translate(str.maketrans("ABE", "ΑΒΕ"))),
    "soft hyphens": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}: {_parted(m, chr(0xAD))}"),
    "unseen within bytes": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}: " + " ".join(f"{b >> 4:X}\u200c{b & 15:X}" for b in m.data)),
    "check value as a number": lines_of(lambda m: f"{word(m, 'TX', 'RX')}: {spaced(m.data[:-2])} [CRC: {m.data[:-3:-1].hex().upper()}]"),
    "check value in halves": lines_of(lambda m: f"{word(m, 'TX', 'RX')}: {spaced(m.data[:-2])} CRCL={m.data[-2]:02X} CRCH={m.data[-1]:02X}"),
    "line numbers": lambda log, rng: "\n".join(f"{i:>5} {spaced(m.data)}" for i, m in enumerate(log, 97)),
    "xxd -c1": _of_all(lambda at, row: f"{at:08x}: {row.hex()}                   {shown(row)}", 1),
    "xxd -e": _of_all(lambda at, row: f"{at:08x}: {_reversed_words(row):<36}  {shown(row)}"),
    "od -t x1c": _of_all(lambda at, row: f"{at:07o}  {row.hex(' ').replace(' ', '  ')}\n       " + "".join(map(cell, row)), 16, "{:07o}"),
    "hexdump -c": _of_all(lambda at, row: f"{at:07x}" + "".join(map(cell, row)), 16, "{:07x}"),
    "od -An -tu1": _of_all(lambda at, row: "".join(f"{b:4d}" for b in row)),
    "Zabbix": lines_of(lambda m: f"  2311:20261121:{m.clock[:8].replace(':', '')}.{m.ms % 1000:03d} modbus: {word(m, 'sent', 'received')} {m.data.hex(' ')}"),
    "two clocks far apart": lines_of(lambda m: f"TRACE  | jvm 1    | 2026/11/21 {m.clock[:8]} | D [d.ModbusRtuDriver         ] [{m.clock.replace('.', ',')}]: {word(m, 'Tx', 'Rx')} {m.data.hex()}"),
    "entries, mailed": _mailed(64, ""),
    "entries, mailed and quoted": _mailed(70, "> "),
    "count in brackets": lines_of(lambda m: f"[{m.clock}] {word(m, '->', '<-')} [{len(m.data)}] {m.data.hex(' ')}"),
    "milliseconds before a mark": lines_of(lambda m: f"{m.ms + 1000} {word(m, 'TX:', 'RX:')} {m.data.hex(' ')}"),
    "milliseconds in a column": lines_of(lambda m: f"{m.ms + 1000} | {word(m, 'TX', 'RX')} | {m.data.hex(' ')}"),
    "Chr in Basic": lines_of(lambda m: f"{word(m, 'tx', 'rx')} = " + " & ".join(f"Chr(&H{b:02X})" for b in m.data)),
    "escapes in Perl": lines_of(lambda m: f'my ${word(m, "tx", "rx")} = "' + "".join(f"\\x{{{b:02x}}}" for b in m.data) + '";'),
    "Modbus Slave with times": lambda log, rng: "\n".join(f"{word(m, 'Tx', 'Rx')}:{i:06d}-{m.clock}-{spaced(m.data)}" for i, m in enumerate(log)),
    "milliseconds before a name": lines_of(lambda m: f"[{m.ms:>8}] {word(m, 'MB_TX', 'MB_RX')}({len(m.data)}): {m.data.hex(' ')}"),
    "Cyrillic digits between dashes": lines_of(lambda m: f"{word(m, 'отправил', 'принял')} " + spaced(m.data).replace(" ", "-").translate(_HAND_TYPED)),
    "gdb's chars": lines_of(lambda m: f"{word(m, 'tx', 'rx')} = {{" + ", ".join(f"{b} '{_char(b)}'" for b in m.data) + "}"),
    "decimals and hex in brackets": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')} " + " ".join(f"{b}({b:02X})" for b in m.data)),
    "elements by index": lines_of(lambda m: f"{word(m, 'tx', 'rx')} " + " ".join(f"b[{i}]=0x{b:02x}" for i, b in enumerate(m.data))),
    "offsets of two digits": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}\n" + "\n".join(f"[{i:02X}] {spaced(m.data[i : i + 8])}" for i in range(0, len(m.data), 8))),
    "turns without line breaks": lambda log, rng: " ".join(f"{m.clock} {word(m, 'TX', 'RX')}: {spaced(m.data)}" for m in log),
    "two turns a line": lambda log, rng: "\n".join(f"{a.clock} > {spaced(a.data)} | {b.clock} < {spaced(b.data)}" for a, b in zip(log[::2], log[1::2], strict=True)),
    "strace with dumps": lines_of(lambda m: f'{word(m, "write", "read")}(3, "{_octal(m)}", {len(m.data)}) = {len(m.data)}\n' + dump(m.data, lambda at, row: f" | {at:05x}  {row[:8].hex(' '):<23}  {row[8:].hex(' '):<23}  {shown(row):<16} |")),
}  # fmt: skip
