"""What is asked, or when, decides: units deaf to some requests, that need more rest, or refuse all."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from random import Random

from ..bench import SECOND, Bench, Expected, read_pdu, site
from ..master import FieldPoll
from ..units import MS, FieldUnit, Tamper
from ..wire import LineUart, ReceivedOctet
from .registry import ANY_TAP, LOCAL, Site, field_case


def _with_polls(bench: Bench, unit: FieldUnit, *polls: tuple[int, int, int]) -> None:
    """The unit is asked for these (function, address, quantity) and nothing else, among the others' polls."""
    bench.master.polls = [poll for poll in bench.master.polls if poll.unit != unit.unit]
    for function, address, quantity in polls:
        at = bench.random.randrange(len(bench.master.polls) + 1)
        bench.master.polls.insert(at, FieldPoll(unit.unit, read_pdu(function, address, quantity)))


@field_case("deaf-to-some", ANY_TAP)
def deaf_to_some(random: Random, tap: str) -> Site:
    """A unit stays silent whenever it is asked for more than it can give, by a function it lacks, or beyond its map."""
    bench = site(random, tap, units=(1, 8), seconds=(40, 300))
    unit = bench.unit()
    at, kind = random.choice((0, 100, 1000)), random.choice(("quantity", "function", "address"))
    small, large = random.choice((1, 2, 4, 8)), random.choice((20, 24, 30))
    if kind == "quantity":
        polls = [(3, at, small), (3, at + 60, random.choice((small, 2 * small))), (3, at + 200, large)]
    elif kind == "function":
        polls = [(3, at, small), (4, at, small)]
    else:
        polls = [(3, at, small), (3, at + 40, small), (3, at + 5000, small)]
    _with_polls(bench, unit, *polls[: random.choice((2, 3))] if kind == "function" else polls)
    bench.master.manners.retries = random.choice((0, 0, 1, 1, 2, 3))

    def deaf(request: bytes, answer: bytes, _: float) -> bytes | None:
        function, address, quantity = struct.unpack(">BHH", request[:5])
        too_much = {"quantity": quantity >= large, "function": function == 4, "address": address >= at + 5000}
        return None if too_much[kind] else answer

    unit.tampers.append(deaf)
    return bench, Expected("cannot-serve", (unit.unit,), ("retry-policy",))


@field_case("unknown-function", ANY_TAP)
def unknown_function(random: Random, tap: str) -> Site:
    """A unit refuses a function by exception 01."""
    bench = site(random, tap, seconds=(40, 300))
    unit = bench.unit()
    at, quantity = random.choice((0, 100, 1000)), random.choice((1, 2, 8, 16))
    lacks, has = random.choice(((4, 3), (3, 4), (1, 3), (2, 4)))
    _with_polls(bench, unit, (lacks, at, quantity), (has, at, quantity))
    unit.tampers.append(lambda request, answer, _: bytes((lacks | 0x80, 1)) if request[0] == lacks else answer)
    return bench, Expected("cannot-serve", (unit.unit,))


@field_case("counted-in-bytes", ANY_TAP)
def counted_in_bytes(random: Random, tap: str) -> Site:
    """A unit takes the quantity of a read for a count of bytes, and answers by half of what was asked for."""
    bench = site(random, tap, seconds=(40, 300))
    unit = bench.unit()
    at, function = random.choice((0, 100, 1000)), random.choice((3, 4))
    _with_polls(bench, unit, *((function, at + 40 * i, 2 * random.randint(1, 10)) for i in range(random.randint(2, 4))))
    unit.tampers.append(lambda request, answer, _: bytes((request[0], request[4])) + answer[2 : 2 + request[4]])
    return bench, Expected("cannot-serve", (unit.unit,))


