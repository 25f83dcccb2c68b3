"""Servers as they are: they hear the line by their own UART, take what is whole and theirs, and answer after a while.

Their words behave as those of meters and drives do, by address and time. What is wrong with a server is set from
outside: when it is silent, how late it is, what becomes of its answer's PDU (`tampers`), of its check value (`seal`)
and of its driver (`shapes`).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from random import Random
from typing import NamedTuple

from dissectors.crc import crc_bytes, crc_ok, lrc

from ..conversation import adu
from .wire import Burst, FieldWire, LineUart, ReceivedOctet


class WireEnvelope(NamedTuple):
    """How an RTU ADU is put on the line, and what is an RTU ADU again of bytes heard; b"" for what is none."""

    put: Callable[[bytes], bytes]
    take: Callable[[bytes], bytes]


def _to_ascii(adu: bytes) -> bytes:
    body = adu[:-2]
    if not crc_ok(adu):  # spoilt by its sender: so is the LRC
        return b":" + (body + bytes((lrc(body) ^ 0x5A,))).hex().upper().encode() + b"\r\n"
    return b":" + (body + bytes((lrc(body),))).hex().upper().encode() + b"\r\n"


def _from_ascii(data: bytes) -> bytes:
    start = data.rfind(b":")
    if start < 0 or not data.endswith(b"\r\n"):
        return b""
    try:
        body = bytes.fromhex(data[start + 1 : -2].decode("ascii"))
    except ValueError:
        return b""
    return body[:-1] + crc_bytes(body[:-1]) if len(body) > 2 and lrc(body[:-1]) == body[-1] else b""


RTU = WireEnvelope(lambda adu: adu, lambda data: data)
ASCII = WireEnvelope(_to_ascii, _from_ascii)


Word = Callable[[float], int]  # the value at a time (ns)


def constant(value: int) -> Word:
    """It never changes."""
    return lambda _: value


def analog(random: Random) -> Word:
    """A measured value: it swings slowly and trembles."""
    middle, swing = random.choice((23, 230, 2300, 4800)), random.uniform(0.01, 0.2)
    period, phase, noise = random.uniform(20e9, 400e9), random.uniform(0, 6.28), random.choice((0, 1, 3))
    tremble = Random(random.getrandbits(32))

    def word(t: float) -> int:
        value = middle * (1 + swing * math.sin(6.2832 * t / period + phase)) + tremble.randint(-noise, noise)
        return max(0, min(0xFFFF, round(value)))

    return word


def steps(random: Random, on: Callable[[float], bool]) -> Word:
    """A state that is one value or another."""
    low, high = random.choice(((0, 1), (0, 1), (0, 0xFF), (1, 3), (0x0040, 0x0047), (0, 1500)))
    return lambda t: high if on(t) else low


def counter(random: Random) -> tuple[Word, Word]:
    """Two words, most significant first, that count up."""
    begin, rate = random.randrange(100_000, 90_000_000), random.choice((0.1, 1.0, 7.0, 40.0))

    def value(t: float) -> int:
        return begin + int(rate * t / 1e9)

    return (lambda t: value(t) >> 16 & 0xFFFF), (lambda t: value(t) & 0xFFFF)


def float_pair(random: Random) -> tuple[Word, Word]:
    """Two words of a float, most significant first."""
    middle, period = random.choice((50.0, 231.5, 12.25, 0.93, 1450.0)), random.uniform(20e9, 300e9)
    tremble = Random(random.getrandbits(32))
    current: dict[float, bytes] = {}

    def packed(t: float) -> bytes:
        if t not in current:
            current.clear()
            value = middle * (1 + 0.02 * math.sin(6.2832 * t / period) + 0.001 * tremble.random())
            current[t] = struct.pack(">f", value)
        return current[t]

    return (lambda t: packed(t)[0] << 8 | packed(t)[1]), (lambda t: packed(t)[2] << 8 | packed(t)[3])


class Holdings:
    """The words of one unit, made when they are first read."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.words: dict[int, Word] = {}

    def read(self, address: int, quantity: int, t: float) -> list[int]:
        """Words from an address on."""
        for at in range(address, address + quantity):
            if at not in self.words:
                self._grow(at)
        return [self.words[at](t) & 0xFFFF for at in range(address, address + quantity)]

    def write(self, address: int, values: Sequence[int]) -> None:
        """Words that stay as they are written."""
        for at, value in enumerate(values, address):
            self.words[at] = constant(value)

    def _grow(self, at: int) -> None:
        random = self.random
        kind = random.random()
        if kind < 0.35:
            self.words[at] = constant(
                random.choice((0, 0, 0, 1, 0xFFFF, 0x8000, random.randrange(1000), random.getrandbits(16)))
            )
        elif kind < 0.7:
            self.words[at] = analog(random)
        elif kind < 0.85:
            self.words[at], low = counter(random)
            self.words.setdefault(at + 1, low)
        else:
            self.words[at], low = float_pair(random)
            self.words.setdefault(at + 1, low)


