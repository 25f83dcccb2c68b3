"""Devices drawn by chance that serve some requests and not others, and clients that ask for both.

Each kind of flaw harms the client's list or the device, so that some entries fail for one reason. Odd buses are well,
or have a fault that no request mends. What a device answers is decided here by its own limits, nothing of the analysis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from random import Random
from typing import Final

from captures.line import LineSettings

Span = tuple[int, int]
Ask = tuple[int, int, int]  # function, address, quantity or value
_AREA: Final = {1: 1, 5: 1, 15: 1, 2: 2, 3: 3, 6: 3, 16: 3, 22: 3, 23: 3, 4: 4}
_BITS: Final = (1, 2, 5, 15)
_READS: Final = (1, 2, 3, 4)


@dataclass
class DrawnDevice:
    """What a device has and how much of it it gives at once; `refuses`: by exception, else it stays silent."""

    unit: int
    functions: set[int]
    areas: dict[int, list[Span]]
    refuses: bool
    most_words: int = 125
    most_bits: int = 2000
    buffer: int = 256
    in_bytes: bool = False  # it takes a quantity for a count of bytes
    size_code: int = 3
    place_code: int = 2
    function_code: int = 1
    is_down: Callable[[float], bool] = lambda _: False
    state: Callable[[float, bytes], int] = lambda _t, _pdu: 0  # an exception code by time, 0 for none

    def answer(self, pdu: bytes) -> bytes | None:
        """The PDU of its answer; None for none."""
        code, body = self._served(pdu)
        if not code:
            return body
        return bytes((pdu[0] | 0x80, code)) if self.refuses else None

    def _served(self, pdu: bytes) -> tuple[int, bytes]:
        function = pdu[0]
        if function not in self.functions:
            return self.function_code, b""
        if function not in _AREA:
            return 0, bytes((function,)) + b"\x02\x11\xff"
        if len(pdu) < 5:
            return 3, b""
        address, second = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
        quantity = 1 if function in (5, 6, 22) else second
        most = self.most_bits if function in _BITS else self.most_words
        limit = (2000 if function in _BITS else 125) if function in _READS else 1968 if function == 15 else 123
        if not 0 < quantity <= min(most, limit):
            return self.size_code, b""
        if self.in_bytes and function in (3, 4):
            return self._counting_bytes(function, address, quantity)
        if not any(
            first <= address and address + quantity <= end for first, end in self.areas.get(_AREA[function], [])
        ):
            return self.place_code, b""
        size = (quantity + 7) // 8 if function in _BITS else 2 * quantity
        held = size + 5 if function in _READS else 8
        if max(held, len(pdu) + 3) > self.buffer:
            return self.size_code, b""
        if function in _READS:
            return 0, bytes((function, size)) + bytes(7 * (address + i) & 0xFF for i in range(size))
        return 0, pdu if function in (5, 6, 22) else pdu[:5]

    def _counting_bytes(self, function: int, address: int, quantity: int) -> tuple[int, bytes]:
        return 0, bytes((function, quantity)) + bytes(7 * (address + i) & 0xFF for i in range(quantity))


@dataclass
class Drawn:
    """A bus: devices, entries of the client's list by unit, and the truth: the unit and its reasons (None: none)."""

    devices: dict[int, DrawnDevice]
    polls: list[tuple[int, bytes]]
    unit: int | None = None
    reasons: tuple[str, ...] = ()
    timeout_s: float = 0.3
    retries: int = 1
    rounds: int = 40
    noise: float = 0.0
    cycle_s: float | None = None  # from round to round, drawn where it is None
    extra: Callable[[int], list[tuple[int, bytes]]] = lambda _: []  # entries of one round more
    skips: Callable[[float, int, bytes], bool] = lambda _t, _unit, _pdu: False  # entries that the client leaves out
    header: LineSettings = field(default_factory=LineSettings)


