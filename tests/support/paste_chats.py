"""Conversations as they stand in chats, letters, forums and tickets, and in windows and logs that name who speaks."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Final

from pastes import Message, Style, dump, lines_of, shown, spaced, word


def _between(head: str, form: Style, foot: str) -> Style:
    """A conversation with what people write before and behind it."""
    return lambda log, rng: f"{head}\n{form(log, rng)}\n{foot}"


def _behind_signs(sign: str, form: Style) -> Style:
    """A conversation as an answer to a letter quotes it."""
    return lambda log, rng: "\n".join(f"{sign}{line}" for line in form(log, rng).split("\n"))


def _bytewise(form: str) -> Style:
    """A line a byte."""
    return lines_of(lambda m: "\n".join(form.format(word(m, "tx", "rx"), i, b, chr(b)) for i, b in enumerate(m.data)))


def _pairs(form: str) -> Style:
    """A line, or several, for a request and its answer."""
    return lambda log, rng: "\n".join(
        form.format(ask=ask.data, answer=answer.data, asks=spaced(ask.data), answers=spaced(answer.data))
        for ask, answer in zip(log[::2], log[1::2], strict=True)
    )


def _c_arrays(log: Sequence[Message], rng: random.Random) -> str:
    return "\n".join(
        f"uint8_t {word(m, 'req', 'resp')}[] = {{\n    {', '.join(f'0x{b:02X}' for b in m.data)}\n}};" for m in log
    )


def _characters(data: bytes) -> str:
    return " ".join(f"{b:02X}{chr(b) if 0x20 < b < 0x7F else '.'}" for b in data if b != 0x20)


def _dumped(m: Message) -> str:
    return f"{word(m, 'TX', 'RX')}\n" + dump(m.data, lambda at, row: f"{at:08x}  {row.hex(' '):<48} |{shown(row)}|")


def _parted_dump(m: Message) -> str:
    def row(at: int, data: bytes) -> str:
        parts = filter(None, (data[:8].hex(" "), data[8:].hex(" ")))
        return f"{at:06x} : {' - '.join(parts)}    {shown(data)}"

    return dump(m.data, row)


def _words(m: Message, form: str) -> str:
    """16-bit words of this machine's order, in another base; the last one filled up, the length below."""
    data = m.data + bytes(len(m.data) % 2)
    return (
        dump(
            data,
            lambda at, row: f"{at:07o}" + "".join(form.format(row[i] | row[i + 1] << 8) for i in range(0, len(row), 2)),
        )
        + f"\n{len(m.data):07o}"
    )


def _as_character(byte: int) -> str:
    return chr(byte) if 0x20 < byte < 0x7F and byte not in (0x22, 0x5C) else f"\\x{byte:02X}"


def _logic(log: Sequence[Message], rng: random.Random) -> str:
    rows = [
        f'"Async Serial","data",{(m.ms + i) / 1000:.9f},0.00086,"{_as_character(b)}",'
        for m in log
        for i, b in enumerate(m.data)
    ]
    return "\n".join(["name,type,start_time,duration,data,error", *rows])


def _packets(m: Message) -> str:
    one, other = word(m, "1", "2"), word(m, "2", "1")
    head = f"{m.ms % 99:5d} {m.ms / 1000:.6f} 10.0.0.{one} → 10.0.0.{other} TCP {54 + len(m.data)} 4001 → 502 [PSH, ACK] Len={len(m.data)}"
    return head + "\n" + dump(m.data, lambda at, row: f"{at:04x}  {row.hex(' ')}   {shown(row)}")


