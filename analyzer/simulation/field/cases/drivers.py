"""Line drivers that are enabled late, released early or held; UARTs that are not set like the line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from random import Random

from ..bench import Bench, Expected, site
from ..units import MS, FieldUnit, Shape
from ..wire import Burst, LineUart, ReceivedOctet, TapEnd
from .registry import ANY_TAP, LOCAL, Site, field_case


def _often(random: Random, share: float, shape: Callable[[Burst], None]) -> Shape:
    def put(burst: Burst, _: Random) -> None:
        if random.random() < share:
            shape(burst)
            burst.plain = False

    return put


def _share(random: Random) -> float:
    return random.choice((1.0, 1.0, 0.9, random.uniform(0.3, 0.9)))


def _bench(random: Random, tap: str) -> Bench:
    return site(random, tap, units=(2, 9), seconds=(30, 300))


@field_case("driver-enabled-late")
def driver_enabled_late(random: Random, tap: str) -> Site:
    """A unit enables its driver when its answer has already begun."""
    bench = _bench(random, tap)
    unit = bench.unit()
    late = random.uniform(0.25, 1.8) * unit.sends.char_ns

    def shape(burst: Burst) -> None:
        burst.on = burst.starts[0] + late * random.uniform(0.9, 1.1)

    unit.shapes.append(_often(random, _share(random), shape))
    return bench, Expected("driver-enabled-late", (unit.unit,))


@field_case("driver-released-early")
def driver_released_early(random: Random, tap: str) -> Site:
    """A unit releases its driver before the last of its answer is out."""
    bench = _bench(random, tap)
    unit = bench.unit()
    early = random.uniform(0.4, 2.2) * unit.sends.char_ns

    def shape(burst: Burst) -> None:
        burst.off = burst.last - early * random.uniform(0.9, 1.1)

    unit.shapes.append(_often(random, _share(random), shape))
    return bench, Expected("driver-released-early", (unit.unit,))


@field_case("driver-held")
def driver_held(random: Random, tap: str) -> Site:
    """A unit holds its driver into the client's next request."""
    bench = _bench(random, tap)
    unit = bench.unit()
    base = random.choice((3.0, 6.0, 12.0, 25.0))
    bench.master.manners.pause_ms = lambda _: base
    bench.wire.contention = random.choice(("strong", "random"))
    unit.strength = 2.0
    pause = max(base * MS, bench.uart.silence_ns + 0.2 * MS)
    into = random.uniform(0.3, 3.0) * bench.uart.char_ns

    def shape(burst: Burst) -> None:
        burst.off = burst.last + pause + into

    unit.shapes.append(_often(random, _share(random), shape))
    listed = [poll.unit for poll in bench.master.polls if not poll.period_ns]
    if listed.count(unit.unit) == 1 and listed[-1] == unit.unit:  # the request behind its answer must not wait
        bench.master.manners.cycle_ms = 0.0
    return bench, Expected("driver-held", (unit.unit,))


@field_case("null-suffix")
def null_suffix(random: Random, tap: str) -> Site:
    """A unit sends a 00 behind each of its frames."""
    bench = _bench(random, tap)
    unit = bench.unit()
    seal = unit.seal
    share = random.choice((1.0, 1.0, 0.95))

    def sealed(number: int, pdu: bytes) -> bytes:
        return seal(number, pdu) + (b"\0" if random.random() < share else b"")

    unit.seal = sealed
    if random.random() < 0.5:  # clients that read as many bytes as they expect go on all the same
        bench.master.takes_prefix = True
    return bench, Expected("null-suffix", (unit.unit,))


@field_case("duplicate-address")
def duplicate_address(random: Random, tap: str) -> Site:
    """Two devices answer to one address."""
    bench = site(random, tap, units=(2, 9), seconds=(30, 300))
    unit = bench.unit()
    duplicated(random, bench, unit)
    return bench, Expected("duplicate-address", (unit.unit,))


def duplicated(random: Random, bench: Bench, unit: FieldUnit) -> None:
    """A second device of a unit's address."""
    twin = type(unit)(unit.unit, bench.uart, bench.wire, random)
    apart = random.random()
    if apart < 0.4:  # nearly at the same time
        twin.delay_ms = unit.delay_ms * random.uniform(0.97, 1.05)
        twin.jitter = unit.jitter = random.uniform(0.01, 0.1)
    elif apart < 0.7:
        twin.delay_ms = unit.delay_ms * random.uniform(1.1, 2.0)
    else:  # one behind the other
        twin.delay_ms = unit.delay_ms * 1.3 + 30 * bench.uart.char_ns / MS


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