def pdu_of(ask: Ask, values: Random | None = None) -> bytes:
    """The PDU of a request; writes have values of their own."""
    function, address, quantity = ask
    head = bytes((function,)) + address.to_bytes(2, "big")
    random = values or Random(address)
    if function == 5:
        return head + random.choice((b"\xff\0", b"\0\0"))
    if function == 6:
        return head + random.randrange(1, 500).to_bytes(2, "big")
    if function == 22:
        return head + b"\xff\0\0\x0f"
    body = head + quantity.to_bytes(2, "big")
    if function == 16:
        return (
            body + bytes((2 * quantity,)) + b"".join(random.randrange(500).to_bytes(2, "big") for _ in range(quantity))
        )
    if function == 15:
        size = (quantity + 7) // 8
        return body + bytes((size,)) + random.randbytes(size)
    return body


def _healthy_device(random: Random, unit: int) -> DrawnDevice:
    base = random.choice((0, 0, 100, 1000, 4096))
    size = random.choice((60, 120, 250))
    return DrawnDevice(
        unit,
        {1, 2, 3, 4, 6, 16, 5, 15},
        {area: [(base, base + size)] for area in (1, 2, 3, 4)},
        random.random() < 0.5,
        size_code=random.choice((3, 3, 2)),
    )


def _asks(random: Random, device: DrawnDevice, function: int, count: int, low: int = 1, high: int = 12) -> list[Ask]:
    """Entries that the device serves."""
    first, end = device.areas[_AREA[function]][0]
    found = []
    for _ in range(count):
        quantity = random.randint(low, high)
        found.append((function, random.randrange(first, end - quantity), quantity))
    return found


Flaw = Callable[[Random, DrawnDevice], tuple[list[Ask], tuple[str, ...]]]


