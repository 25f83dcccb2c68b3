"""Conversations on a bus as people paste them: known frames written as tools, libraries, terminals and people write them.

A `Style` renders messages as text; `clutter` is what stands between in real pastes and is no bytes. All of it is made
here from a random number generator; nothing is anybody's text.
"""

from __future__ import annotations

import base64
import json
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from dissectors.crc import crc_bytes, lrc


@dataclass(frozen=True)
class Message:
    """A frame on the wire: `sent` by the client (a request), and when, in ms."""

    data: bytes
    sent: bool
    ms: int

    @property
    def role(self) -> str:
        return "request" if self.sent else "response"

    @property
    def clock(self) -> str:
        seconds, ms = divmod(self.ms, 1000)
        minutes, seconds = divmod(seconds, 60)
        return f"{10 + minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}.{ms:03d}"


def conversation(rng: random.Random, exchanges: int) -> list[tuple[bytes, bytes]]:
    """Requests with their answers, each as unit and PDU."""
    unit = rng.choice((1, 1, 1, 2, 5, 17, 32, 100, 247))
    pairs = []
    for _ in range(exchanges):
        function = rng.choice((3, 3, 3, 3, 4, 4, 1, 2, 5, 6, 15, 16))
        address = rng.choice((0, 0, 1, 16, 107, 256, 1000, 0x1000, 40000))
        head = bytes((unit, function)) + address.to_bytes(2, "big")
        count = rng.choice((1, 1, 2, 2, 3, 4, 6, 10, 24))
        values = b"".join(
            rng.choice((0, rng.randrange(300), rng.randrange(65536))).to_bytes(2, "big") for _ in range(count)
        )
        if rng.random() < 0.08 and function < 5:
            pairs.append((head + count.to_bytes(2, "big"), bytes((unit, function | 0x80, rng.choice((1, 2, 3, 4))))))
        elif function in (3, 4):
            pairs.append((head + count.to_bytes(2, "big"), bytes((unit, function, 2 * count)) + values))
        elif function in (1, 2):
            packed = values[: (count + 7) // 8]
            pairs.append((head + count.to_bytes(2, "big"), bytes((unit, function, len(packed))) + packed))
        elif function in (5, 6):
            request = head + (rng.choice((b"\xff\x00", b"\0\0")) if function == 5 else values[:2])
            pairs.append((request, request))
        else:
            data = values if function == 16 else values[: (count + 7) // 8]
            request = head + count.to_bytes(2, "big") + bytes((len(data),)) + data
            pairs.append((request, head + count.to_bytes(2, "big")))
    return pairs


def messages(rng: random.Random, exchanges: int, envelope: str = "rtu") -> list[Message]:
    """A conversation in an envelope, with times."""
    out = []
    ms = rng.randrange(10**6)
    transaction = rng.randrange(1, 3000)
    for request, answer in conversation(rng, exchanges):
        for pdu, sent in ((request, True), (answer, False)):
            ms += rng.randrange(8, 80) if not sent else rng.randrange(100, 1000)
            out.append(Message(wrapped(pdu, envelope, transaction), sent, ms))
        transaction += 1
    return out


def wrapped(pdu: bytes, envelope: str, transaction: int) -> bytes:
    """Unit and PDU in an envelope; ASCII as its characters."""
    if envelope == "tcp":
        return transaction.to_bytes(2, "big") + b"\0\0" + len(pdu).to_bytes(2, "big") + pdu
    if envelope == "ascii":
        return b":" + (pdu + bytes((lrc(pdu),))).hex().upper().encode() + b"\r\n"
    return pdu + crc_bytes(pdu)


Style = Callable[[Sequence[Message], random.Random], str]


def spaced(data: bytes) -> str:
    return data.hex(" ").upper()


def lines_of(form: Callable[[Message], str]) -> Style:
    """A line a message."""
    return lambda log, rng: "\n".join(form(message) for message in log)


def word(message: Message, sent: str, received: str) -> str:
    return sent if message.sent else received


def ox(data: bytes) -> str:
    return " ".join(f"0x{byte:x}" for byte in data)


def shown(data: bytes) -> str:
    return "".join(chr(byte) if 0x20 < byte < 0x7F else "." for byte in data)


def dump(data: bytes, form: Callable[[int, bytes], str]) -> str:
    return "\n".join(form(at, data[at : at + 16]) for at in range(0, len(data), 16))


def _esp_row(message: Message, base: int) -> Callable[[int, bytes], str]:
    head = f"D ({message.ms}) {word(message, 'tx', 'rx')}: "
    return lambda at, row: f"{head}0x{base + at:x}   {row[:8].hex(' ')}  {row[8:].hex(' '):<23}  |{shown(row)}|"


def _timed_row(message: Message, base: int) -> Callable[[int, bytes], str]:
    return lambda at, row: f"2026-05-01 {message.clock}  {base + at:08x}  {spaced(row):<48} |{shown(row)}|"


def _pymodbus_old(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    for message in log:
        head = f"2026-0{rng.randrange(1, 9)}-11 {message.clock.replace('.', ',')} MainThread DEBUG transaction    :"
        if message.sent:
            out += [
                head + "111 Current transaction state - TRANSACTION_COMPLETE",
                head + f"116 Running transaction {rng.randrange(99)}",
            ]
            out += [
                head + f"215 SEND: {ox(message.data)}",
                head + "145 Changing transaction state from 'SENDING' to 'WAITING FOR REPLY'",
            ]
        else:
            out += [head + f"292 RECV: {ox(message.data)}", head + f"190 Getting Frame - {ox(message.data[1:-2])}"]
            out += [
                head + "152 Frame advanced, resetting header!!",
                head + f"454 Adding transaction {rng.randrange(9)}",
            ]
    return "\n".join(out)


def _pymodbus_new(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    for message in log:
        head = f"2026-03-11 {message.clock.replace('.', ',')} DEBUG logging:103 "
        if message.sent:
            out += [head + "Current transaction state - IDLE", head + f"send: {ox(message.data)}"]
        else:
            out += [head + f"recv: {ox(message.data)} old_data:  addr=None", head + f"Processing: {ox(message.data)}"]
            out += [head + f"Factory Response[ReadHoldingRegistersResponse': {rng.randrange(1, 9)}]"]
    return "\n".join(out)


def _pymodbus_trace(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    out = []
    for message in log:
        out.append(f"DEBUG:pymodbus.logging:{word(message, '>>>>> send', '>>>>> recv')}: {ox(message.data)}")
        out.append(
            "DEBUG:pymodbus.logging:Callback called: waiting for more"
            if message.sent
            else "DEBUG:pymodbus.logging:No frame - wait for data"
        )
    return "\n".join(out)


def _repr(data: bytes) -> str:
    return repr(data)[1:]


def _minimal(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    old = rng.random() < 0.5
    for message in log:
        text = repr(message.data.decode("latin-1")) if old else _repr(message.data)
        what = "Will write to instrument (expecting 9 bytes back)" if message.sent else "Response from instrument"
        tail = (
            ""
            if message.sent
            else f" ({len(message.data)} bytes), roundtrip time: {rng.random() * 90:.1f} ms. Timeout for reading: 50.0 ms."
        )
        out.append(f"MinimalModbus debug mode. {what}: {text} ({spaced(message.data)}){tail}")
        if message.sent:
            out.append("MinimalModbus debug mode. Clearing serial buffers for port /dev/ttyUSB0")
            out.append(
                f"MinimalModbus debug mode. No sleep required before write. Time since previous read: {rng.random() * 3e4:.2f} ms, minimum silent period: 4.01 ms."
            )
    return "\n".join(out)


def _libmodbus(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    out = ["Opening /dev/ttyUSB0 at 9600 bauds (N, 8, 1)"]
    for message in log:
        pair = "[{}]" if message.sent else "<{}>"
        out.append("".join(pair.format(f"{byte:02X}") for byte in message.data))
        if message.sent:
            out.append("Waiting for a confirmation...")
    return "\n".join(out)


def _emodbus_packets(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    tick = rng.randrange(1000, 9999)
    for message in log:
        tick += 31
        data = message.data
        out.append(
            f"[D] {tick}| ModbusClientRTU.cpp  [ {rng.randrange(100, 300)}] handleConnection: Pulled request from queue"
        )
        words = (
            [("Request packet", data)]
            if message.sent
            else [("Raw buffer received", data), ("Received packet", data[:-2])]
        )
        for what, some in words:
            out.append(f"[V] {what}: @3FFB{rng.randrange(4096, 65536):X}/{len(some)}:")
            out.append(
                dump(
                    some, lambda at, row: f"  | {at:04X}: {spaced(row[:8])}  {spaced(row[8:]):<24}  |{shown(row):<16}|"
                )
            )
    return "\n".join(out)


def _emodbus_bytes(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    tick = rng.randrange(1000, 99999)
    for message in log:
        for i, byte in enumerate(message.data, 1):
            tick += rng.randrange(1, 6)
            way = "send" if message.sent else "receive"
            out.append(f"[N] {tick}| RTUutils.cpp         [ {292 if message.sent else 298}] {way}: {i:3d}: {byte:02X}")
        out.append(f"[N] {tick + 40}| RTUutils.cpp         [ 301] receive: tick!")
    return "\n".join(out)


def _arduino(form: Callable[[int], str], between: str, names: tuple[str, str]) -> Style:
    def style(log: Sequence[Message], rng: random.Random) -> str:
        stamped = rng.random() < 0.4
        out = []
        for message in log:
            text = word(message, *names) + between.join(form(byte) for byte in message.data)
            out.append(f"{message.clock} -> {text}" if stamped else text)
        return "\n".join(out)

    return style


def _byte_lines(form: Callable[[int, int, Message], str], head: Callable[[Message], str] | None = None) -> Style:
    """A byte a line: `form` of its number, its value and its message."""

    def style(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
        out = []
        for message in log:
            if head is not None:
                out.append(head(message))
            out += [form(i, byte, message) for i, byte in enumerate(message.data)]
        return "\n".join(out)

    return style


_NAMES: Final = (
    "Slave address", "Function code", "Start address high", "Start address low", "Quantity high", "Quantity low",
    "CRC low", "CRC high",
)  # fmt: skip


def _manual(form: str) -> Style:
    """The fields of a request, as a manual explains them."""

    def style(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
        return "\n\n".join(
            "\n".join(
                form.format(name=name, byte=byte, n=i)
                for i, (name, byte) in enumerate(zip(_NAMES, m.data, strict=False), 1)
            )
            for m in log
            if m.sent and len(m.data) == len(_NAMES)
        )

    return style


def _under(head: Callable[[Message], str], body: Callable[[bytes], str], gap: str = "\n") -> Style:
    """A heading line, and the bytes below it."""
    return lambda log, rng: "\n".join(head(message) + gap + body(message.data) for message in log)


def _wrapped_rows(count: int) -> Callable[[bytes], str]:
    return lambda data: "\n".join(data[at : at + count].hex(" ") for at in range(0, len(data), count))


def _asyn(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    out = []
    for message in log:
        out.append(f"2026/05/11 {message.clock} plc{1}:502 {word(message, 'write', 'read')} {len(message.data)}\n")
        out.append(_wrapped_rows(20)(message.data))
    return "\n".join(out)


def _asyn_escaped(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    out = []
    for message in log:
        text = "".join(_octal(byte) for byte in message.data)
        out.append(f"2026/05/11 {message.clock} K1:4001 {word(message, 'write', 'read')} {len(message.data)}\n{text}")
    return "\n".join(out)


def _octal(byte: int) -> str:
    simple = {
        7: "\\a",
        8: "\\b",
        9: "\\t",
        10: "\\n",
        11: "\\v",
        12: "\\f",
        13: "\\r",
        92: "\\\\",
        34: '\\"',
        39: "\\'",
    }
    return simple.get(byte) or (chr(byte) if 0x20 <= byte < 0x7F else f"\\{byte:03o}")


def _signed(data: bytes) -> str:
    return ", ".join(str(byte - 256 if byte > 127 else byte) for byte in data)


def _words(data: bytes) -> str:
    return " ".join(data[i : i + 2].hex() for i in range(0, len(data), 2))


def _swapped_words(data: bytes) -> str:
    rows = []
    for at in range(0, len(data), 16):
        row = data[at : at + 16]
        row += b"\0" * (len(row) % 2)
        rows.append(f"{at:07x} " + " ".join(f"{row[i + 1]:02x}{row[i]:02x}" for i in range(0, len(row), 2)))
    return "\n".join([*rows, f"{len(data):07x}"])


def _c_array(log: Sequence[Message], rng: random.Random) -> str:
    wide = rng.choice((6, 8, 12, 99))
    out = []
    for i, message in enumerate(log):
        body = [f"0x{byte:02X}" for byte in message.data]
        rows = [", ".join(body[at : at + wide]) for at in range(0, len(body), wide)]
        out.append(
            f"static const uint8_t {word(message, 'req', 'rsp')}_{i}[{len(body)}] = {{\n    "
            + ",\n    ".join(rows)
            + "\n};"
        )
    return "\n".join(out)


def _socat(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    out = []
    for message in log:
        out.append(
            f"{word(message, '>', '<')} 2026/11/21 {message.clock}{345}  length={len(message.data)} from=0 to={len(message.data) - 1}"
        )
        out.append(dump(message.data, lambda at, row: f" {row.hex(' '):<48} {shown(row)}"))
        out.append("--")
    return "\n".join(out)


def _strace(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    out = []
    for message in log:
        text = "".join(f"\\x{byte:02x}" for byte in message.data)
        call = f'write(3, "{text}", {len(message.data)})' if message.sent else f'read(3, "{text}", 256)'
        out += [
            f"17000{message.ms / 1000:011.6f} {call} = {len(message.data)}",
            f"17000{message.ms / 1000:011.6f} select(4, [3], NULL, NULL, {{tv_sec=0, tv_usec=500000}}) = 1 (in [3])",
        ]
    return "\n".join(out)


def _json_log(log: Sequence[Message], rng: random.Random) -> str:
    return "\n".join(
        json.dumps(
            {
                "ts": 1700000000000 + m.ms,
                "level": "debug",
                "dir": word(m, "tx", "rx"),
                "len": len(m.data),
                "raw": list(m.data),
                "temp": round(rng.random() * 40, 2),
            }
        )
        for m in log
    )


def _node(log: Sequence[Message], rng: random.Random) -> str:
    out = []
    for message in log:
        action = word(message, "send serial rtu buffered", "receive serial rtu buffered port")
        out.append(f"  modbus-serial {{ action: '{action}',")
        out.append(f"  modbus-serial   data: <Buffer {message.data.hex(' ')}>,")
        out.append(
            f"  modbus-serial   unitid: {message.data[0]}, functionCode: {message.data[1] & 0x7F} }} +{rng.randrange(99)}ms"
        )
        if rng.random() < 0.5:
            out.append(
                "  modbus-serial "
                + json.dumps(
                    {
                        "action": action,
                        "data": {"type": "Buffer", "data": list(message.data)},
                        "unitid": message.data[0],
                    },
                    separators=(",", ":"),
                )
                + f" +{rng.randrange(9)}ms"
            )
    return "\n".join(out)


def _html(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    rows = "\n".join("<tr><td>" + "</td><td>".join(f"{byte:02X}" for byte in m.data) + "</td></tr>" for m in log)
    return f"<table>\n<tr><th>frame</th></tr>\n{rows}\n</table>"


def _saleae_like(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    out = ["Id;Time[us];RX"]
    at, i = 100.0, 0
    for message in log:
        at += 5000
        for byte in message.data:
            at += 1041.7
            i += 1
            out.append(f"{i};{at:.2f};{byte:02X}")
    return "\n".join(out)


def _prose(log: Sequence[Message], rng: random.Random) -> str:  # noqa: ARG001
    out = ["I am trying to read my meter with a USB adapter at 9600 baud, 8N1."]
    for message in log:
        tick = "`"
        out.append(
            f"When I send {tick}{spaced(message.data)}{tick} from the PC (3 times, every 500 ms) I see this:"
            if message.sent
            else f"the device replies with {message.data.hex(' ')} after about 20 ms."
        )
    return "\n".join(out)


def _pair_on_a_line(log: Sequence[Message], rng: random.Random) -> str:
    arrow = rng.choice((" -> ", " => ", " | ", " → ", "  RX: "))
    out = []
    for request, answer in zip(log[::2], log[1::2], strict=True):
        out.append(f"TX: {spaced(request.data)}{arrow}{spaced(answer.data)}")
    return "\n".join(out)


def _numbered(log: Sequence[Message], rng: random.Random) -> str:
    n = rng.randrange(1, 90)
    return "\n".join(f"{n + i:4d}  {word(m, 'TX', 'RX')}  {spaced(m.data)}" for i, m in enumerate(log))


def _two_words(log: Sequence[Message], sent: str, received: str, form: str) -> str:
    return "\n".join(
        form.format(word=word(m, sent, received), hex=spaced(m.data), low=m.data.hex(" "), clock=m.clock, n=len(m.data))
        for m in log
    )


def _in_words(sent: str, received: str, form: str = "{word}: {hex}") -> Style:
    return lambda log, rng: _two_words(log, sent, received, form)


STYLES: Final[dict[str, Style]] = {
    "plain": lines_of(lambda m: spaced(m.data)),
    "plain lower": lines_of(lambda m: m.data.hex(" ")),
    "compact": lines_of(lambda m: m.data.hex()),
    "compact upper with words": lines_of(lambda m: f"{word(m, 'Send', 'Receive')}: {m.data.hex().upper()}"),
    "tx rx": _in_words("TX", "RX"),
    "Tx Rx tight": _in_words("Tx", "Rx", "{word}:{hex}"),
    "arrows": _in_words(">>", "<<", "{clock} {word} {hex}"),
    "brackets": _in_words("TX", "RX", "[{clock}] [{word}] {hex}"),
    "count and bytes": _in_words("Sent", "Received", "{clock} {word} {n} bytes: {low}"),
    "Russian": _in_words("Отправлено", "Принято", "{clock} {word} ({n} байт): {hex}"),
    "Russian request": _in_words("Запрос", "Ответ", "{word}:  {hex}"),
    "German": _in_words("Gesendet", "Empfangen", "{clock} - {word}: {hex}"),
    "German asks": _in_words("Anfrage", "Antwort", "{word} = {hex}"),
    "French": _in_words("Trame envoyée", "Trame reçue", "{word} : {hex}"),
    "French asks": _in_words("Requête", "Réponse", "[{clock}] {word} -> {low}"),
    "Spanish": _in_words("Enviado", "Recibido", "{word}: {hex}"),
    "Spanish asks": _in_words("Solicitud", "Respuesta", "{word} ({n} bytes): {hex}"),
    "Portuguese": _in_words("Enviando", "Recebido", "{word}: {hex}"),
    "Italian": _in_words("Richiesta", "Risposta"),
    "Polish": _in_words("Wysłano", "Odebrano", "{clock} {word}: {low}"),
    "Turkish": _in_words("Gönderilen", "Gelen"),
    "Chinese": _in_words("发送", "接收", "[{clock}]{word}：{hex}"),
    "Chinese asks": _in_words("主机发送", "从机应答", "{word}： {hex}"),
    "SSCOM": _in_words("发→◇", "收←◆", "[{clock}]{word}{hex} □"),
    "Japanese": _in_words("送信", "受信", "{clock} {word}: {hex}"),
    "Korean": _in_words("송신", "수신", "{word} : {hex}"),
    "Docklight": _in_words("[TX]", "[RX]", "21.11.2026 {clock} {word} - {hex}"),
    "Modbus Poll": lambda log, rng: "\n".join(f"{word(m, 'Tx', 'Rx')}:{rng.randrange(10**6):06d}-{spaced(m.data)}" for m in log),
    "QModMaster": lines_of(lambda m: f"[RTU]>{word(m, 'Tx', 'Rx')} > {m.clock.replace('.', ':')} : {spaced(m.data).replace(' ', '  ')}  "),
    "ModScan": lines_of(lambda m: "".join(f"[{byte:03d}]" for byte in m.data)),
    "CAS": _in_words("Poll", "Response", "[{clock}] => {word}: {low}"),
    "KEPServer": _in_words("TX", "RX", "21/11/2026 {clock}\t{word}\t{n}\t{hex} "),
    "Simply Modbus": _in_words("Command", "Response", "{word}  {hex}"),
    "ox": lines_of(lambda m: ox(m.data)),
    "ox commas": lines_of(lambda m: ", ".join(f"0x{byte:02X}" for byte in m.data)),
    "pymodbus 2": _pymodbus_old,
    "pymodbus 3": _pymodbus_new,
    "pymodbus 3 trace": _pymodbus_trace,
    "minimalmodbus": _minimal,
    "libmodbus": _libmodbus,
    "modbus-tk hex": lines_of(lambda m: f"DEBUG:modbus_tk:{word(m, '->', '<-')} {m.data.hex('-')}"),
    "modbus-tk decimal": lines_of(lambda m: f"2026-01-02 {m.clock} DEBUG modbus_rtu.__init__ {word(m, '->', '<-')} {'-'.join(map(str, m.data))}"),
    "NModbus": lines_of(lambda m: f"{word(m, 'TX', 'RX')}: {', '.join(map(str, m.data))}"),
    "EasyModbus": lines_of(lambda m: f"21.11.2026 {m.clock[:8]} {word(m, 'Send Serial-Data', 'Receive Serial-Data')}: {spaced(m.data).replace(' ', '-')}"),
    "jamod": lines_of(lambda m: f"[Thread-{m.ms % 9}] DEBUG net.wimpi.modbus.io.ModbusRTUTransport - {word(m, 'Sent', 'Received')}: {m.data.hex(' ')} "),
    "j2mod": lines_of(lambda m: f"{m.clock} [main] DEBUG c.g.j2mod.modbus.io.ModbusRTUTransport - {word(m, 'Wrote', 'Read')}: {spaced(m.data)}"),
    "modbus4j": lines_of(lambda m: f"MessagingConnection.{word(m, 'write', 'read')}: [{','.join(f'{b:x}' for b in m.data)}]"),
    "Node debug": _node,
    "Node tx rx": lines_of(lambda m: f"{word(m, '[tx]', '[rx]')} <Buffer {m.data.hex(' ')}>"),
    "Uint8Array": lines_of(lambda m: f"{word(m, 'sending', 'received')} Uint8Array({len(m.data)}) [{', '.join(map(str, m.data))}]"),
    "Node-RED": _byte_lines(lambda i, b, m: f"{i}: 0x{b:x}", lambda m: f"{word(m, 'request', 'response')} : buffer[{len(m.data)}]"),
    "ESPHome modbus": lines_of(lambda m: f"[{m.clock}][V][modbus:{word(m, '258', '199')}]: {word(m, 'Modbus write', 'Modbus recv')}: {spaced(m.data).replace(' ', '.')} ({len(m.data)})"),
    "ESPHome uart": lines_of(lambda m: f"[{m.clock}][D][uart_debug:114]: {word(m, '>>>', '<<<')} {spaced(m.data).replace(' ', ':')}"),
    "ESP-IDF hex": lines_of(lambda m: f"I ({m.ms}) MB_{word(m, 'TX', 'RX')}: {m.data.hex(' ')}"),
    "ESP-IDF dump": lambda log, rng: "\n".join(dump(m.data, _esp_row(m, rng.randrange(0x3FFB0000, 0x3FFBF000))) for m in log),
    "Zephyr": _under(lambda m: f"[00:00:{m.ms // 1000 % 60:02d}.{m.ms % 1000:03d},000] <dbg> modbus_serial: {word(m, 'tx', 'rx')}_frame", lambda data: dump(data, lambda at, row: " " * 35 + f"{row[:8].hex(' ')}  {row[8:].hex(' '):<23} |{shown(row)}")),
    "Serial.print HEX": _arduino(lambda b: f"{b:X}", " ", ("TX: ", "RX: ")),
    "Serial.print HEX commas": _arduino(lambda b: f"{b:x}", ",", ("Request ", "Response ")),
    "Serial.print 0x": _arduino(lambda b: f"0x{b:X}", " ", ("-> ", "<- ")),
    "Serial.print brackets": _arduino(lambda b: f"[{b:02X}]", "", ("Sent: ", "Got: ")),
    "Arduino decimal": _arduino(str, " ", ("out: ", "in: ")),
    "eModbus packets": _emodbus_packets,
    "eModbus bytes": _emodbus_bytes,
    "interceptty": _byte_lines(lambda i, b, m: f"{word(m, '>', '<')} \t0x{b:02x}"),
    "print_r": _byte_lines(lambda i, b, m: f"    [{i}] => {b}", lambda m: f"{word(m, 'request', 'response')} Array\n("),
    "byte statements": _byte_lines(lambda i, b, m: f"  {word(m, 'tx', 'rx')}Buf[{i}] = 0x{b:02X};"),
    "CODESYS": _byte_lines(lambda i, b, m: f"\t{word(m, 'abySend', 'abyRecv')}[{i}]\tBYTE\t16#{b:02X}"),
    "TIA": _byte_lines(lambda i, b, m: f'"DB_Modbus".{word(m, "tx", "rx")}[{i}]  Byte  B#16#{b:02X}'),
    "16#": lines_of(lambda m: f"{word(m, 'send', 'recv')} := [{', '.join(f'16#{b:02X}' for b in m.data)}];"),
    "pretty JSON": _byte_lines(lambda i, b, m: f"    {b}{'' if i == len(m.data) - 1 else ','}", lambda m: f'  ],\n  "{word(m, "request", "response")}": ['),
    "goburrow": lines_of(lambda m: f"2026/11/21 {m.clock[:8]} modbus: {word(m, 'sending', 'received')} {m.data.hex(' ')}"),
    "evcc": lines_of(lambda m: f"[modbus] TRACE 2026/11/21 {m.clock[:8]} modbus: {word(m, 'send', 'recv')} {m.data.hex(' ')}"),
    "python list": lines_of(lambda m: f"{word(m, 'tx', 'rx')} = {list(m.data)}"),
    "python hex strings": lines_of(lambda m: str([f"{b:02x}" for b in m.data])),
    "python ox strings": lines_of(lambda m: str([hex(b) for b in m.data])),
    "python bytes": lines_of(lambda m: f"{word(m, 'Sent', 'Received')}: {m.data!r}"),
    "python bytearray": lines_of(lambda m: f"{word(m, 'write', 'read')}({bytearray(m.data)!r})"),
    "python fromhex": lines_of(lambda m: f'{word(m, "request", "reply")} = bytes.fromhex("{m.data.hex()}")'),
    "numpy": lines_of(lambda m: "[" + " ".join(f"{b:3d}" for b in m.data) + "]"),
    "C array": _c_array,
    "C escapes": lines_of(lambda m: f'{word(m, "send", "expect")}("' + "".join(f"\\x{b:02x}" for b in m.data) + f'", {len(m.data)});'),
    "Java casts": lines_of(lambda m: "byte[] " + word(m, "cmd", "ans") + " = {" + ", ".join(f"(byte) 0x{b:02X}" if b > 127 else f"0x{b:02X}" for b in m.data) + "};"),
    "Java signed": lines_of(lambda m: f"{word(m, 'Sending', 'Received')} [{_signed(m.data)}]"),
    "C#": lines_of(lambda m: f"{word(m, 'Request', 'Response')}: {spaced(m.data).replace(' ', '-')}"),
    "Go": lines_of(lambda m: f"{word(m, 'send', 'recv')} [{' '.join(map(str, m.data))}]"),
    "Go syntax": lines_of(lambda m: "[]byte{" + ", ".join(f"0x{b:x}" for b in m.data) + "}"),
    "Rust": lines_of(lambda m: f"[DEBUG serial] {word(m, 'tx', 'rx')}: [{', '.join(f'{b:02x}' for b in m.data)}]"),
    "Rust pretty": _byte_lines(lambda i, b, m: f"    0x{b:02x},", lambda m: f"]\n{word(m, 'request', 'response')} = ["),
    "Rust bytes": lines_of(lambda m: f'{word(m, "Encoded", "Decoded")} b"' + "".join("\\0" if b == 0 else chr(b) if 0x20 <= b < 0x7F and b not in (0x22, 0x5C) else f"\\x{b:02x}" for b in m.data) + '"'),
    "Lua": lines_of(lambda m: f'{word(m, "tx", "rx")} = "' + "".join(f"\\{b:03d}" for b in m.data) + '"'),
    "Elixir": lines_of(lambda m: f"{word(m, 'send', 'recv')} <<{', '.join(map(str, m.data))}>>"),
    "JS unicode": lines_of(lambda m: f"{word(m, 'write', 'data')} " + json.dumps(m.data.decode("latin-1"))),
    "JSON arrays": _json_log,
    "base64": lines_of(lambda m: json.dumps({"dir": word(m, "down", "up"), "payload": base64.b64encode(m.data).decode()})),
    "Hercules": lines_of(lambda m: "".join(f"{{{b:02X}}}" for b in m.data)),
    "YAT": lines_of(lambda m: f"({m.clock}) ({word(m, '>>', '<<')}) {' '.join(f'{b:02X}h' for b in m.data)}"),
    "Pascal": lines_of(lambda m: f"{word(m, 'Req', 'Rsp')}: array of Byte = ({', '.join(f'${b:02X}' for b in m.data)});"),
    "Basic": lines_of(lambda m: f"' {word(m, 'TX', 'RX')} {', '.join(f'&H{b:02X}' for b in m.data)}"),
    "URL": lines_of(lambda m: f"POST /serial?{word(m, 'tx', 'rx')}=" + "".join(f"%{b:02X}" for b in m.data)),
    "xxd": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:08x}: {row.hex(' ', -2):<40} {shown(row)}")),
    "hexdump -C": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:08x}  {row[:8].hex(' ')}  {row[8:].hex(' '):<23}  |{shown(row)}|")),
    "hexdump": lines_of(lambda m: _swapped_words(m.data)),
    "od": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:07o} {row.hex(' ')}") + f"\n{len(m.data):07o}"),
    "Wireshark": lines_of(lambda m: dump(m.data, lambda at, row: f"{at:04x}   {row[:8].hex(' ')}  {row[8:].hex(' '):<23}   {shown(row)}")),
    "dump after time": lambda log, rng: "\n".join(dump(m.data, _timed_row(m, rng.randrange(1 << 20))) for m in log),
    "words": lines_of(lambda m: _words(m.data)),
    "CSV hex": lines_of(lambda m: f"2026-07-27T{m.clock},CH{1 + m.sent},{word(m, 'TX', 'RX')},{spaced(m.data)}"),
    "CSV semicolons": lambda log, rng: "No;Time;Dir;Len;Data\n" + "\n".join(f"{i};{m.clock};{word(m, 'TX', 'RX')};{len(m.data)};{m.data.hex()}" for i, m in enumerate(log, rng.randrange(50))),
    "CSV of bytes": _saleae_like,
    "key value": lines_of(lambda m: f"DATE=2026-11-05T{m.clock};FRAME={spaced(m.data).replace(' ', '-')};CRC=OK;CRC_VAL=0x{m.data[:-3:-1].hex().upper()};SLAVE=0x{m.data[0]:02X};FC=0x{m.data[1]:02X};"),
    "HTML": _html,
    "markdown table": lambda log, rng: "| dir | bytes | n |\n|---|---|---|\n" + "\n".join(f"| {word(m, 'request', 'response')} | `{spaced(m.data)}` | {len(m.data)} |" for m in log),
    "markdown cells": lambda log, rng: "\n".join("| " + " | ".join(f"{b:02X}" for b in m.data) + " |" for m in log),
    "manual": _manual("{name}: {byte:02X}"),
    "manual h": _manual("{n}  {name:<22} {byte:02X}h"),
    "manual 0x": _manual("0x{byte:02X} - {name}"),
    "manual table": _manual("| {name} | {byte:02X} |"),
    "manual columns": _manual("{name:<24}{byte:02X}"),
    "quoted chat": lines_of(lambda m: f"> {word(m, 'TX', 'RX')}: {spaced(m.data)}"),
    "quoted twice": lines_of(lambda m: f"> > {word(m, 'Sent', 'Received')} {m.data.hex(' ')}"),
    "comment block": lines_of(lambda m: f" * {word(m, 'Tx', 'Rx')}: {spaced(m.data)}   // {len(m.data)} bytes"),
    "slashes": lines_of(lambda m: f"// {word(m, 'send', 'answer')}: {m.data.hex(' ')}"),
    "hashes": lines_of(lambda m: f"# {word(m, 'SEND', 'RECV')}: {ox(m.data)}"),
    "semicolons": lines_of(lambda m: f"; {word(m, 'request', 'response')}  {spaced(m.data)}"),
    "SQL comments": lines_of(lambda m: f"-- {word(m, 'request', 'response')} {spaced(m.data)}"),
    "socat": _socat,
    "strace": _strace,
    "jpnevulator": lines_of(lambda m: f"2026-11-21 {m.clock}009: {word(m, 'master', 'slave')}\n" + "\n".join(spaced(m.data[at : at + 16]) for at in range(0, len(m.data), 16))),
    "asyn": _asyn,
    "asyn escapes": _asyn_escaped,
    "under headings": _under(lambda m: f"[{m.clock}]# {word(m, 'SEND', 'RECV')} HEX>", spaced),
    "under words": _under(lambda m: f"{word(m, 'Request', 'Response')}:", spaced),
    "under code fence": _under(lambda m: f"{word(m, 'Request', 'Response')}\n```", lambda data: spaced(data) + "\n```"),
    "wrapped rows": _under(lambda m: f"{m.clock} {word(m, 'TX', 'RX')} {len(m.data)} bytes", _wrapped_rows(16)),
    "prose": _prose,
    "pair on a line": _pair_on_a_line,
    "numbered": _numbered,
    "said twice": lines_of(lambda m: f"Parsing RTU frame: {m.data.hex(' ')}\nframe is {m.role}\n<Frame ({m.role}): device: {m.data[0]}, func: {m.data[1]}, frame:{m.data.hex(' ')}>"),
    "double backticks": lines_of(lambda m: f"{word(m, 'command', 'result')} ``{spaced(m.data)}`` for the meter"),
    "ms bar": lines_of(lambda m: f"[RS-485] {m.ms} ms | {len(m.data)} bytes: {spaced(m.data)} | ASCII: {shown(m.data)}"),
    "mqtt": lines_of(lambda m: f"zigbee/serial/{word(m, 'set', 'get')} {m.data.hex()}"),
    "printf of chars": lines_of(lambda m: f"{word(m, 'tx', 'rx')}: " + " ".join(f"{b if b < 128 else 0xFFFFFF00 + b:02x}" for b in m.data)),
    "printf 0x of chars": lines_of(lambda m: f"{word(m, 'tx', 'rx')}: " + ", ".join(f"0x{b if b < 128 else 0xFFFFFF00 + b:x}" for b in m.data)),
    "escaped twice": lines_of(lambda m: json.dumps({"msg": f"{word(m, 'write', 'read')} {m.data!r}", "n": len(m.data)})),
    "hexyl": lines_of(lambda m: dump(m.data, lambda at, row: f"│{at:08x}│ {row[:8].hex(' '):<23} ┊ {row[8:].hex(' '):<23} │{shown(row[:8])}┊{shown(row[8:])}│")),
    "x": lines_of(lambda m: f"{word(m, 'TX', 'RX')} " + "".join(f"x{b:02x}" for b in m.data)),
    "backslash 0x": lines_of(lambda m: "".join(f"\\0x{b:02x}" for b in m.data)),
    "check value apart": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')} data: {spaced(m.data[:-2])}, CRC: {spaced(m.data[-2:])}"),
    "check value as number": lines_of(lambda m: f"{word(m, 'Tx', 'Rx')}: {spaced(m.data[:-2])} CRC=0x{m.data[:-3:-1].hex().upper()} OK"),
    "NSData": lines_of(lambda m: f"{word(m, 'write', 'notify')} <{' '.join(m.data[i : i + 4].hex() for i in range(0, len(m.data), 4))}>"),
    "JSON pair": lambda log, rng: "\n".join(json.dumps({"id": i, "request": a.data.hex(), "response": b.data.hex(), "ms": round(rng.random() * 50, 3)}) for i, (a, b) in enumerate(zip(log[::2], log[1::2], strict=True))),
    "wrapped in the middle": lines_of(lambda m: f"DEBUG:pymodbus.transaction:{word(m, 'SEND', 'RECV')}: {ox(m.data[:4])}\n{ox(m.data[4:])}"),
    "xxd -p": lines_of(lambda m: "\n".join(m.data[at : at + 30].hex() for at in range(0, len(m.data), 30))),
    "colons at the end": lines_of(lambda m: f"{word(m, 'Query', 'Reply')} " + "".join(f"{b:X}:" for b in m.data)),
    "tabs": lines_of(lambda m: f"{m.clock}\t{word(m, 'TX', 'RX')}\t" + "\t".join(f"{b:02X}" for b in m.data)),
    "quoted bytes": lines_of(lambda m: f"{word(m, 'out', 'in')}: " + " ".join(f"'{b:02x}'" for b in m.data)),
    "fields": lines_of(lambda m: f"ID={m.data[0]:02X} FC={m.data[1]:02X} DATA={m.data[2:-2].hex().upper()} CRC={m.data[-2:].hex().upper()}" if len(m.data) == 8 else f"{word(m, 'TX', 'RX')} {spaced(m.data)}"),
    "binary": lines_of(lambda m: " ".join(f"{b:08b}" for b in m.data)),
    "struct": lines_of(lambda m: f"struct.unpack('{len(m.data)}B', data) -> {tuple(m.data)}"),
    "glued words": lines_of(lambda m: f"Write: {spaced(m.data)}Connected with code 0" if m.sent else f"Read: {spaced(m.data)}"),
}  # fmt: skip


def clutter(rng: random.Random) -> Iterator[str]:
    """Lines that stand between in real pastes: numbers, addresses, names, and no bytes."""
    choices = (
        lambda: f"net.wimpi.modbus.msg.ReadMultipleRegistersRequest@{rng.randrange(1 << 28, 1 << 32):x}",
        lambda: f"AddRegister: 0x7f{rng.randrange(1 << 24):06x}",
        lambda: f"heap: {rng.randrange(10**5)} free, largest block {rng.randrange(10**5)} at 0x3ffb{rng.randrange(1 << 16):04x}",
        lambda: f"temperature {rng.random() * 50:.2f} humidity {rng.random() * 100:.1f}",
        lambda: json.dumps({"DEV1:humidity": round(rng.random() * 99, 1), "DEV1:temperature": rng.randrange(40), "seq": rng.randrange(9999)}),
        lambda: f"Reading {rng.randrange(1, 99)} registers from {rng.randrange(40000, 49999)}, timeout {rng.choice((100, 500, 1000))} ms",
        lambda: f'  File "/usr/lib/python3.11/site-packages/client.py", line {rng.randrange(10, 999)}, in read_holding_registers',
        lambda: f"connected to 192.168.{rng.randrange(255)}.{rng.randrange(255)}:502",
        lambda: f"MAC {':'.join(f'{rng.randrange(256):02X}' for _ in range(6))} rssi -{rng.randrange(30, 90)}",
        lambda: f"firmware v{rng.randrange(9)}.{rng.randrange(20)}.{rng.randrange(30)} build {rng.randrange(10**7)}",
        lambda: f"session {'-'.join(f'{rng.randrange(1 << 4 * n):0{n}x}' for n in (8, 4, 4, 4, 12))}",
        lambda: f"register {rng.randrange(100)} = {rng.randrange(65536)} (0x{rng.randrange(65536):04X})",
        lambda: f"values: [{', '.join(str(rng.randrange(1000, 60000)) for _ in range(4))}]",
        lambda: f"select(): max_sd = {rng.randrange(9)}, t_out = 000000:{rng.randrange(10**6):06d}",
        lambda: "waiting for the answer",
        lambda: "",
        lambda: f"retries {rng.randrange(4)} of 3, errors {rng.randrange(10)}, load {rng.random():.3f}",
        lambda: f"/dev/ttyUSB{rng.randrange(4)} opened at {rng.choice((9600, 19200, 115200))} 8N1",
    )  # fmt: skip
    while True:
        yield rng.choice(choices)()


def cluttered(text: str, rng: random.Random, share: float, rows: int) -> str:
    """A text with other lines before and behind; between its lines, too, where it has one a message (`rows`)."""
    noise = clutter(rng)
    out = [next(noise) for _ in range(rng.randrange(3))]
    lines = text.split("\n")
    for line in lines:
        out.append(line)
        if len(lines) == rows and rng.random() < share:
            out.append(next(noise))
    return "\n".join([*out, *(next(noise) for _ in range(rng.randrange(3)))])
