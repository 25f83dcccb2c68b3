"""Conversations as they stand in forum posts, support mails and the logs of tools that the other shapes do not have."""

from __future__ import annotations

import base64
import json
import random
import re
from collections.abc import Callable, Sequence
from typing import Final

from pastes import Message, Style, dump, lines_of, ox, shown, spaced, word

_CONTROLS: Final = [
    "NUL",
    "SOH",
    "STX",
    "ETX",
    "EOT",
    "ENQ",
    "ACK",
    "BEL",
    "BS",
    "HT",
    "LF",
    "VT",
    "FF",
    "CR",
    "SO",
    "SI",
    "DLE",
    "DC1",
    "DC2",
    "DC3",
    "DC4",
    "NAK",
    "SYN",
    "ETB",
    "CAN",
    "EM",
    "SUB",
    "ESC",
    "FS",
    "GS",
    "RS",
    "US",
]
_PARTS: Final = ("slave", "function", "start hi", "start lo", "count hi", "count lo", "CRC lo", "CRC hi")


def _each(
    form: Callable[[int, int], str], between: str = "\n", head: str = "", tail: str = ""
) -> Callable[[Message], str]:
    """Of a message: each byte with its number, in a form."""
    return lambda m: head + between.join(form(i, b) for i, b in enumerate(m.data)) + tail


def _after(sent: str, received: str, form: Callable[[Message], str]) -> Style:
    return lines_of(lambda m: word(m, sent, received) + form(m))