def _function(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    lacks, has = random.choice(((1, 3), (2, 3), (4, 3), (3, 4), (2, 4)))
    device.functions.discard(lacks)
    bad = _asks(random, device, lacks, random.randint(1, 3))
    both = ("function", "read-function") if (lacks, has) in ((4, 3), (3, 4)) else ("function",)
    return [*_asks(random, device, has, random.randint(1, 3)), *bad], both


def _read_function(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    wrong, right = random.choice(((3, 4), (4, 3)))
    first, end = device.areas[right][0]
    device.areas[wrong] = [(end + 200, end + 260)]
    good = (right, first, min(40, end - first))
    bad = [(wrong, first + random.randrange(20), random.randint(1, 10)) for _ in range(random.randint(1, 3))]
    there = [(wrong, end + 200, random.randint(1, 20))] if random.random() < 0.6 else []
    return [good, *there, *bad], ("read-function",)


def _write_function(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    lacks, has = random.choice(((6, 16), (6, 16), (5, 15), (16, 6)))
    device.functions.discard(lacks)
    known = _asks(random, device, has, 1, 1, 1) if random.random() < 0.5 or lacks == 16 else []
    return [*_asks(random, device, 3, 2), *known, *_asks(random, device, lacks, random.randint(1, 2), 1, 1)], (
        "write-function",
    )


def _quantity(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    device.most_words = random.choice((8, 10, 16, 20, 32, 40))
    large = [_asks(random, device, 3, 1, device.most_words + 1, 50)[0] for _ in range(random.randint(1, 3))]
    first = device.areas[3][0][0]
    tiles = [(3, at, device.most_words) for at in range(first, first + 60 - device.most_words, device.most_words)]
    small = tiles if random.random() < 0.5 else _asks(random, device, 3, 3, 1, device.most_words)
    return [*small, *large], ("quantity",)


def _quantity_bits(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    device.most_bits = random.choice((8, 16, 32))
    function = random.choice((1, 2))
    small = _asks(random, device, function, 2, 1, device.most_bits)
    return [*small, *_asks(random, device, 3, 2), *_asks(random, device, function, 2, device.most_bits + 1, 55)], (
        "quantity",
    )


def _over_125(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    first = device.areas[3][0][0]
    device.areas[3] = [(first, first + 400)]
    return [*_asks(random, device, 3, 3), (3, first, random.randint(126, 200))], ("quantity",)


def _address(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    _, end = device.areas[3][0]
    beyond = [(3, end + random.choice((50, 500, 5000)), random.randint(1, 10)) for _ in range(random.randint(1, 2))]
    return [*_asks(random, device, 3, 3, 10, 14), *beyond], ("address",)


def _range_end(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    _, end = device.areas[3][0]
    good = [(3, end - 24, 12), (3, end - 12, 12)]
    return [*good, *_asks(random, device, 3, 1), (3, end - random.randint(1, 6), random.randint(7, 12))], ("range-end",)


def _past_the_last(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    device.areas[3].append((65000, 65536))
    device.place_code = random.choice((2, 3))
    return [*_asks(random, device, 3, 3), (3, 65536 - random.randint(1, 9), random.randint(10, 20))], ("range-end",)


def _register_number(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    first = device.areas[3][0][0]
    asks = [(function, number + first + random.randrange(20), random.randint(1, 10))
            for function, number in random.sample([(3, 40001), (4, 30001)], random.randint(1, 2))]  # fmt: skip
    return [*_asks(random, device, random.choice((3, 4)), 2), *asks], ("register-number",)


def _counted(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    if random.random() < 0.5:
        device.in_bytes = True
        asks = _asks(random, device, random.choice((3, 4)), random.randint(2, 4), 2, 20)
        return [(function, address, quantity & ~1) for function, address, quantity in asks], ("counted-in-bytes",)
    begin, blocks = device.areas[3][0][0], list[Span]()
    for size in (random.choice((1, 2, 2, 4)) for _ in range(random.randint(3, 5))):
        blocks.append((begin, begin + size))
        begin += size
    device.areas[3] = [*blocks, (begin + 100, begin + 140)]
    good = [(3, begin + 100, 10), (3, begin + 110 + random.randrange(20), 6)]
    return [*good, *((3, first, 2 * (end - first)) for first, end in blocks)], ("counted-in-bytes",)


def _too_long(random: Random, device: DrawnDevice) -> tuple[list[Ask], tuple[str, ...]]:
    device.buffer = random.choice((40, 48, 64))
    device.size_code = random.choice((3, 4))
    first = device.areas[3][0][0]
    device.areas[1] = [(first, first + 900)]
    words = (device.buffer - 5) // 2
    good = [(3, first, words), (1, first, 8 * (device.buffer - 5) - random.randrange(40))]
    return [
        *good,
        (3, first, words + random.randint(1, 6)),
        (1, first, 8 * (device.buffer - 5) + random.randint(1, 99)),
    ], ("answer-too-long",)


FLAWS: Final[Mapping[str, Flaw]] = {
    "function": _function, "read-function": _read_function, "write-function": _write_function, "quantity": _quantity,
    "quantity-bits": _quantity_bits, "over-125": _over_125, "address": _address, "range-end": _range_end,
    "past-the-last": _past_the_last, "register-number": _register_number, "counted-in-bytes": _counted,
    "answer-too-long": _too_long,
}  # fmt: skip


def flawed(kind: str, random: Random) -> Drawn:
    """A bus of one to five units, one of which does not serve some of what it is asked."""
    drawn = healthy(random)
    unit = random.choice(sorted(drawn.devices))
    device = drawn.devices[unit]
    asks, reasons = FLAWS[kind](random, device)
    asks = list(dict.fromkeys(asks))
    random.shuffle(asks)
    drawn.polls = [poll for poll in drawn.polls if poll[0] != unit]
    at = random.randint(0, len(drawn.polls))
    drawn.polls[at:at] = [(unit, pdu_of(ask)) for ask in asks]
    return replace(drawn, unit=unit, reasons=reasons)


def healthy(random: Random) -> Drawn:
    """A bus on which all is served."""
    units = random.sample(range(1, 60), random.choice((1, 1, 2, 3, 5)))
    devices = {unit: _healthy_device(random, unit) for unit in units}
    polls = [
        (unit, pdu_of(ask))
        for unit in units
        for ask in _asks(random, devices[unit], random.choice((3, 4)), random.randint(2, 4))
    ]
    baud = random.choice((9600, 19200, 38400))
    return Drawn(
        devices, polls, timeout_s=random.choice((0.2, 0.3, 0.5)), retries=random.choice((0, 1, 2)),
        rounds=random.randint(12, 60), header=LineSettings(baud=baud, char_bits=11),
    )  # fmt: skip


def _dead(random: Random, drawn: Drawn) -> None:
    drawn.devices[random.choice(sorted(drawn.devices))].is_down = lambda _: True


def _outages(least: float, most: float, up: float) -> Callable[[Random, Drawn], None]:
    def make(random: Random, drawn: Drawn) -> None:
        begin, spans = random.uniform(1, up), []
        for _ in range(400):
            end = begin + random.uniform(least, most)
            spans.append((begin, end))
            begin = end + random.expovariate(1 / up)
        device = drawn.devices[random.choice(sorted(drawn.devices))]
        device.is_down = lambda t: any(first <= t < last for first, last in spans)

    return make


def _once_off(random: Random, drawn: Drawn) -> None:
    begin = random.uniform(2, 8)
    drawn.devices[random.choice(sorted(drawn.devices))].is_down = lambda t: begin < t < begin + 6


def _asleep(random: Random, drawn: Drawn) -> None:
    """It sleeps twice, and the client then only probes it by a request of its own."""
    unit = random.choice(sorted(drawn.devices))
    device = drawn.devices[unit]
    first = device.areas[3][0][0]
    probe = pdu_of((3, first, 1))
    spans = [(b := random.uniform(2, 5), b + 5), (b + 12, b + 18)]

    def sleeps(t: float) -> bool:
        return any(begin <= t < end for begin, end in spans)

    device.is_down = sleeps
    drawn.polls.append((unit, probe))
    drawn.skips = lambda t, number, pdu: number == unit and (pdu != probe) == sleeps(t)


def _scan(random: Random, drawn: Drawn) -> None:
    free = random.sample(range(60, 120), 60)
    drawn.extra = lambda turn: [(free[turn % len(free)], pdu_of((3, 0, 1)))]


def _optional(random: Random, drawn: Drawn) -> None:
    drawn.polls += [(61, pdu_of((3, 0, random.randint(1, 30)))), (61, pdu_of((4, 10, 2)))]


def _noise(random: Random, drawn: Drawn) -> None:
    drawn.noise = random.choice((0.1, 0.25, 0.4))


def _loose(random: Random, drawn: Drawn) -> None:
    device = drawn.devices[random.choice(sorted(drawn.devices))]
    share = random.uniform(0.1, 0.7)
    device.is_down = lambda _: random.random() < share


def _remote(random: Random, drawn: Drawn) -> None:
    """Writes are refused until somebody turns the key."""
    unit = random.choice(sorted(drawn.devices))
    device, until, code = drawn.devices[unit], random.uniform(2, 6), random.choice((2, 3, 4))
    drawn.polls += [(unit, pdu_of(ask)) for ask in _asks(random, device, 6, 2, 1, 1)]
    device.state = lambda t, pdu: code if pdu[0] == 6 and t < until else 0


def _busy(random: Random, drawn: Drawn) -> None:
    device, code = drawn.devices[random.choice(sorted(drawn.devices))], random.choice((5, 6, 6, 8, 10, 11))
    only = random.random() < 0.5
    device.state = lambda _, pdu: code if (only and pdu[2] % 2) or random.random() < 0.1 else 0


def _log(random: Random, drawn: Drawn) -> None:
    """An event log is empty most of the time, or always: exception 04."""
    unit = random.choice(sorted(drawn.devices))
    device, share = drawn.devices[unit], random.choice((0.8, 0.9, 1.0))
    first = device.areas[3][0][0]
    log = pdu_of((3, first + 3, 5))
    drawn.polls.append((unit, log))
    device.state = lambda _, pdu: 4 if pdu == log and random.random() < share else 0


ODD: Final[Mapping[str, Callable[[Random, Drawn], None]]] = {
    "well": lambda _random, _drawn: None, "dead": _dead, "restarts": _outages(1.0, 3.0, 4.0),
    "contact": _loose, "once-off": _once_off, "asleep": _asleep, "scan": _scan, "optional": _optional, "noise": _noise,
    "remote": _remote, "busy": _busy, "log": _log,
}  # fmt: skip


def odd(kind: str, random: Random) -> Drawn:
    """A bus where no request is at fault."""
    drawn = healthy(random)
    ODD[kind](random, drawn)
    return drawn
