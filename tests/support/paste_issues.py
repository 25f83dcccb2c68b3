"""Conversations as they stand in issue threads, manuals and tests of firmware, and what people write around them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Final

from pastes import Message, Style, dump, lines_of, ox, shown, spaced, word


def _gate(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    """A test's own report, which says the newest answer once more."""
    out = ["[GATE3] STEP 1: UART + RS485 init (Slave=5, Baud=4800, Parity=NONE)"]
    for m in log:
        out.append(f"[GATE3] {word(m, 'TX', 'RX')} ({len(m.data)} bytes): {spaced(m.data)}")
    return "\n".join([*out, f"[GATE3]   Response Len  : {len(log[-1].data)} bytes", "[GATE3] PASS"])


def _pieces(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    """pymodbus 3.6 under a slow line: each piece is said twice, and the PDU at the end."""
    out = []
    for m in log:
        if m.sent:
            out.append("send: " + " ".join(f"0x{b:x}" for b in m.data))
            continue
        for part in (m.data[:4], m.data[4:]):
            text = " ".join(f"0x{b:x}" for b in part)
            out += [f"recv: {text}", f"Processing: {text}", "Frame - not ready"]
        out[-1:] = ["Getting Frame - " + " ".join(f"0x{b:x}" for b in m.data[1:-2]), "Factory Response[x': 3]"]
    return "\n".join(out)


def _one_line(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    """What Home Assistant shows of pymodbus' newest events: all in one line, with what it held before said again."""
    out = ["ERROR: No response received after 3 retries, continue with next request"]
    for m in log:
        if m.sent:
            out.append(f">>>>> send: {ox(m.data)}")
            continue
        first, rest = ox(m.data[:4]), ox(m.data[4:])
        out += [f">>>>> recv: {first} extra data:", f">>>>> extra: unexpected data: {first}"]
        out.append(f">>>>> recv: {rest} extra data: {first}")
    return " ".join(out)


def _wrote_bits(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    return "\n".join(
        f"[07:31:00][VV][uart_esp8266:{word(m, '111', '132')}]:     {word(m, 'Wrote', 'Read')} 0b{b:08b} (0x{b:02X})"
        for m in log
        for b in m.data
    )


def _zephyr(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    out = []
    for m in log:
        out.append(f"[00:00:{m.clock[6:]},678] <dbg> modbus_serial: modbus_rtu_{word(m, 'tx', 'rx')}_adu: adu")
        out.append(dump(m.data, lambda at, row: f"{'':40}{row.hex(' '):<47} |{shown(row)}"))
    return "\n".join(out)


def _escaped(data: bytes) -> str:
    return "".join(f"\\x{b:02X}" for b in data)


def _pairs(form: str) -> Style:
    """A line for a request with its answer."""
    return lambda log, rng: "\n".join(
        form.format(a=spaced(a.data), b=spaced(b.data)) for a, b in zip(log[::2], log[1::2], strict=True)
    )


def _usbmon(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    """What Linux tells of an FTDI adapter's transfers, its two status bytes before all that it heard."""
    out = []
    for i, m in enumerate(log):
        head, us = f"ffff9a0f1c2d{i:02x}00", 3_575_000_000 + 1000 * m.ms
        if m.sent:
            out.append(f"{head} {us} S Bo:1:004:2 -115 {len(m.data)} = {m.data.hex(' ', -4)}")
            out.append(f"{head} {us + 120} C Bo:1:004:2 0 {len(m.data)} >")
            out.append(f"{head} {us + 130} S Bi:1:004:1 -115 512 <")
        else:
            heard = b"\x01\x60" + m.data
            out.append(f"{head} {us - 900} C Bi:1:004:1 0 2 = 0160")
            out.append(f"{head} {us} C Bi:1:004:1 0 {len(heard)} = {heard.hex(' ', -4)}")
    return "\n".join(out)


def _cyrillic(data: bytes) -> str:
    return data.hex().upper().translate(str.maketrans("ABCE", "АВСЕ"))


def _hal(log: Sequence[Message], rng: object) -> str:  # noqa: ARG001
    """What is heard comes in two calls."""
    out = []
    for m in log:
        if m.sent:
            out.append(f"        HAL_UART_Transmit(USART2, req, {len(m.data)}, 100) 线上: {spaced(m.data)}")
            continue
        out.append(f"        HAL_UART_Receive(USART2, rsp, 3, 200)  收到: {spaced(m.data[:3])}")
        out.append(f"        HAL_UART_Receive(USART2, rsp+3, {len(m.data) - 3}, 200) 收到: {spaced(m.data[3:])}")
    return "\n".join(out)


ISSUES: Final[dict[str, Style]] = {
    "test report": _gate,
    "pymodbus in pieces": _pieces,
    "ESPHome bits": _wrote_bits,
    "ESPHome bits glued": lambda log, rng: _wrote_bits(log, rng).replace("\n", ""),
    "Zephyr adu": _zephyr,
    "HAL calls": _hal,
    "pymodbus in one line": _one_line,
    "count in brackets": lines_of(lambda m: f"{m.clock} COM1 {word(m, 'TX', 'RX')} [{len(m.data)}] : {m.data.hex('.').upper()}"),
    "count in parentheses": lines_of(lambda m: f"{word(m, 'TX', 'RX')} ({len(m.data)}): {m.data.hex('-').upper()}"),
    "usbmon": _usbmon,
    "Cyrillic digits in one word": lines_of(lambda m: f"{word(m, 'Запрос', 'Ответ')}: {_cyrillic(m.data)}"),
    "addresses of networks beside": lines_of(lambda m: f"I ({m.ms}) radio: Send to ac:a7:04:f4:03:ec {word(m, 'failed', 'done')}\nI ({m.ms}) MODBUS_{word(m, 'TX', 'RX')}: {m.data.hex(' ')}"),
    "ModScan in one line": lambda log, rng: "".join(f"[{b:02x}]" if m.sent else f"<{b:02x}>" for m in log for b in m.data),
    "test script": _pairs('[[test]]\nname = "step"\nsend = "{a}"\nexpect = "{b}"\n'),
    "doxygen": _pairs("/// @brief  step\n/// send: {a}\n/// response: {b}\n/// value is 0x0000 means no fault"),
    "tree items": _pairs('    item->setText(0,"x");\n    item->setText(1,"{a}");\n    item->setText(2,"{b}");'),
    "bridge": lines_of(lambda m: f"[16:40:36.{m.ms % 1000:03d}][D][modbus_bridge:695]: RTU {word(m, 'send: ', f'recv (stable 2 polls, {len(m.data)} bytes): ')}{spaced(m.data)}" + word(m, "  client_id=1", " ")),
    "Tasmota debug": lines_of(lambda m: f"   {m.clock} MBS: Serial {word(m, 'Send', 'Received')}: {spaced(m.data)}"),
    "ticks in brackets": lines_of(lambda m: f"[{m.ms}] [INFO] Modbus {word(m, 'TX', 'RX')} ({len(m.data)} bytes): {spaced(m.data)}"),
    "ESP-NOW": lines_of(lambda m: f"I ({m.ms}) {word(m, 'ESPNOW_RX', 'MODBUS_RX')}: {m.data.hex(' ')}                # from {word(m, 'Master', 'Sensor')}"),
    "modbus-cli": lines_of(lambda m: f"{word(m, '→', '←')} < {m.data.hex(' ')} > {len(m.data)} bytes"),
    "divs": lines_of(lambda m: f"<div style={{{{ color: '#4ADE80', padding: 14 }}}}>[{word(m, 'TX', 'RX')}] {spaced(m.data)} (Read Station)</div>"),
    "measured": lambda log, rng: "    tempo dir   tam crc      bytes\n" + "\n".join(f"  {m.ms / 1000:8.4f} {word(m, 'REQ', 'RSP')} {len(m.data):4d}B crc:ok   {spaced(m.data)}      L{len(m.data)}:01-03" for m in log),
    "recorded": lambda log, rng: "\n".join(f"RESPONSES['{_escaped(a.data)}'] = '{_escaped(b.data)}'" for a, b in zip(log[::2], log[1::2], strict=True)),
    "loose fields": lines_of(lambda m: f"{word(m, 'master sends', 'slave answers')}: {m.data[:2].hex(' ')}  {m.data[2:-2].hex().upper()}   {m.data[-2:].hex(' ')}"),
    "JSON tests": lines_of(lambda m: f"  {word(m, 'request', 'responseChunks')}: {json.dumps(list(m.data) if m.sent else [list(m.data)])},"),
}  # fmt: skip