def _wrapped_at(columns: int) -> Style:
    """One stream of bytes, broken where the window ends, even within a byte's blank."""

    def style(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
        text = " ".join(spaced(m.data) for m in log)
        return "\n".join(text[at : at + columns].rstrip() for at in range(0, len(text), columns))

    return style


def _named(byte: int) -> str:
    return (
        f"<{_CONTROLS[byte]}>"
        if byte < 32
        else chr(byte)
        if 0x20 < byte < 0x7F and chr(byte) not in "<>"
        else f"<{byte:02X}>"
    )


def _labview(byte: int) -> str:
    simple = {8: "\\b", 10: "\\n", 13: "\\r", 9: "\\t", 12: "\\f", 32: "\\s", 92: "\\\\"}
    return simple.get(byte) or (chr(byte) if 0x20 < byte < 0x7F else f"\\{byte:02X}")


def _ruby(data: bytes) -> str:
    simple = {
        7: "\\a",
        8: "\\b",
        9: "\\t",
        10: "\\n",
        11: "\\v",
        12: "\\f",
        13: "\\r",
        27: "\\e",
        34: '\\"',
        92: "\\\\",
        35: "\\#",
    }
    return "".join(simple.get(b) or (chr(b) if 0x20 <= b < 0x7F else f"\\x{b:02X}") for b in data)


def _haskell(data: bytes) -> str:
    text = "".join(f"\\{b}\0" if not 0x20 <= b < 0x7F else "\\" * (b == 92) + chr(b) for b in data)
    return re.sub("\0(?=[0-9])", r"\\&", text).replace("\0", "")


def _saleae(byte: int) -> str:
    simple = {0: "\\0", 9: "\\t", 10: "\\n", 13: "\\r", 32: "' '", 44: "COMMA"}
    char = simple.get(byte) or (chr(byte) if 0x20 < byte < 0x7F else repr(str(byte)))
    return f"{char} (0x{byte:02X})"


def _u1(row: bytes) -> str:
    return "".join(f" {b:3d}" for b in row)


def _od_u1(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    return "\n".join(f"{dump(m.data, lambda at, row: f'{at:07o}{_u1(row)}')}\n{len(m.data):07o}" for m in log)


def _timed_bytes(form: str) -> Style:
    def style(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
        out = []
        for m in log:
            for i, b in enumerate(m.data):
                us = m.ms * 1000 + i * 1146
                out.append(form.format(s=us / 1e6, us=us, b=b, ch=_saleae(b), word=word(m, "TX", "RX"), clock=m.clock))
        return "\n".join(out)

    return style


def _csv_headed(header: str, form: str) -> Style:
    inner = _timed_bytes(form)
    return lambda log, rng: header + "\n" + inner(log, rng)


def _in_prose(forms: tuple[str, str], first: str) -> Style:
    return lambda log, rng: (
        first
        + "\n"
        + "\n".join(word(m, *forms).format(hex=spaced(m.data), low=m.data.hex(" "), n=len(m.data)) for m in log)
    )


def _annotated(m: Message) -> str:
    if len(m.data) != len(_PARTS):
        return f"{word(m, 'TX', 'RX')}: {spaced(m.data)}"
    d = m.data
    return f"{d[0]:02X} (slave address) {d[1]:02X} (function) {spaced(d[2:4])} (register) {spaced(d[4:6])} (data) {spaced(d[6:])} (CRC)"


def _node_rows(m: Message) -> str:
    body = [f"{b:3d}" for b in m.data]
    rows = ",\n  ".join(", ".join(body[at : at + 12]) for at in range(0, len(body), 12))
    return f"{word(m, 'tx', 'rx')} Uint8Array({len(body)}) [\n  {rows}\n]"


def _cyrillic(text: str) -> str:
    return text.translate(str.maketrans("ABCE", "АВСЕ"))


def _field_table(m: Message) -> str:
    head = f"### {word(m, 'Request', 'Response')}\n\n| Byte | Value |\n|---|---|\n"
    return head + "\n".join(f"| {i} | 0x{b:02X} |" for i, b in enumerate(m.data)) + "\n"


FORUMS: Final[dict[str, Style]] = {
    "od -t u1": _od_u1,
    "od -An -t u1": lines_of(lambda m: dump(m.data, lambda at, row: _u1(row))),
    "od -An -t x1": lines_of(lambda m: dump(m.data, lambda at, row: " " + row.hex(" "))),
    "od -t x1z": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:07o} {row.hex(' '):<47}  >{shown(row)}<") + f"\n{len(m.data):07o}"),
    "od -A x -t x1": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:06x} {row.hex(' ')}") + f"\n{len(m.data):06x}"),
    "quoted plain": lines_of(lambda m: f'"{spaced(m.data)}"'),
    "quoted marks": lines_of(lambda m: f'{word(m, "TX", "RX")} "{m.data.hex()}"'),
    "base64 plain": lines_of(lambda m: base64.b64encode(m.data).decode()),
    "base64 word": lines_of(lambda m: f"{word(m, 'uplink', 'downlink')} {base64.b64encode(m.data).decode()}"),
    "base64 LoRa": lines_of(lambda m: json.dumps({"devEUI": "a84041ffff1820f3", "fPort": 2, "frm_payload": base64.b64encode(m.data).decode(), "rssi": -97})),
    "Siemens watch": _after("//", "//", _each(lambda i, b: f'"Modbus_DB".Buffer[{i}]\tHex\t16#{b:02X}', head="\n")),
    "Siemens watch bytes": lines_of(_each(lambda i, b: f"P_DB.rcv[{i}]   Byte   B#16#{b:02X}   ")),
    "Siemens DB table": lines_of(_each(lambda i, b: f"DBB {i}\tBYTE\tB#16#0\tB#16#{b:X}")),
    "TIA decimal watch": lines_of(_each(lambda i, b: f'"data".tx[{i}]\tDEC\t{b}')),
    "CODESYS watch": lines_of(_each(lambda i, b: f"  abyBuffer[{i}]\tBYTE\t{b}")),
    "CODESYS hex watch": lines_of(_each(lambda i, b: f"GVL.aRx[{i}]  BYTE  16#{b:02X}")),
    "CODESYS array": lines_of(lambda m: f"{word(m, 'aTx', 'aRx')} : ARRAY[0..{len(m.data) - 1}] OF BYTE := [{', '.join(f'16#{b:02X}' for b in m.data)}];"),
    "CODESYS decimals": lines_of(lambda m: f"{word(m, 'aTx', 'aRx')} : ARRAY[0..{len(m.data) - 1}] OF BYTE := [{', '.join(map(str, m.data))}];"),
    "BYTE#16#": lines_of(lambda m: f"{word(m, 'send', 'recv')}: " + ", ".join(f"BYTE#16#{b:02X}" for b in m.data)),
    "Rockwell string": lines_of(lambda m: f"{word(m, 'TX', 'RX')}_String.DATA '" + "".join(f"${b:02X}" for b in m.data) + "'"),
    "Delphi string": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')} := " + "".join(f"#${b:02X}" for b in m.data) + ";"),
    "Delphi decimals": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')} := " + "".join(f"#{b}" for b in m.data) + ";"),
    "LabVIEW codes": lines_of(lambda m: f"{word(m, 'VISA Write', 'VISA Read')}: " + "".join(map(_labview, m.data))),
    "LabVIEW hex": lines_of(lambda m: f"{word(m, 'write buffer', 'read buffer')}  " + " ".join(m.data[i : i + 2].hex().upper() for i in range(0, len(m.data), 2))),
    "Ruby": lines_of(lambda m: f'{word(m, "Tx", "Rx")} ({len(m.data)} bytes): "{_ruby(m.data)}"'),
    "rmodbus": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')} ({len(m.data)} bytes): " + "".join(f"[{b:02x}]" for b in m.data)),
    "PHP dump": _after("request ", "response ", lambda m: f"array({len(m.data)}) {{\n" + "\n".join(f"  [{i}]=>\n  int({b})" for i, b in enumerate(m.data, 1)) + "\n}"),
    "PHP print_r": _after("request ", "response ", lambda m: "Array\n(\n" + "\n".join(f"    [{i}] => {b}" for i, b in enumerate(m.data)) + "\n)\n"),
    "Uint8Array": lines_of(lambda m: f"{word(m, 'tx', 'rx')} Uint8Array({len(m.data)}) [{', '.join(map(str, m.data))}]"),
    "Uint8Array rows": lines_of(_node_rows),
    "JSON of Uint8Array": lines_of(lambda m: f"{word(m, 'send', 'data')} " + json.dumps({str(i): b for i, b in enumerate(m.data)}, separators=(",", ":"))),
    "Node-RED": lines_of(lambda m: f"{m.clock[:8]}node: debug {word(m, 1, 2)}\nmsg.payload : buffer[{len(m.data)}]\n[ {', '.join(f'0x{b:x}' for b in m.data)} ]"),
    "Node-RED decimals": lines_of(lambda m: f"{m.clock[:8]}node: debug {word(m, 1, 2)}\nmsg.payload : array[{len(m.data)}]\n[ {', '.join(map(str, m.data))} ]"),
    "Node-RED tree": lines_of(lambda m: f"msg.payload : buffer[{len(m.data)}]\n" + "\n".join(f"{i}: 0x{b:x}" for i, b in enumerate(m.data))),
    "Node-RED decimal tree": lines_of(lambda m: f"msg.payload : array[{len(m.data)}]\n" + "\n".join(f"{i}: {b}" for i, b in enumerate(m.data))),
    "python single reads": lines_of(lambda m: f"{word(m, 'write', 'read')} [{', '.join(repr(bytes((b,))) for b in m.data)}]"),
    "python read(1)": lines_of(_each(lambda i, b: repr(bytes((b,))))),
    "python int list tuple": lines_of(lambda m: f"('{word(m, 'tx', 'rx')}', {tuple(m.data)})"),
    "python map hex": lines_of(lambda m: f"{word(m, 'tx', 'rx')} {':'.join(f'{b:02x}' for b in m.data)}"),
    "python struct.pack": lines_of(lambda m: f"DEBUG:root:{word(m, 'sending', 'received')} {m.data!r} len={len(m.data)}"),
    "logging hexlify": lines_of(lambda m: f"INFO:__main__:{word(m, 'TX', 'RX')} {m.data.hex().encode()!r}"),
    "Home Assistant": lines_of(lambda m: f"2026-04-02 {m.clock} DEBUG (SyncWorker_{len(m.data) % 7}) [pymodbus.logging] {word(m, 'SEND', 'RECV')}: {ox(m.data)}"),
    "minimalmodbus 2": lines_of(lambda m: f"MinimalModbus debug mode. {word(m, 'Will write to instrument (expecting 7 bytes back)', 'Response from instrument')}: {spaced(m.data)} ({len(m.data)} bytes)" + word(m, "", f", roundtrip time: {m.ms % 50 + 0.3:.1f} ms. Timeout for reading: 50.0 ms.")),
    "ESPHome string": lines_of(lambda m: f'[{m.clock[:8]}][D][uart_debug:158]: {word(m, ">>>", "<<<")} "{_ruby(m.data)}"'),
    "ESPHome ints": lines_of(lambda m: f'[{m.clock[:8]}][D][uart_debug:176]: {word(m, ">>>", "<<<")} {":".join(map(str, m.data))}'),
    "ESPHome binary": lines_of(lambda m: f'[{m.clock[:8]}][D][uart_debug:192]: {word(m, ">>>", "<<<")} {":".join(f"0b{b:08b} (0x{b:02X})" for b in m.data)}'),
    "ESP_LOGI": lines_of(lambda m: f"I ({m.ms}) RS485_APP: {word(m, 'TX', 'RX')} {len(m.data)} bytes: " + " ".join(f"0x{b:02X}" for b in m.data)),
    "Tasmota": lines_of(lambda m: f'{m.clock} {word(m, "MQT: cmnd/rs485/SerialSend5", "RSL: RESULT =")} {word(m, m.data.hex().upper(), json.dumps({"SerialReceived": m.data.hex().upper()}))}'),
    "Tasmota bridge": lines_of(lambda m: f'{m.clock} MQT: tele/{word(m, "modbusSend", "modbusReceived")} = {{"{word(m, "ModbusSend", "ModbusReceived")}":{{"RawData":[{",".join(map(str, m.data))}]}}}}'),
    "Arduino decimals": lines_of(lambda m: f"{word(m, 'Sent: ', 'Received: ')}{' '.join(map(str, m.data))} "),
    "Arduino indexed": lines_of(_each(lambda i, b: f"buf[{i}] = {b}")),
    "Arduino indexed hex": lines_of(_each(lambda i, b: f"data[{i}]: 0x{b:X}")),
    "Arduino byte counters": lines_of(_each(lambda i, b: f"Byte {i}: {b:X}")),
    "Arduino spaced columns": lines_of(_each(lambda i, b: f"{i}\t{b}\t{b:X}\t{b:b}")),
    "RT-Thread": lines_of(lambda m: dump(m.data, lambda at, row: f"D/HEX modbus_{word(m, 'tx', 'rx')}: {at:04X}-{at + 16:04X}: {spaced(row):<48}    {shown(row)}")),
    "kernel dump": lines_of(lambda m: dump(m.data, lambda at, row: f"[{m.ms / 1000:12.6f}] rs485 {word(m, 'tx', 'rx')}: {at:08x}: {row.hex(' '):<47}  {shown(row)}")),
    "kernel dump bare": lines_of(lambda m: dump(m.data, lambda at, row: f"[{m.ms / 1000:12.6f}] {row.hex(' ')}")),
    "Zephyr": lines_of(lambda m: f"[00:00:{m.ms % 60000 / 1000:06.3f},000] <dbg> modbus_serial: {word(m, 'tx', 'rx')}_adu: {word(m, 'uart tx', 'uart rx')}\n" + dump(m.data, lambda at, row: f"                                 {row[:8].hex(' ')}  {row[8:].hex(' '):<23} |{shown(row)}")),
    "interceptty": _after("", "", lambda m: "\n".join(f"{word(m, '>', '<')}\t0x{b:02x} ({chr(b) if 0x20 < b < 0x7F else f'^{chr(b + 64)}' if b < 32 else f'M-{b}'})" for b in m.data)),
    "slsnif": lines_of(lambda m: f"{word(m, 'Host   -->', 'Device <--')} " + " ".join(f"{shown(bytes((b,)))}({b:03d})" for b in m.data)),
    "sersniff": lines_of(lambda m: f"{word(m, 'Host', 'Device')}: " + " ".join(f"{b:02x} [{shown(bytes((b,)))}]" for b in m.data)),
    "RealTerm window": _wrapped_at(48),
    "terminal of 80": _wrapped_at(80),
    "control names": lines_of(lambda m: f"21.11.2026 {m.clock} [{word(m, 'TX', 'RX')}] - " + "".join(map(_named, m.data))),
    "Docklight decimals": lines_of(lambda m: f"21.11.2026 {m.clock} [{word(m, 'TX', 'RX')}] - " + " ".join(f"{b:03d}" for b in m.data)),
    "HTerm": lines_of(lambda m: f"{word(m, 'T', 'R')}x {m.clock}: " + "   ".join(f"{b:02X}" for b in m.data)),
    "CoolTerm": lines_of(lambda m: dump(m.data, lambda at, row: f"{row[:4].hex(' ').upper()}  {row[4:8].hex(' ').upper()}  {row[8:12].hex(' ').upper()}  {row[12:].hex(' ').upper()}".ljust(52) + shown(row))),
    "Modbus Poll timed": lambda log, rng: "\n".join(f"{word(m, 'Tx', 'Rx')}:{i:06d} {m.clock} - {spaced(m.data)}" for i, m in enumerate(log)),
    "Modbus Poll new": lambda log, rng: "\n".join(f"{i:06d}-{word(m, 'Tx', 'Rx')}-{m.clock}-{spaced(m.data)}" for i, m in enumerate(log)),
    "CAS Modbus Scanner": lines_of(lambda m: f"  [{m.clock[:8]}] {word(m, '=> Poll:', '<= Response:')} {spaced(m.data)} "),
    "QModMaster bus monitor": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')} > {m.clock} : {spaced(m.data)}"),
    "MasterOPC": lines_of(lambda m: f"22-11-2026 {m.clock} Узел_1.Счетчик 5:(COM4) {word(m, 'Tx', 'Rx')}: [{len(m.data):04d}] {spaced(m.data)}"),
    "Lectus": lines_of(lambda m: f"{m.clock} ID={m.data[0]} {word(m, '>', '<')} {spaced(m.data)}"),
    "Lectus words": lines_of(lambda m: f"[{m.clock[:8]}] COM3 {word(m, 'Запрос узла 1', 'Ответ узла 1')} ({len(m.data)}): {spaced(m.data)}"),
    "OWEN OPC": lines_of(lambda m: f"{m.clock}: COM5 {word(m, 'Передача', 'Прием')} [{len(m.data)} байт] {m.data.hex(' ').upper()}"),
    "Russian terminal": lines_of(lambda m: f"{word(m, 'Передано', 'Получено')} {len(m.data)} байт: {' '.join(f'{b:02X}h' for b in m.data)}"),
    "Russian prose": _in_prose(("Посылаю {hex}", "в ответ приходит {hex}, что неверно"), "Добрый день! Прибор на 9600 8N1, адрес 1, регистры с 40001. Вот обмен:"),
    "Russian prose 2": _in_prose(("Мастер шлёт: {hex} - это чтение", "А слейв отвечает: {low} (время ответа 25 мс)"), "Подскажите, пожалуйста, 2 дня бьюсь."),
    "Cyrillic digits": lines_of(lambda m: f"{word(m, 'Запрос', 'Ответ')}: {_cyrillic(spaced(m.data))}"),
    "Russian field list": lines_of(lambda m: f"{word(m, 'Запрос', 'Ответ')}: адрес {m.data[0]:02X}, функция {m.data[1]:02X}, данные {spaced(m.data[2:-2])}, CRC {spaced(m.data[-2:])}"),
    "MBAP fields": lines_of(lambda m: f"{word(m, 'TX', 'RX')} addr={m.data[0]:#04x} fc={m.data[1]:#04x} data=[{spaced(m.data[2:-2])}] crc={m.data[-2:].hex()}"),
    "BBCode": lines_of(lambda m: f"[b]{word(m, 'TX', 'RX')}:[/b] [code]{spaced(m.data)}[/code]"),
    "BBCode blocks": lines_of(lambda m: f"[quote=\"ivan_77\"]{word(m, 'Request', 'Response')}:\n[code]\n{spaced(m.data)}\n[/code][/quote]"),
    "list": lambda log, rng: "\n".join(f"{i}) {spaced(m.data)}" for i, m in enumerate(log, 1)),
    "list with dots": lambda log, rng: "\n".join(f"{i}. {word(m, 'request', 'response')} {m.data.hex(' ')}" for i, m in enumerate(log, 1)),
    "bullets": lines_of(lambda m: f"• {word(m, 'Master', 'Slave')}: {spaced(m.data)}"),
    "dashes": lines_of(lambda m: f"- {word(m, 'master', 'slave')} - {m.data.hex('-')}"),
    "annotated bytes": lines_of(_annotated),
    "fields by bars": lines_of(lambda m: f"{m.data[0]:02X}|{m.data[1]:02X}|{m.data[2:-2].hex().upper()}|{m.data[-2:].hex().upper()}"),
    "fields by dashes": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')} {m.data[0]:02X}-{m.data[1]:02X}-{m.data[2:-2].hex().upper()}-{m.data[-2:].hex().upper()}"),
    "ruler above": lines_of(lambda m: f"{word(m, 'TX', 'RX')}\n " + "  ".join(f"{i:d}" for i in range(min(len(m.data), 10))) + f"\n{spaced(m.data)}"),
    "0x semicolons": lines_of(_each(lambda i, b: f"0x{b:02X}", ";")),
    "0x bars": lines_of(lambda m: word(m, "W ", "R ") + " | ".join(f"0x{b:02X}" for b in m.data)),
    "0x brackets": lines_of(lambda m: word(m, "Tx ", "Rx ") + "".join(f"[0x{b:02X}]" for b in m.data)),
    "0x angles": lines_of(lambda m: word(m, "Tx ", "Rx ") + "".join(f"<0x{b:02X}>" for b in m.data)),
    "0x braces": lines_of(lambda m: word(m, "sent ", "rcvd ") + "".join(f"{{0x{b:02X}}}" for b in m.data)),
    "0x dashes": lines_of(_each(lambda i, b: f"0x{b:02X}", "-")),
    "0x colons": lines_of(_each(lambda i, b: f"0x{b:02x}", ":")),
    "slashes between": lines_of(_each(lambda i, b: f"{b:02X}", "/")),
    "bars between": lines_of(lambda m: word(m, "TX ", "RX ") + "|".join(f"{b:02X}" for b in m.data)),
    "underscores": lines_of(lambda m: word(m, "TX ", "RX ") + "_".join(f"{b:02X}" for b in m.data)),
    "h commas": lines_of(lambda m: word(m, "Tx: ", "Rx: ") + ",".join(f"{b:02X}H" for b in m.data)),
    "h glued": lines_of(lambda m: word(m, "Tx: ", "Rx: ") + "-".join(f"{b:02X}h" for b in m.data)),
    "asm h": lines_of(lambda m: f"{word(m, 'req', 'rsp')}: DB " + ", ".join(f"0{b:02X}h" if b > 0x9F else f"{b:02X}h" for b in m.data)),
    "C suffixes": lines_of(lambda m: f"{word(m, 'req', 'rsp')} = {{" + ", ".join(f"0x{b:02X}u" for b in m.data) + "};"),
    "C with comments": lines_of(lambda m: f"uint8_t {word(m, 'req', 'rsp')}[] = {{\n" + "\n".join(f"  0x{b:02X}, // {i}: byte {b}" for i, b in enumerate(m.data)) + "\n};"),
    "C assignments": lines_of(_each(lambda i, b: f"  txbuf[{i}] = 0x{b:02X};")),
    "C# array": lines_of(lambda m: f"byte[] {word(m, 'request', 'response')} = new byte[{len(m.data)}] {{ {', '.join(map(str, m.data))} }};"),
    "VB array": lines_of(lambda m: f"Dim {word(m, 'tx', 'rx')}() As Byte = {{" + ", ".join(f"&H{b:X}" for b in m.data) + "}"),
    "PowerShell array": lines_of(lambda m: f"${word(m, 'tx', 'rx')} = [byte[]](" + ",".join(f"0x{b:02X}" for b in m.data) + ")"),
    "Matlab write": lines_of(lambda m: f"{word(m, 'write(s,', 'ans = double(')}[" + " ".join(map(str, m.data)) + "])"),
    "Kotlin": lines_of(lambda m: f"D/RS485: {word(m, 'send', 'receive')} " + m.data.hex(" ").upper() + f" ({len(m.data)})"),
    "Android logcat": lines_of(lambda m: f"11-21 {m.clock}  2311  2345 D ModbusRtu: {word(m, 'send', 'recv')} = [{', '.join(str(b - 256 if b > 127 else b) for b in m.data)}]"),
    "syslog": lines_of(lambda m: f"Nov 21 {m.clock[:8]} gw-07 mbgate[{1234}]: {word(m, 'tx', 'rx')} {m.data.hex(' ')}"),
    "journal": lines_of(lambda m: f"Nov 21 {m.clock[:8]} raspberrypi python3[842]: {word(m, 'TX', 'RX')}: {m.data!r}"),
    "docker": lines_of(lambda m: f"app_1  | 2026-11-21T{m.clock}456Z DEBUG modbus {word(m, 'tx', 'rx')}={m.data.hex()}"),
    "logfmt": lines_of(lambda m: f"time=2026-11-21T{m.clock}Z level=debug msg=\"modbus {word(m, 'tx', 'rx')}\" bytes={len(m.data)} data=\"{m.data.hex(' ')}\""),
    "JSON lines": lines_of(lambda m: json.dumps({"@timestamp": f"2026-11-21T{m.clock}Z", "level": "DEBUG", "message": f"{word(m, 'TX', 'RX')} {spaced(m.data)}", "thread": 12})),
    "JSON nested": lines_of(lambda m: json.dumps({"event": word(m, "request", "response"), "payload": {"hex": m.data.hex(" "), "len": len(m.data)}, "t": 1763720000.5 + m.ms / 1000})),
    "JSON pretty": lines_of(lambda m: json.dumps({"direction": word(m, "tx", "rx"), "data": list(m.data)}, indent=2)),
    "JSON of hex strings": lines_of(lambda m: json.dumps({"dir": word(m, "tx", "rx"), "bytes": [f"0x{b:02x}" for b in m.data]})),
    "YAML": lines_of(lambda m: f"- dir: {word(m, 'tx', 'rx')}\n  data: [{', '.join(f'0x{b:02x}' for b in m.data)}]"),
    "YAML list": lines_of(lambda m: f"{word(m, 'request', 'response')}:\n" + "\n".join(f"  - 0x{b:02x}" for b in m.data)),
    "XML": lines_of(lambda m: f"<frame dir=\"{word(m, 'out', 'in')}\" time=\"2026-11-21T{m.clock}\">{m.data.hex()}</frame>"),
    "SQL": lines_of(lambda m: f"INSERT INTO log VALUES ('2026-11-21 {m.clock}', '{word(m, 'TX', 'RX')}', X'{m.data.hex().upper()}');"),
    "postgres": lines_of(lambda m: f" {m.ms:>7} | {word(m, 'tx', 'rx')} | \\x{m.data.hex()}"),
    "spreadsheet": lambda log, rng: "Time\tDir\tLen\t" + "\t".join(f"B{i}" for i in range(8)) + "\n" + "\n".join(f"{m.clock}\t{word(m, 'TX', 'RX')}\t{len(m.data)}\t" + "\t".join(f"{b:02X}" for b in m.data) for m in log),
    "spreadsheet lost zeros": lambda log, rng: "\n".join(f"{m.clock}\t{word(m, 'TX', 'RX')}\t" + "\t".join(f"{b:X}" for b in m.data) for m in log),
    "table of fields": lines_of(_field_table),
    "Moxa": lambda log, rng: "No.\tTime\tSource\tType\tData\n" + "\n".join(f"{i}\t{m.ms / 1000:.3f}\tPort 1\t{word(m, 'Request', 'Response')}\t{spaced(m.data)}" for i, m in enumerate(log, 1)),
    "Saleae 2": _csv_headed("name,type,start_time,duration,data", '"Async Serial","data",{s:.7f},0.001,0x{b:02X}'),
    "Saleae 1": _csv_headed("Time [s],Value,Parity Error,Framing Error", "{s:.9f},0x{b:02X},,"),
    "Saleae 1 results": _csv_headed("Time [s],Analyzer Name,Decoded Protocol Result", "{s:.9f},Async Serial,{ch}"),
    "DSView": _csv_headed("Id,Time[ns],0:UART: RX/TX", "{us},{us}000.00000,{b:02X}"),
    "Kingst": _csv_headed("Time(s),UART:Hex", "{s:.9f},{b:02X}"),
    "PulseView bytes": _timed_bytes("{us}-{us} UART: {word}: {b:02X}"),
    "sigrok-cli": lines_of(_each(lambda i, b: f"uart-1: {b:02X}")),
    "oscilloscope table": _csv_headed("No,Time,Data,Parity", "{us},{s:.6f}s,{b:02X},OK"),
    "time and byte": _timed_bytes("{clock} {word} {b:02X}"),
    "mbusd": lines_of(lambda m: f"21 Nov 2026 {m.clock[:8]} tty: {word(m, 'written', 'read')} {len(m.data)} bytes: " + "".join(f"[{b:02x}]" for b in m.data)),
    "modpoll": lines_of(lambda m: f"{word(m, 'TX', 'RX')} ({len(m.data)}) " + " ".join(f"<{b:02X}>" for b in m.data)),
    "jamod": lines_of(lambda m: f"{word(m, 'Sent', 'Response')}: {m.data.hex(' ')} "),
    "j2mod": lines_of(lambda m: f"{m.clock} [DEBUG] [ModbusRTUTransport] - {word(m, 'Wrote', 'Read')}: {spaced(m.data)}"),
    "NModbus": lines_of(lambda m: f"dbg: {word(m, 'TX', 'RX')}: {', '.join(map(str, m.data))}"),
    "EasyModbus": lines_of(lambda m: f"21.11.2026 {m.clock[:8]} {word(m, 'Send', 'Receive')} Serial-Data: {m.data.hex('-').upper()}"),
    "pymodbus server": lines_of(lambda m: f"2026-11-21 {m.clock.replace('.', ',')} DEBUG async_io:244 Handling data: {ox(m.data)}" if m.sent else f"2026-11-21 {m.clock.replace('.', ',')} DEBUG async_io:301 send: [{m.role}]- {m.data.hex()}"),
    "tokio-modbus": lines_of(lambda m: f"[2026-11-21T{m.clock}Z TRACE tokio_modbus::codec::rtu] {word(m, 'write', 'read')}: {list(m.data)}"),
    "Elixir bits": lines_of(lambda m: f"{m.clock} [debug] {word(m, 'sending', 'got')} <<{', '.join(f'0x{b:02X}' for b in m.data)}>>"),
    "Erlang": lines_of(lambda m: f"{word(m, 'send', 'recv')} <<{','.join(map(str, m.data))}>>"),
    "Haskell": lines_of(lambda m: f"{word(m, 'sent', 'received')} \"" + _haskell(m.data) + '"'),
    "xxd -i": lines_of(lambda m: f"unsigned char {word(m, 'tx', 'rx')}_bin[] = {{\n" + ",\n".join("  " + ", ".join(f"0x{b:02x}" for b in m.data[at : at + 12]) for at in range(0, len(m.data), 12)) + f"\n}};\nunsigned int {word(m, 'tx', 'rx')}_bin_len = {len(m.data)};"),
    "xxd -u": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:08X}: {row.hex(' ', -2).upper():<40} {shown(row)}")),
    "hd": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:08x}  {row[:8].hex(' ')}  {row[8:].hex(' '):<23} |{shown(row):<16}|") + f"\n{len(m.data):08x}"),
    "gdb x/8xb": lines_of(lambda m: "\n".join(f"0x{0x20000100 + at:x} <{word(m, 'tx', 'rx')}_buf+{at}>:\t" + "\t".join(f"0x{b:02x}" for b in m.data[at : at + 8]) for at in range(0, len(m.data), 8))),
    "gdb print": lines_of(lambda m: f"$1 = {{{', '.join(f'0x{b:x}' for b in m.data)}}}"),
    "gdb escapes": lines_of(lambda m: f"(gdb) p {word(m, 'tx', 'rx')}\n$2 = \"" + "".join(f"\\{b:03o}" if not 0x20 < b < 0x7F or chr(b) in '"\\' else chr(b) for b in m.data) + '"'),
    "STM32 watch": lines_of(_each(lambda i, b: f"{word_of(i)}[{i}]\tuint8_t\t0x{b:x} '{shown(bytes((b,)))}'")),
    "Keil": lines_of(lambda m: "\n".join(f"0x{0x20000400 + at:08X}: " + " ".join(f"{b:02X}" for b in m.data[at : at + 16]) for at in range(0, len(m.data), 16))),
    "VS debugger": lines_of(_each(lambda i, b: f"\t[{i}]\t0x{b:02x} '{shown(bytes((b,)))}'\tunsigned char")),
    "two columns": lambda log, rng: "Master                    Slave\n" + "\n".join(f"{spaced(a.data)}   ->   {spaced(b.data)}" for a, b in zip(log[::2], log[1::2], strict=True)),
    "pair by comma": lambda log, rng: "\n".join(f"{a.data.hex()},{b.data.hex()}" for a, b in zip(log[::2], log[1::2], strict=True)),
    "pair in brackets": lambda log, rng: "\n".join(f"Req[{spaced(a.data)}] Resp[{spaced(b.data)}] OK {b.ms - a.ms}ms" for a, b in zip(log[::2], log[1::2], strict=True)),
    "expected and got": lambda log, rng: "\n".join(f"assert_eq!(master.request, hex!(\"{a.data.hex()}\"));\nassert_eq!(master.answer, hex!(\"{b.data.hex()}\"));" for a, b in zip(log[::2], log[1::2], strict=True)),
    "curl": lines_of(lambda m: f"curl -X POST http://10.0.0.5/api/rs485?{word(m, 'tx', 'rx')} -d 'hex={m.data.hex()}'"),
    "echo -e": lines_of(lambda m: "echo -ne '" + "".join(f"\\x{b:02X}" for b in m.data) + f"' {word(m, '> /dev/ttyUSB0', '# received')}"),
    "printf": lines_of(lambda m: "$ printf '" + "".join(f"\\{b:03o}" for b in m.data) + "' > /dev/ttyS1"),
    "crc note": lines_of(lambda m: f"{word(m, 'TX', 'RX')}: {spaced(m.data)}  CRC OK ({m.data[-2:].hex().upper()}), {len(m.data)} bytes, {m.ms % 97} ms"),
    "tail note": lines_of(lambda m: f"{spaced(m.data)} // {word(m, 'request to', 'response from')} unit {m.data[0]}"),
    "arrows after": lines_of(lambda m: f"{spaced(m.data)} {word(m, '->', '<-')}"),
    "direction behind": lines_of(lambda m: f"{m.clock}  {spaced(m.data)}  {word(m, 'TX', 'RX')}"),
    "ascii column": lines_of(lambda m: f"{word(m, 'TX', 'RX')} {spaced(m.data)}  '{shown(m.data)}'"),
    "hex then text": lines_of(lambda m: f"{word(m, 'TX', 'RX')}: {m.data.hex()} {m.data!r}"),
    "text then hex": lines_of(lambda m: f"{word(m, 'TX', 'RX')}: {m.data!r} ({m.data.hex(' ')})"),
    "words of 4": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}: " + " ".join(m.data[i : i + 4].hex().upper() for i in range(0, len(m.data), 4))),
    "dots between": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}: {'.'.join(f'{b:02X}' for b in m.data)}"),
    "decimal dots": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}: {'.'.join(map(str, m.data))}"),
    "zero padded decimals": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}: {' '.join(f'{b:03d}' for b in m.data)}"),
    "semicolon decimals": lines_of(lambda m: f"{';'.join(map(str, m.data))};"),
    "bare decimals": lines_of(lambda m: " ".join(map(str, m.data))),
}  # fmt: skip


def word_of(i: int) -> str:  # noqa: ARG001
    return "rx"