CHATS: Final[dict[str, Style]] = {
    "WhatsApp, minutes": lines_of(lambda m: f"11/25/26, 10:0{m.ms % 10} PM - John Doe: {word(m, 'TX', 'RX')} {m.data.hex(' ')}"),
    "WhatsApp in Russian": lines_of(lambda m: f"25.11.2026, {m.clock[:5]} - Сергей КИПиА: {word(m, 'запрос', 'ответ')}: {spaced(m.data)}"),
    "WhatsApp, seconds": lines_of(lambda m: f"[25.11.2026, {m.clock[:8]}] Иван: {word(m, 'запрос', 'ответ')} {spaced(m.data)}"),
    "Telegram": lines_of(lambda m: f"Иван Петров, [25.11.2026 {m.clock[:5]}]\n{word(m, 'Шлю', 'Приходит')} {spaced(m.data)}\n"),
    "Discord": lines_of(lambda m: f"alex — Today at {m.clock[:5]}\n{word(m, 'req', 'resp')}: `{m.data.hex(' ')}`"),
    "minutes in brackets": lines_of(lambda m: f"[{m.clock[:5]}] {word(m, 'Иван: отправил', 'Пётр: принял')} {spaced(m.data)}"),
    "letter": lines_of(lambda m: f"From: a@b.ru\nSent: Wednesday, November 25, 2026 10:11 AM\nSubject: RE: Modbus\n\n{word(m, 'Request', 'Response')}: {spaced(m.data)}\n"),
    "letter, answered": _behind_signs("> ", _between("Hello,\nplease find the log of 25 Nov 2026, 10:12:\n", lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}: {spaced(m.data)}"), "\nRegards, Bob\nTel +49 89 1234567")),
    "arrays, quoted": _behind_signs("> ", _c_arrays),
    "dumps, quoted": _behind_signs("> ", lines_of(_dumped)),
    "dumps, quoted twice": _behind_signs(">> ", lines_of(_dumped)),
    "deeper and deeper": lambda log, rng: "\n".join(f"{'> ' * (i // 2 + 1)}{word(m, 'Request', 'Response')}: {spaced(m.data)}" for i, m in enumerate(log)),
    "question": _between("Hi all, my device does not answer. Slave id 1, 9600 8N1, baud 9600, register 40001.\n", lines_of(lambda m: spaced(m.data)), "\nWhat is wrong? Thanks, 73 de Bob"),
    "question in Russian": _between("Всем привет! Не отвечает ПЧ, адрес 1, 9600 8N1.", lines_of(lambda m: f"{word(m, 'Отправляю', 'В ответ получаю')}: {spaced(m.data)}"), "В мануале функция 06h. Версия ПО 1.05, дата 2024.11.25, тел. 8-916-123-45-67"),
    "forum, quoted": lines_of(lambda m: f'[quote="ivan" post_id=12345 time=1764057600 user_id=42]{word(m, "Запрос", "Ответ")}: [b]{spaced(m.data)}[/b][/quote]'),
    "forum, coloured": lines_of(lambda m: f"[color={word(m, '#FF0000', '#0000FF')}]{word(m, 'TX', 'RX')}: {spaced(m.data)}[/color]"),
    "forum, code": lambda log, rng: "[code]" + "\n".join(f"{word(m, 'out', 'in')}: {' '.join(map(str, m.data))}" for m in log) + "[/code]",
    "forum, a byte a line": lambda log, rng: "[code]" + _bytewise("{0}_buf[{1}]\tBYTE\t16#{2:02X}")(log, rng) + "[/code]",
    "forum, line breaks": lambda log, rng: _bytewise("{0}_buf[{1}]\tHex\t16#{2:02X}")(log, rng).replace("\n", "<br>\n"),
    "ticket": lines_of(lambda m: f"{{code:title=log|borderStyle=solid}}\n{m.clock} {word(m, 'TX', 'RX')} {spaced(m.data)}\n{{code}}"),
    "wiki": lambda log, rng: "{| class=wikitable\n! Direction !! Bytes\n|-\n" + "\n|-\n".join(f"| {word(m, 'Request', 'Response')} || {spaced(m.data)}" for m in log) + "\n|}",
    "table of boxes": lambda log, rng: "┌────┬──────┐\n" + "\n├────┼──────┤\n".join(f"│ {word(m, 'TX', 'RX')} │ {spaced(m.data)} │" for m in log) + "\n└────┴──────┘",
    "who speaks": lines_of(lambda m: f"{word(m, 'Master', 'Slave')} -> {spaced(m.data)}"),
    "to whom": lines_of(lambda m: f"{m.clock} {word(m, 'Slave <-', 'Slave ->')} {spaced(m.data)}"),
    "host and device": lines_of(lambda m: f"{word(m, 'Host', 'Device')} --> " + " ".join(f"({b:03d})" for b in m.data)),
    "device to computer": lines_of(lambda m: f"{m.clock[:8]} {word(m, 'ПК->прибор', 'прибор->ПК')}: {spaced(m.data)}"),
    "buffers in a trace": lambda log, rng: "\n".join(f'"{i}";"25.11.2026 {m.clock}";"{word(m, "SendBuffer", "RcvBuffer")}";' + ";".join(f"16#{b:02X}" for b in m.data) for i, m in enumerate(log)),
    "frames read": lines_of(lambda m: f"2026-11-25 {m.clock} DEBUG: [serial client] {word(m, 'Write', 'ReadFrame')}: {m.data.hex(' ')}"),
    "data received": lines_of(lambda m: f"onEvent {word(m, 'DataSent', 'DataReceived')} [{', '.join(f'0x{b:02x}' for b in m.data)}]"),
    "bytes written": lines_of(lambda m: f"{word(m, 'bytesWritten', 'bytesRead')}({len(m.data)}): {m.data.hex(' ')}"),
    "buffers with underscores": lines_of(lambda m: f"{word(m, 'write_buffer', 'read_buffer')} = {m.data.hex()}"),
    "ways of a block": lines_of(lambda m: f"#{m.ms} SEND_RECV_MSG {word(m, 'OUT', 'IN')} " + " ".join(f"16#{b:02X}" for b in m.data)),
    "marks above brackets": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}\n" + "".join(f"[{b:02X}]" for b in m.data)),
    "station behind the arrow": lines_of(lambda m: f"{m.clock[:8]} {word(m, '->', '<-')} Узел{m.data[0]} {spaced(m.data)}"),
    "clock hard before bytes": lines_of(lambda m: f"[{word(m, 'TX', 'RX')}]{m.clock}:{spaced(m.data)}"),
    "ticks before a port": lines_of(lambda m: f"[{m.ms + 1000}] USART2 DMA {word(m, 'TX', 'RX')} {len(m.data)} bytes: {spaced(m.data)}"),
    "ticks before a task": lines_of(lambda m: f"{m.ms + 1000}: Eastron: {word(m, 'send', 'reply')} [{m.data.hex(' ')}]"),
    "bytes and their characters": lines_of(lambda m: _characters(m.data) if 0x20 not in m.data else spaced(m.data)),
    "halves of a dump": lines_of(_parted_dump),
    "debugger's dump": lines_of(lambda m: dump(m.data, lambda at, row: f"00000000`0012{at:04x}  {row[:8].hex(' ')}{'-' * (len(row) > 8)}{row[8:].hex(' ')}  {shown(row)}")),
    "PowerShell 5": lambda log, rng: "\n".join("           00 01 02 03 04 05 06 07 08 09 0A 0B 0C 0D 0E 0F\n\n" + dump(m.data, lambda at, row: f"{at:08X}   {row.hex(' ').upper():<47}  {shown(row)}") + "\n" for m in log),
    "WinHex": lambda log, rng: "\n".join("Offset      0  1  2  3  4  5  6  7   8  9  A  B  C  D  E  F\n" + dump(m.data, lambda at, row: f"{at:08X}   {row[:8].hex(' ').upper():<23}  {row[8:].hex(' ').upper():<23}   {shown(row)}") for m in log),
    "packets and their dumps": lines_of(_packets),
    "bus log with a hash": lines_of(lambda m: f"({1795600000 + m.ms / 1000:.6f}) tty0 {word(m, 'TX', 'RX')}#{m.data.hex().upper()}"),
    "length and data": lambda log, rng: "\n".join(f"{i}\t{m.clock}\tprog.exe\t{word(m, 'IRP_MJ_WRITE', 'IRP_MJ_READ')}\tCOM1\tSUCCESS\tLength: {len(m.data)}, Data: {spaced(m.data)}" for i, m in enumerate(log, 1)),
    "process monitor": lines_of(lambda m: f'"{m.clock}1234","app.exe","4242","{word(m, "WriteFile", "ReadFile")}","\\Device\\Serial0","SUCCESS","Length: {len(m.data)}, Data: {spaced(m.data)}"'),
    "check value said again": lines_of(lambda m: f"{word(m, '发送报文', '响应报文')}：{spaced(m.data)}（CRC校验：{spaced(m.data[-2:])}）"),
    "debug print of a source": lines_of(lambda m: f"[src/main.rs:42:5] {word(m, 'request', 'response')} = [\n" + "\n".join(f"    {b}," for b in m.data) + "\n]"),
    "file of settings": _pairs("[Poll]\nTx={asks}\nRx={answers}"),
    "pairs in YAML": _pairs('- request: "{asks}"\n  response: "{answers}"'),
    "pairs by an arrow": _pairs("{asks} → {answers}"),
    "test of a driver": lambda log, rng: "\n".join(f"    assert exchange(bytes.fromhex('{a.data.hex()}')) == bytes.fromhex('{b.data.hex()}')" for a, b in zip(log[::2], log[1::2], strict=True)),
    "read by a machine": lines_of(lambda m: f"{word(m, 'TX', 'RX')} {spaced(m.data).replace('0', 'O')}"),
    "online array": lambda log, rng: "\n".join(f"{word(m, 'abySend', 'abyRecv')}\tARRAY [0..{len(m.data) - 1}] OF BYTE\n" + "\n".join(f"\t{word(m, 'abySend', 'abyRecv')}[{i}]\tBYTE\t16#{b:02X}" for i, b in enumerate(m.data)) for m in log),
    "loads of a program": lambda log, rng: "\n".join(f"// {word(m, 'Request', 'Response')}\n" + "\n".join(f"L B#16#{b:02X}\nT DBB{i}" for i, b in enumerate(m.data)) for m in log),
    "words with 0x": lines_of(lambda m: f"{word(m, 'TX', 'RX')}: " + " ".join(f"0x{m.data[i : i + 2].hex().upper()}" for i in range(0, len(m.data), 2))),
    "dollars one way": lines_of(lambda m: "".join(f"${b:02X}" for b in m.data) if m.sent else spaced(m.data)),
    "braces": lines_of(lambda m: "".join(f"{{{b:02X}}}" for b in m.data)),
    "backslashes": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')} {len(m.data)} bytes: \\" + "\\".join(f"{b:02X}" for b in m.data)),
    "modbus-tk": lines_of(lambda m: f"2026-11-25 {m.clock.replace('.', ',')} DEBUG modbus_rtu.{word(m, '_send', '_recv')} MainThread {word(m, '->', '<-')}{m.data.hex('-').upper()}-"),
    "FHEM": lines_of(lambda m: f"2026.11.25 {m.clock} 5: SDM: {word(m, 'SendQueue sends', 'ParseFrames got')}: {m.data.hex()} id 1, fc 3"),
    "Beckhoff": lines_of(lambda m: f"25/11/2026 {m.clock.replace('.', ' ')} ms | 'PlcTask' (350): {word(m, 'TX', 'RX')} {spaced(m.data)}"),
    "OpenModScan": lines_of(lambda m: f"{word(m, '[Tx] ← ', '[Rx] → ')}{m.clock} {spaced(m.data)}"),
    "od -An": lines_of(lambda m: _words(m, " {:06o}")),
    "hexdump -d": lines_of(lambda m: _words(m, "   {:05d}")),
    "od -A d": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:07d} {row.hex(' ')}") + f"\n{len(m.data):07d}"),
    "socat in one line": lines_of(lambda m: f"{word(m, '>', '<')} 2026/11/25 {m.clock}123  length={len(m.data)} from=0 to={len(m.data) - 1}\n {m.data.hex(' ')}"),
    "PowerShell 7": lambda log, rng: "\n".join("   Label: Byte[] (System.Byte[]) <12A34B56>\n\n          Offset Bytes                                           Ascii\n                 00 01 02 03 04 05 06 07 08 09 0A 0B 0C 0D 0E 0F\n          ------ ----------------------------------------------- -----\n" + dump(m.data, lambda at, row: f"{at:016X} {row.hex(' ').upper():<48}{shown(row)}") + "\n" for m in log),
    "cells behind their count": lines_of(lambda m: f"{m.clock},{word(m, 'TX', 'RX')},{len(m.data)}," + ",".join(map(str, m.data))),
    "columns by their names": lambda log, rng: "time,dir," + ",".join(f"b{i}" for i in range(12)) + "\n" + "\n".join(f"{m.clock},{word(m, 'TX', 'RX')},{m.data.hex(',').upper()}" for m in log),
    "Logic 2 as characters": _logic,
    "frames of a scope": lambda log, rng: "Frame,Start,Source,Data\n" + "\n".join(f"{i},{m.ms / 1000:.6f} s,{word(m, 'Tx', 'Rx')},{m.data.hex().upper()}" for i, m in enumerate(log, 1)),
    "sentence in Russian": _pairs("На запрос {asks} прибор отвечает {answers}, таймаут 500 мс."),
    "sentence in English": _pairs("When I send {asks} I get {answers} back."),
    "sentence in German": _pairs("Ich schicke {asks}, das Gerät antwortet {answers}."),
    "web server's clock": lines_of(lambda m: f"[25/Nov/2026:{m.clock[:8]} +0300] {word(m, 'TX', 'RX')} {spaced(m.data)}"),
    "ticks and a task's number": lines_of(lambda m: f"{m.ms} 17 [MBTask] {word(m, 'TX', 'RX')} {spaced(m.data)}"),
    "sscom": lines_of(lambda m: f"[{m.clock}]{word(m, 'OUT→◇', 'IN←◆')}{spaced(m.data)} "),
}  # fmt: skip
