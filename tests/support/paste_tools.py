"""Conversations as they stand in the logs of libraries, gateways, sniffers and oscilloscopes, and as mail clients mangle them."""

from __future__ import annotations

import base64
import json
import random
from collections.abc import Iterator, Sequence
from typing import Final

from pastes import Message, Style, dump, lines_of, ox, shown, spaced, word

_CONTROL: Final = "@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_"


def _day(message: Message) -> str:
    return f"2026-11-21 {message.clock}"


def _grown(log: Sequence[Message], rng: random.Random) -> str:
    """A buffer shown again each time that more has come."""
    out = []
    for m in log:
        if m.sent:
            out.append(
                f"  client-request-handler flushing new request <Buffer {m.data.hex(' ')}> +{rng.randrange(9)}ms"
            )
            continue
        sizes = sorted({1, rng.randrange(2, len(m.data)), len(m.data)})
        for size in sizes:
            out.append("  rtu-response-handler receiving new data +3ms")
            out.append(f"  rtu-response-handler buffer <Buffer {m.data[:size].hex(' ')}> +0ms")
            out.append(
                "  rtu-response-handler not enough data available to parse +1ms"
                if size < len(m.data)
                else "  rtu-response-handler reset buffer +0ms"
            )
    return "\n".join(out)


def _received_bytes(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    for m in log:
        clock = m.clock[:8]
        if m.sent:
            out.append(
                f"[{clock}][V][modbus_controller:042]: Sending next modbus command to device {m.data[0]} register 0x{m.data[2]:02X}{m.data[3]:02X} count {m.data[5]}"
            )
            out.append(f"[{clock}][V][modbus:184]: Modbus write: {m.data.hex('.').upper()} ({len(m.data)})")
        else:
            out += [f"[{clock}][V][modbus:058]: Modbus received Byte  {b} (0X{b:x})" for b in m.data]
            out.append(f"[{clock}][V][modbus_controller:048]: Modbus response queued")
    return "\n".join(out)


def _said_twice(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    for m in log:
        clock = m.clock[:8]
        if m.sent:
            out.append(f"[{clock}][V][modbus:222]: Modbus write: {m.data.hex('.').upper()} ({len(m.data)})")
            out.append(
                f"[{clock}][V][modbus_controller:565]: Command sent {m.data[1]} 0x{m.data[2:4].hex().upper()} 1 send_count: 1"
            )
        out.append(f"[{clock}][D][uart_debug:114]: {word(m, '>>>', '<<<')} {m.data.hex(':').upper()}")
    return "\n".join(out)


def _tokio(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    for m in log:
        head = f"[2026-11-21T{m.clock}Z TRACE tokio_modbus::codec::rtu]"
        text = "".join(
            "\\0" if b == 0 else chr(b) if 0x20 <= b < 0x7F and b not in (0x22, 0x5C) else f"\\x{b:02x}" for b in m.data
        )
        if m.sent:
            out.append(f"{head} encode RequestAdu {{ hdr: Header {{ slave_id: {m.data[0]} }}, disconnect: false }}")
            out.append(f'{head} encoded as b"{text}"')
            out.append(
                f"[2026-11-21T{m.clock}Z TRACE tokio_util::codec::framed_write] writing; remaining={len(m.data)}"
            )
        else:
            out.append(f'{head} FrameDecoder::decode(b"{text}", len {len(m.data)})')
    return "\n".join(out)


def _jamod(log: Sequence[Message], rng: random.Random) -> str:
    return "\n".join(
        f"Last request: {m.data.hex(' ')}" if m.sent else f"Last response: {m.data.hex(' ')}\nexecute try 1 error: none"
        for m in log
    )


def _pyserial_spy(log: Sequence[Message], rng: random.Random) -> str:
    """`spy://` of pyserial."""
    out = ["000000.000 FLOW none"]
    for m in log:
        head = f"{m.ms / 1000:010.3f} {word(m, 'TX', 'RX')}   "
        out.append(
            f"{m.ms / 1000:010.3f} {word(m, 'Q-RX reset_input_buffer', 'Q-RX in_waiting -> ')}"
            + ("" if m.sent else str(len(m.data)))
        )
        out += [
            f"{head}{at:04X}  {m.data[at : at + 8].hex(' ').upper():<23}  {m.data[at + 8 : at + 16].hex(' ').upper():<23}  {shown(m.data[at : at + 8])} {shown(m.data[at + 8 : at + 16])}".rstrip()
            for at in range(0, len(m.data), 16)
        ]
    return "\n".join(out)


def _netty(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    for m in log:
        out.append(
            f"{m.clock} [nioEventLoopGroup-2-1] DEBUG i.n.h.logging.LoggingHandler - [id: 0x3f21a0b7, L:/10.0.0.5:50312 - R:/10.0.0.9:4001] {word(m, 'WRITE', 'READ')}: {len(m.data)}B"
        )
        out.append("         +-------------------------------------------------+")
        out.append("         |  0  1  2  3  4  5  6  7  8  9  a  b  c  d  e  f |")
        out.append("+--------+-------------------------------------------------+----------------+")
        out.append(dump(m.data, lambda at, row: f"|{at:08x}| {row.hex(' '):<47} |{shown(row):<16}|"))
        out.append("+--------+-------------------------------------------------+----------------+")
    return "\n".join(out)


def _follow_stream(log: Sequence[Message], rng: random.Random) -> str:
    """What Wireshark shows of a TCP stream as a hex dump: the answers are indented, each side counts its own bytes."""
    out, at = [], {True: 0, False: 0}
    for m in log:
        for i in range(0, len(m.data), 16):
            row = m.data[i : i + 16]
            text = f"{row[:8].hex(' '):<23}  {row[8:].hex(' '):<23}"
            out.append(
                f"{'' if m.sent else '    '}{at[m.sent] + i:08X}  {text}  {shown(row[:8])} {shown(row[8:])}".rstrip()
            )
        at[m.sent] += len(m.data)
    return "\n".join(out)


def _c_arrays(log: Sequence[Message], rng: random.Random) -> str:
    out, count = [], {True: 0, False: 0}
    for i, m in enumerate(log):
        rows = "\n".join(
            ", ".join(f"0x{b:02x}" for b in m.data[at : at + 8]) + (", " if at + 8 < len(m.data) else " };")
            for at in range(0, len(m.data), 8)
        )
        out.append(f"char peer{0 if m.sent else 1}_{count[m.sent]}[] = {{ /* Packet {4 + i} */\n{rows}")
        count[m.sent] += 1
    return "\n".join(out)


def _stream_yaml(log: Sequence[Message], rng: random.Random) -> str:
    out = [
        "peers:",
        "  - peer: 0",
        "    host: 10.0.0.5",
        "    port: 50312",
        "  - peer: 1",
        "    host: 10.0.0.9",
        "    port: 4001",
        "packets:",
    ]
    for i, m in enumerate(log):
        out += [
            f"  - packet: {4 + i}",
            f"    peer: {0 if m.sent else 1}",
            f"    index: {i // 2}",
            f"    timestamp: 1795255200.{m.ms % 1000:03d}000000",
            "    data: !!binary |",
            f"      {base64.b64encode(m.data).decode()}",
        ]
    return "\n".join(out)


def _packet_bytes(m: Message) -> str:
    rows = [m.data[at : at + 8] for at in range(0, len(m.data), 8)]
    return (
        f"/* Frame ({len(m.data)} bytes) */\nstatic const unsigned char pkt{m.ms % 90}[{len(m.data)}] = {{\n"
        + "\n".join(
            ", ".join(f"0x{b:02x}" for b in row) + f"{',' if i + 1 < len(rows) else ' '} /* {shown(row)} */"
            for i, row in enumerate(rows)
        )
        + "\n};\n"
    )


def _escaped_rows(m: Message) -> str:
    return " \\\n".join(
        '"' + "".join(f"\\x{b:02x}" for b in m.data[at : at + 16]) + '"' for at in range(0, len(m.data), 16)
    )


def _octal_strace(log: Sequence[Message], rng: random.Random) -> str:
    simple = {9: "\\t", 10: "\\n", 11: "\\v", 12: "\\f", 13: "\\r", 34: '\\"', 92: "\\\\"}
    out = []
    for m in log:
        text = ""
        for i, b in enumerate(m.data):
            following = m.data[i + 1 : i + 2]
            wide = following.isdigit() and following < b"8"
            text += simple.get(b) or (chr(b) if 0x20 <= b < 0x7F else f"\\{b:03o}" if wide else f"\\{b:o}")
        call = f'write(7, "{text}", {len(m.data)})' if m.sent else f'read(7, "{text}", 256)'
        out.append(f"[pid  2211] {m.clock}512 {call} = {len(m.data)}")
        out.append(f"[pid  2211] {m.clock}514 poll([{{fd=7, events=POLLIN}}], 1, 500) = 1 ([{{fd=7, revents=POLLIN}}])")
    return "\n".join(out)


def _ble_log(log: Sequence[Message], rng: random.Random) -> str:
    """What is heard is said twice, once as a value and once as a message."""
    out = []
    for m in log:
        value = m.data.hex("-").upper()
        if m.sent:
            out.append(f"V\t{m.clock}\tWriting request to characteristic 0000ff02-0000-1000-8000-00805f9b34fb")
            out.append(
                f"D\t{m.clock}\tgatt.writeCharacteristic(0000ff02-0000-1000-8000-00805f9b34fb, value=0x{m.data.hex().upper()})"
            )
        else:
            out.append(
                f"I\t{m.clock}\tNotification received from 0000ff01-0000-1000-8000-00805f9b34fb, value: (0x) {value}"
            )
            out.append(f'A\t{m.clock}\t"(0x) {value}" received')
    return "\n".join(out)


def _caret(data: bytes) -> str:
    def one(b: int) -> str:
        if b >= 0x80:
            return "M-" + one(b - 0x80)
        return "^" + _CONTROL[b] if b < 0x20 else "^?" if b == 0x7F else chr(b)

    return "".join(map(one, data))


def _grep(log: Sequence[Message], rng: random.Random) -> str:
    n = rng.randrange(10, 900)
    return "\n".join(
        f"logs/bus-2026.log{word(m, ':', '-')}{n + i}{word(m, ':', '-')}{word(m, 'TX', 'RX')} {spaced(m.data)}"
        for i, m in enumerate(log)
    )


def _quoted_printable(log: Sequence[Message], rng: random.Random) -> str:
    lines = []
    for m in log:
        line = f"{word(m, 'Sent', 'Received')} =3D {spaced(m.data)}=20"
        while len(line) > 70:
            lines.append(line[:70] + "=")
            line = line[70:]
        lines.append(line)
    return "\n".join(lines)


def _entities(log: Sequence[Message], rng: random.Random) -> str:
    return "<br/>\n".join("".join(f"{word(m, '[', '&lt;')}{b:02X}{word(m, ']', '&gt;')}" for b in m.data) for m in log)


def _squeezed(log: Sequence[Message], rng: random.Random) -> str:
    """`hexdump -C` of one file with all of it, rows that repeat shown as `*`."""
    data = b"".join(m.data for m in log)
    out: list[str] = []
    before = b""
    for at in range(0, len(data), 16):
        row = data[at : at + 16]
        if row == before and len(row) == 16:
            if out[-1] != "*":
                out.append("*")
            continue
        out.append(f"{at:08x}  {row[:8].hex(' '):<23}  {row[8:].hex(' '):<23}  |{shown(row)}|")
        before = row
    return "\n".join([*out, f"{len(data):08x}"])


def _timed(form: str, head: str = "", step: float = 1.1458) -> Style:
    """A line a byte, with its time in several units, of a decoder's table."""

    def style(log: Sequence[Message], rng: random.Random) -> str:
        out = [head] if head else []
        n = 0
        first = log[0].ms
        for m in log:
            for i, b in enumerate(m.data):
                ms = m.ms - first - 20 + i * step
                out.append(
                    form.format(
                        n=n,
                        ms=ms,
                        s=ms / 1000,
                        us=ms * 1000,
                        end=ms + 1.0417,
                        b=b,
                        cell=f"{b:X}" if b > 9 else str(b),
                        sign=chr(b) if 0x20 < b < 0x7F else ".",
                        days=46_347.4 + ms / 86_400_000,
                        comma=f"{ms / 1000:.6f}".replace(".", ","),
                        tx=f"{b:02X}" if m.sent else "",
                        rx="" if m.sent else f"{b:02X}",
                        word=word(m, "TX", "RX"),
                    )
                )
                n += 1
        return "\n".join(out)

    return style


def _explained(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    for m in log:
        d = m.data
        if m.sent and len(d) == 8:
            out.append(
                f"    Request: [{d[0]:02X}] [{d[1]:02X}] [{d[2:4].hex().upper()}] [{d[4:6].hex().upper()}] [{d[6:].hex().upper()}]"
            )
            out.append(f"             |    |    |      |      |-> CRC16 ({int.from_bytes(d[6:], 'little')})")
            out.append(f"             |    |    |-> Register Offset ({int.from_bytes(d[2:4], 'big')})")
            out.append(f"             |-> Slave ID ({d[0]})")
        else:
            out.append(f"    {word(m, 'Request', 'Response')}: " + " ".join(f"[{b:02X}]" for b in d))
    return "\n".join(out)


def _crc_swapped_note(m: Message) -> str:
    return f"{word(m, 'Master', 'Slave')}: {spaced(m.data[:-2])} + CRC {m.data[-2:].hex(' ').upper()} ({'ok' if m.sent else 'OK'})"


def _polish(log: Sequence[Message], rng: random.Random) -> str:
    return "\n".join(
        f"lis 21 {m.clock[:8]} DietPi python[4755]: MinimalModbus debug mode. {word(m, 'Will write to instrument (expecting 9 bytes back)', 'Response from instrument')}: {spaced(m.data)} ({len(m.data)} bytes)"
        for m in log
    )


def _diff(log: Sequence[Message], rng: random.Random) -> str:
    return "@@ -1,4 +1,4 @@\n" + "\n".join(f"+{word(m, 'TX', 'RX')} {spaced(m.data)}" for m in log)


def _both_ways(log: Sequence[Message], rng: random.Random) -> Iterator[str]:
    yield "Direction;Data"
    for m in log:
        yield f"{word(m, '1;', '2;')}{spaced(m.data)}"


TOOLS: Final[dict[str, Style]] = {
    "ModbusTools": lines_of(lambda m: f"21.11.2026 {m.clock} 'Boiler' {word(m, 'Tx', 'Rx')}: {spaced(m.data)} "),
    "journal in Polish": _polish,
    "ESPHome received bytes": _received_bytes,
    "ESPHome said twice": _said_twice,
    "jsmodbus": _grown,
    "interceptty quoted": lines_of(lambda m: "\n".join(f">  {word(m, '>', '<')}     0x{b:02x}" + (f" ({chr(b)})" if 0x20 < b < 0x7F else "") for b in m.data) + "\n"),
    "tokio codec": _tokio,
    "jamod last request": _jamod,
    "ModMaster": lines_of(lambda m: f"{m.clock} {word(m, '>', '<')} {m.data.hex().upper()}"),
    "Modsak monitor": lines_of(lambda m: f"{m.clock} {word(m, 'M<', 'S<')} {spaced(m.data)}"),
    "ProSoft analyzer": lines_of(lambda m: "<R+>" * m.sent + "".join(f"<{b:02X}>" if m.sent else f"[{b:02X}]" for b in m.data) + "<R->" * m.sent + "_TT_"),
    "sigrok packets": lines_of(lambda m: f"uart_packet-1: {m.ms / 1000:8.3f} {word(m, 'TX', 'RX')}: {spaced(m.data)}"),
    "sigrok classes": lines_of(lambda m: f"uart-1: {word(m, 'tx-packet', 'rx-packet')}: {spaced(m.data)}"),
    "explained in brackets": _explained,
    "Home Assistant table": lines_of(lambda m: f"{m.clock[:8]} | [D] | [uart_debug:158] | {word(m, '>>>', '<<<')} “" + "".join(chr(b) if 0x20 <= b < 0x7F and b not in (0x22, 0x5C) else {7: '\\a', 8: '\\b', 9: '\\t', 10: '\\n', 11: '\\v', 12: '\\f', 13: '\\r', 27: '\\e', 34: '\\"', 92: '\\\\'}.get(b, f'\\x{b:02X}') for b in m.data) + "” |"),
    "Serilog": lines_of(lambda m: json.dumps({"@t": f"2026-11-21T{m.clock}4567Z", "@mt": "{Dir} {Frame}", "Dir": word(m, "Sent", "Received"), "Frame": m.data.hex("-").upper(), "ThreadId": 14})),
    "log4net": lines_of(lambda m: f"2026-11-21 {m.clock.replace('.', ',')} [7] DEBUG Scada.Line.Rtu - {word(m, 'TX', 'RX')}: {m.data.hex('-').upper()}"),
    "Kepware": lines_of(lambda m: f"11/21/2026 {m.clock} AM,{word(m, 'TX', 'RX')},{len(m.data)},{spaced(m.data)}"),
    "Wonderware": lines_of(lambda m: f"[2026-11-21 {m.clock}][DASMBSerial] {word(m, 'Send', 'Receive')}:" + "".join(f"<{b:02X}>" for b in m.data)),
    "Moxa traffic": lambda log, rng: "No.  Time      Send/Receive  Port  Slave ID  Function Code  Data\n" + "\n".join(f"{i:<4d} {m.ms / 1000:<9.3f} {word(m, 'Send', 'Receive'):<13} {1:<5d} {m.data[0]:<9d} {m.data[1] & 0x7F:<14d} {spaced(m.data)}" for i, m in enumerate(log, 1)),
    "logread": lines_of(lambda m: f"Sat Nov 21 {m.clock[:8]} 2026 daemon.debug modbus_client[1234]: {word(m, 'TX', 'RX')} " + "".join(f"[{b:02X}]" for b in m.data)),
    "Wireshark array": lines_of(_packet_bytes),
    "Wireshark escapes": lines_of(_escaped_rows),
    "Wireshark stream": _follow_stream,
    "Wireshark stream arrays": _c_arrays,
    "Wireshark stream YAML": _stream_yaml,
    "netty": _netty,
    "socat -x": lines_of(lambda m: f"{word(m, '>', '<')} 2026/11/21 {m.clock}{127}  length={len(m.data)} from=0 to={len(m.data) - 1}\n {m.data.hex(' ')}\n--"),
    "strace octal": _octal_strace,
    "pyserial spy": _pyserial_spy,
    "candump": lines_of(lambda m: f" (1795255200.{m.ms % 1000:03d}123) ttyS1 {word(m, 'TX', 'RX')} [{len(m.data)}] {spaced(m.data)}"),
    "D2XX": lines_of(lambda m: f"{m.clock} {word(m, 'FT_Write', 'FT_Read')}(0x00A1B2C8, {len(m.data)}) = FT_OK: {spaced(m.data)}"),
    "Android terminal": lines_of(lambda m: f"{m.clock} {word(m, '> ', '')}{m.data.hex(' ')} "),
    "LightBlue": lines_of(lambda m: f"2026-11-21 {m.clock}, {word(m, 'Wrote', 'Notified')}: 0x{m.data.hex()}"),
    "BLE log": _ble_log,
    "ioBroker": lines_of(lambda m: f"modbus.0\t2026-11-21 {m.clock}\tdebug\t{word(m, 'Send', 'Received')}: {m.data.hex()}"),
    "ioBroker Buffer": lines_of(lambda m: f"modbus.0 (1442) {word(m, 'sending request', 'received response')} {json.dumps({'type': 'Buffer', 'data': list(m.data)})}"),
    "caret notation": lines_of(lambda m: f"{word(m, 'TX', 'RX')}: {_caret(m.data)}"),
    "grep": _grep,
    "quoted-printable": _quoted_printable,
    "HTML entities": _entities,
    "RTF": lines_of(lambda m: f"\\f0\\fs20 {word(m, 'TX', 'RX')}: {spaced(m.data)}\\par"),
    "LaTeX": lines_of(lambda m: f"{word(m, 'Request', 'Response')} & \\texttt{{{spaced(m.data)}}} \\\\"),
    "Jira": lines_of(lambda m: f"{{noformat}}{word(m, 'TX', 'RX')} {spaced(m.data)}{{noformat}}"),
    "Slack": lines_of(lambda m: f"{word(m, 'alex', 'dima')}  {m.clock[1:5]} AM\n{word(m, 'sent', 'got')} `{spaced(m.data)}` :thinking_face:\n"),
    "diff": _diff,
    "weekday clock": lines_of(lambda m: f"[Sat Nov 21 {m.clock} 2026] {word(m, 'TX', 'RX')} {spaced(m.data)}"),
    "grabserial": lines_of(lambda m: f"[{m.clock}123 {m.ms % 7 / 1000:.6f}] {m.data.hex(' ').upper()}"),
    "hexdump with *": _squeezed,
    "plus CRC": lines_of(_crc_swapped_note),
    "numbers say who": lambda log, rng: "\n".join(_both_ways(log, rng)),
    "pymodbus one line": lambda log, rng: "ERROR: No response received after 3 retries " + " ".join(f">>>>> {word(m, 'send', 'recv')}: {ox(m.data)}{word(m, '', ' extra data:')}" for m in log),
}  # fmt: skip

DECODERS: Final[dict[str, Style]] = {
    "Siglent": _timed("{n},{ms:.3f}ms,0x{b:02X},", "NO.,TIME,DATA,ERR"),
    "Rigol": _timed("{n},{s:.6e},{tx},{rx},", "No.,Time,Tx,Rx,Err"),
    "Tektronix": _timed('"{s:.9f}","{b:02X}",""', '"Time","Data (hex)","Errors"'),
    "PicoScope": _timed('{n},"{ms:.5f} ms","{end:.5f} ms",{b:02X}', "Packet,Start Time,End Time,Data"),
    "PicoScope commas": _timed("{n};{comma};{b:02X};", "Paket;Startzeit;Daten;Fehler"),
    "Acute": _timed("{n}\t{us:.2f}us\t{word}\t{b:02X}\t\t", "Label\tTimestamp\tDir\tData\tParity\tInformation"),
    "KingstVIS": _timed("{s:.9f},0x{b:02X},,", "Time [s],Value,Parity Error,Framing Error"),
    "Tektronix events": _timed("{n},{s:.9f},{b:02X},,{word}", "Index,Time,Data,Errors,Tx/Rx"),
    "Rohde & Schwarz": _timed("{n};OK;{s:.6f};{s:.6f};{b:02X}", "Frame;State;Start;Stop;Word"),
    "DSView": _timed("{n},{us:.2f},Start bit\n{n},{us:.2f},{b:02X}\n{n},{us:.2f},Stop bit", "Id,Time[us],0:UART"),
    "ZeroPlus items": _timed("{n},{us:.2f}us,{b:02X}H,{word}", "Item,TimeStamp,Data,Describe"),
    "hex under Saleae's titles": _timed("{s:.6f};{b:02X};0;0", "Time [s];Data;Parity;Framing"),
    "binary under Saleae's titles": _timed("{s:.6f},{b:08b}", "Time [s],Value"),
    "units in cells": _timed("{ms:.3f} ms,{b:02X}", "Start,Data"),
    "zeros that a spreadsheet lost": _timed("{ms:.3f},{cell}", "Time (ms),Byte"),
    "characters before hex": _timed("{s:.6f},{sign},{b:02X}", "Time,ASCII,Hex"),
    "data before the time": _timed("{b:02X},{us:.0f}", "Data,Time [us]"),
    "decimals before the time": _timed("{b};{ms:.3f}", "Byte;Time [ms]"),
    "days of a spreadsheet": _timed("{days:.10f};{b:02X}", "Time;Data"),
    "no titles": _timed("{n};{s:.6f};{b:02X}"),
    "ZeroPlus": _timed("{n:5d} | {us:12.1f} us | DATA | {b:02X}"),
}  # fmt: skip