MS = 1e6
_READS = (1, 2, 3, 4)
_MOST_BITS, _MOST_WORDS = 2000, 125  # of one read
_AGAIN_NS = 300 * MS
_COUNTED_AT = {15: 6, 16: 6, 23: 10}  # where requests of these functions have their byte count
_IDENTITY = (b"Example", b"FU-2", b"V1.3")  # vendor, product, revision
Tamper = Callable[[bytes, bytes, float], bytes | None]  # request PDU, answer PDU, time: what is answered instead
Shape = Callable[[Burst, Random], None]


class FieldUnit:
    """One server."""

    def __init__(self, unit: int, uart: LineUart, wire: FieldWire, random: Random) -> None:
        self.unit = unit
        self.uart = uart  # by which it hears
        self.sends = uart  # and by which it speaks
        self.random = random
        self.holdings = Holdings(random)
        self.bits = Holdings(random)
        self.delay_ms = random.choice((2.0, 4.0, 8.0, 15.0, 30.0)) * random.uniform(0.8, 1.3)
        self.jitter = random.uniform(0.02, 0.3)
        self.lenient = random.random() < 0.3  # finds a request behind other bytes
        self.patience = 0.85  # of t3.5: the silence that ends a frame for it
        self.silent: Callable[[float], bool] = lambda _: False
        self.delay: Callable[[bytes, float], float] = lambda _pdu, _t: self._usual_delay()
        self.tampers: list[Tamper] = []
        self.seal: Callable[[int, bytes], bytes] = adu
        self.envelope: WireEnvelope = RTU
        self.shapes: list[Shape] = []
        self.answers_all = False  # also what is sent to unit 0
        self.answered: list[float] = []  # when
        self.strength = random.uniform(0.5, 1.5)
        self._wire = wire
        self._heard: list[ReceivedOctet] = []
        self._frames = 0  # that it has heard
        self._deaf_to_all = 0.0
        self._spoke = (0.0, 0.0)  # from when to when: it does not hear itself
        wire.listeners.append(self)

    def hear(self, octets: Sequence[ReceivedOctet], t: float) -> None:
        """Bytes came; nobody sends any more at `t`."""
        begin, end = self._spoke
        if octets and octets[0].t_ns <= end:
            octets = [octet for octet in octets if not begin < octet.t_ns <= end]
        if not octets:
            return
        character, silence = self.uart.char_ns, self.uart.silence_ns * self.patience  # of all servers this is in turn
        last = self._heard[-1].t_ns if self._heard else math.inf
        first = 0
        for at, (t_ns, _, _) in enumerate(octets):
            if t_ns - character - last > silence:
                self._heard, first = [], at
                self._frames += 1
            last = t_ns
        self._heard += octets[first:]
        request = self._request()
        if request is None or self.silent(t):
            return
        if request[0] == 0:
            if t < self._deaf_to_all:  # or the answers of several would call forth each other
                return
            self._deaf_to_all = t + _AGAIN_NS
        due = self._heard[-1].t_ns + self.delay(request[1:-2], t)
        heard = self._frames, len(self._heard)
        self._wire.schedule.at(due, lambda now: self._answer(request, heard, now))

    def _usual_delay(self) -> float:
        least = self.uart.silence_ns + 0.3 * MS
        return max(least, self.delay_ms * MS * self.random.lognormvariate(0, self.jitter))

    def _request(self) -> bytes | None:
        recent = self._heard[-260:]
        if self.envelope is RTU and not self.lenient and recent[0].value not in (0, self.unit):
            return None
        data = bytes([octet.value for octet in recent])
        if self.envelope is ASCII:
            adu = ASCII.take(data)
            return adu if adu[:1] in (b"\0", bytes((self.unit,))) else None
        first = max((at for at, octet in enumerate(recent, 1) if octet.error), default=0)
        starts = [0] if not self.lenient else range(first, max(first + 1, len(data) - 7))
        for start in starts:
            adu = data[start:]
            mine = adu[:1] == bytes((self.unit,)) or (adu[:1] == b"\0" and (self.answers_all or len(adu) > 1))
            if start >= first and mine and len(adu) >= 4 and adu[1] < 0x80 and crc_ok(adu):
                return adu if len(adu) == _request_length(adu) else None
        return None

    def _answer(self, request: bytes, heard: tuple[int, int], now: float) -> None:
        if not self.lenient and heard[0] == self._frames and len(self._heard) > heard[1]:
            return  # more came behind it: that was no frame
        pdu: bytes | None = self.respond(request[1:-2], now)
        if request[0] == 0 and not self.answers_all:
            return
        for tamper in self.tampers:
            if pdu is not None:
                pdu = tamper(request[1:-2], pdu, now)
        if pdu is None:
            return
        data = self.seal(self.unit if request[0] else self.answer_unit(), pdu)
        burst = burst_of(self, self.sends, self.envelope.put(data), now)
        burst.strength = self.strength
        for shape in self.shapes:
            shape(burst, self.random)
        self.answered.append(now)
        self._spoke = (burst.on, max(burst.last, burst.off) + 0.6 * self.uart.char_ns)
        self._wire.send(burst)

    def answer_unit(self) -> int:
        """The unit in its answer to a broadcast."""
        return self.unit

    def respond(self, pdu: bytes, t: float) -> bytes:
        """A healthy answer to a request PDU."""
        function = pdu[0]
        if function in _READS and len(pdu) >= 5:
            address, quantity = struct.unpack(">HH", pdu[1:5])
            if not 0 < quantity <= (_MOST_BITS if function <= 2 else _MOST_WORDS):
                return bytes((function | 0x80, 3))
            if function <= 2:
                bits = [word & 1 for word in self.bits.read(address, quantity, t)]
                packed = bytes(sum(bit << i for i, bit in enumerate(bits[k : k + 8])) for k in range(0, len(bits), 8))
                return bytes((function, len(packed))) + packed
            words = self.holdings.read(address, quantity, t)
            return struct.pack(f">BB{quantity}H", function, 2 * quantity, *words)
        if function == 5:
            self.bits.write(int.from_bytes(pdu[1:3]), [pdu[3] & 1])
            return pdu[:5]
        if function == 6:
            self.holdings.write(int.from_bytes(pdu[1:3]), [int.from_bytes(pdu[3:5])])
            return pdu[:5]
        if function == 15:
            return pdu[:5]
        if function == 16:
            address, quantity = struct.unpack(">HH", pdu[1:5])
            self.holdings.write(address, struct.unpack(f">{quantity}H", pdu[6 : 6 + 2 * quantity]))
            return pdu[:5]
        if function == 22:
            address, keep, give = struct.unpack(">HHH", pdu[1:7])
            self.holdings.write(address, [self.holdings.read(address, 1, t)[0] & keep | give & ~keep])
            return pdu
        if function == 23:
            read_at, read, address, written = struct.unpack(">HHHH", pdu[1:9])
            if not 0 < read <= _MOST_WORDS or len(pdu) != 10 + 2 * written:
                return bytes((function | 0x80, 3))
            self.holdings.write(address, struct.unpack(f">{written}H", pdu[10 : 10 + 2 * written]))
            return struct.pack(f">BB{read}H", 23, 2 * read, *self.holdings.read(read_at, read, t))
        if function == 43:
            objects = b"".join(bytes((i, len(each))) + each for i, each in enumerate(_IDENTITY))
            return pdu[:3] + b"\x01\0\0" + bytes((len(_IDENTITY),)) + objects
        return bytes((function | 0x80, 1))


def _request_length(frame: bytes) -> int:
    if frame[1] <= 6:
        return 8
    counted = _COUNTED_AT.get(frame[1])
    if counted is None:
        return len(frame)
    return counted + 3 + frame[counted] if len(frame) > counted + 2 else 0


def burst_of(sender: object, uart: LineUart, data: bytes, t: float, gap_ns: float = 0.0) -> Burst:
    """Bytes sent back to back from `t` on, the driver enabled just long enough."""
    step = uart.char_ns + gap_ns
    starts = [t + i * step for i in range(len(data))]
    margin = 0.4 * uart.bit_ns
    return Burst(sender, uart, data, starts, t - margin, starts[-1] + uart.char_ns + margin)
