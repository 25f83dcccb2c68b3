"""UARTs that are not set like the line: a unit's, or the tap's."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from ..bench import Bench, Expected, site
from ..uart import LineUart, ReceivedOctet
from ..units import FieldUnit
from ..wire import Burst, TapEnd
from .registry import ANY_TAP, LOCAL, Site, field_case

_STANDARD = (1200, 2400, 4800, 9600, 14400, 19200, 38400, 57600, 115200)


def _other_baud(random: Random, uart: LineUart) -> float:
    return random.choice([baud for baud in _STANDARD if baud != uart.baud and 0.2 < baud / uart.baud < 5])


def another_format(random: Random, uart: LineUart) -> LineUart:
    """Settings of a UART that are not these."""
    kind = random.random()
    if kind < 0.5:
        return replace(uart, baud=_other_baud(random, uart))
    if kind < 0.85:
        parity = random.choice([parity for parity in "NEO" if parity != uart.parity])
        return replace(uart, parity=parity, stop_bits=1)
    return replace(uart, data_bits=15 - uart.data_bits, parity=random.choice("NE"))


@field_case("unit-line-settings")
def unit_line_settings(random: Random, tap: str) -> Site:
    """One unit sends at another speed or parity, or by a clock that is off."""
    bench = site(random, tap, seconds=(30, 300))
    unit = bench.unit()
    if random.random() < 0.35:
        off = random.uniform(0.055, 0.09) * random.choice((-1, 1))
        unit.sends = replace(bench.uart, baud=bench.uart.baud * (1 + off))
    else:
        unit.sends = another_format(random, bench.uart)
    return bench, Expected("unit-line-settings", (unit.unit,))


@field_case("tap-line-settings", LOCAL)
def tap_line_settings(random: Random, tap: str) -> Site:
    """The tap is set to another speed, parity or polarity than the line."""
    bench = site(random, tap, seconds=(30, 200))
    kind = random.random()
    if kind < 0.3:
        wrong = replace(bench.uart, inverted=True)
    elif kind < 0.75:
        wrong = replace(bench.uart, baud=_other_baud(random, bench.uart))
    else:
        wrong = another_format(random, bench.uart)
        while wrong.parity == "N" and bench.uart.parity == "N":
            wrong = another_format(random, bench.uart)
    bench.wire.taps = [TapEnd(wrong)]
    bench.header["baud"], bench.header["char_bits"] = int(wrong.baud), wrong.char_bits
    if "parity" in bench.header:
        bench.header["parity"], bench.header["stop_bits"] = wrong.parity, wrong.stop_bits
    return bench, Expected("tap-line-settings")


@field_case("tap-flow-control", LOCAL)
def tap_flow_control(random: Random, tap: str) -> Site:
    """The tap's port has XON/XOFF on, and eats those bytes; each unit says some."""
    bench = site(random, tap, seconds=(30, 300))
    bench.tapped = lambda octets: [octet for octet in octets if octet.value not in (0x11, 0x13)]
    return bench, Expected("tap-flow-control")


@field_case("tap-one-direction")
def tap_one_direction(random: Random, tap: str) -> Site:
    """The tap hears the client only, or the units only."""
    bench = site(random, tap, units=(1, 9), seconds=(20, 300))
    units = random.random() < 0.5
    bench.wire.taps[0].hears = _units_only if units else _client_only
    return bench, Expected("tap-one-direction")


def _units_only(burst: Burst) -> bool:
    return isinstance(burst.sender, FieldUnit)


def _client_only(burst: Burst) -> bool:
    return not isinstance(burst.sender, FieldUnit)


@field_case("tap-reversed", ANY_TAP)
def tap_reversed(random: Random, tap: str) -> Site:
    """Two taps, a direction each, and what is said of them is the wrong way round."""
    bench = site(random, tap, seconds=(20, 300))
    bench.wire.taps = [TapEnd(bench.uart, _client_only), TapEnd(bench.uart, _units_only)]
    bench.header["notes"] = {"directions": "response,request"}
    return bench, Expected("tap-reversed")


@field_case("healthy-two-ports", LOCAL)
def healthy_two_ports(random: Random, tap: str) -> Site:
    """Two taps, a direction each, and what is said of them is right."""
    bench = site(random, tap, seconds=(20, 300))
    bench.wire.taps = [TapEnd(bench.uart, _client_only), TapEnd(bench.uart, _units_only)]
    bench.header["notes"] = {"directions": "request,response"}
    return bench, Expected(None)


@field_case("local-echo")
def local_echo(random: Random, tap: str) -> Site:
    """The client's own adapter shows what it is given to send, and the line again."""
    bench = site(random, tap, seconds=(20, 300))
    echo_of_client(random, bench)
    return bench, Expected("local-echo")


def echo_of_client(random: Random, bench: Bench) -> None:
    """The client's adapter shows what it is given to send before the line does."""
    sent: list[ReceivedOctet] = []
    early = random.uniform(0.02, 1.0) * 1e6

    def remember(burst: Burst, _: Random) -> None:
        begin = burst.starts[0] - early
        sent.extend(ReceivedOctet(begin + i, value, False) for i, value in enumerate(burst.data))

    bench.master.shapes.append(remember)
    bench.tapped = lambda octets: sorted([*octets, *sent])