class _Rests:
    """The silence before the newest frame on the line, ns."""

    def __init__(self, uart: LineUart) -> None:
        self.uart, self._char_ns = uart, uart.char_ns
        self.newest = self._end = 0.0

    def hear(self, octets: Sequence[ReceivedOctet], _: float) -> None:
        """Bytes came."""
        for octet in octets:
            silence = octet.t_ns - self._char_ns - self._end
            if silence > 1.5 * self._char_ns:
                self.newest = silence
            self._end = octet.t_ns


@field_case("rest-too-short", LOCAL)
def rest_too_short(random: Random, tap: str) -> Site:
    """A unit needs tens of milliseconds of silence before a request, and the client does not always leave them."""
    bench = site(random, tap, units=(2, 7), seconds=(60, 300), bauds=(9600, 19200, 19200, 38400))
    unit = bench.unit()
    least = 4 * bench.uart.char_ns / MS
    needs = max(random.choice((20.0, 30.0, 40.0, 60.0)), 2.5 * least)
    manners = bench.master.manners
    low, high = random.uniform(0.2, 0.6) * needs, random.uniform(1.3, 2.2) * needs
    manners.pause_ms = lambda _: random.uniform(low, high)
    manners.cycle_ms, manners.retries = 0.0, random.choice((0, 1, 1, 2))

    rests = _Rests(bench.uart)
    bench.wire.listeners.append(rests)
    unit.tampers.append(lambda _request, answer, _t: answer if rests.newest >= needs * MS else None)
    return bench, Expected("rest-too-short", (unit.unit,), ("master-too-fast",))


def _refusing(code: int, begin: float) -> Tamper:
    return lambda request, answer, t: bytes((request[0] | 0x80, code)) if t >= begin else answer


def _some_time(bench: Bench) -> float:
    return bench.begin_ns + bench.random.uniform(0.25, 0.7) * (bench.duration_ns - bench.begin_ns)


@field_case("unit-fails", ANY_TAP)
def unit_fails(random: Random, tap: str) -> Site:
    """From some moment on, or always, a unit answers all by exception 04."""
    bench = site(random, tap, seconds=(40, 300))
    unit = bench.unit(asked=2)
    begin = _some_time(bench) if random.random() < 0.7 else 0.0
    unit.tampers.append(_refusing(4, begin))
    return bench, Expected("unit-fails", (unit.unit,))


@field_case("gateway-line-cut", ANY_TAP)
def gateway_line_cut(random: Random, tap: str) -> Site:
    """Behind a gateway with two lines one is cut: exception 0B from several units from then on."""
    bench = site(random, tap, units=(4, 9), seconds=(40, 300))
    behind = random.sample(sorted(bench.units), random.randint(2, len(bench.units) - 1))
    begin = _some_time(bench)
    for number in behind:
        bench.units[number].tampers.append(_refusing(random.choice((0x0B, 0x0B, 0x0A)), begin))
    return bench, Expected("all-silent", tuple(behind))


@field_case("gateway-unit-gone", ANY_TAP)
def gateway_unit_gone(random: Random, tap: str) -> Site:
    """Behind a gateway one unit is gone from some moment on: exception 0B for it."""
    bench = site(random, tap, units=(3, 9), seconds=(40, 300))
    unit = bench.unit()
    unit.tampers.append(_refusing(0x0B, _some_time(bench)))
    return bench, Expected("dead-unit", (unit.unit,))


@field_case("unit-0-asked", ANY_TAP)
def unit_0_asked(random: Random, tap: str) -> Site:
    """One device's address was left at 0 in the client, which waits for its answer each round."""
    bench = site(random, tap, units=(2, 8), seconds=(60, 300))
    manners = bench.master.manners
    manners.turnaround_ms = manners.timeout_ms
    pdu = read_pdu(random.choice((3, 4)), random.choice((0, 100)), random.choice((2, 8, 20)))
    bench.master.polls.append(FieldPoll(0, pdu))
    manners.cycle_ms = min(manners.cycle_ms, bench.duration_ns / SECOND * 1000 / 20)
    return bench, Expected("unit-0-asked", (0,))
