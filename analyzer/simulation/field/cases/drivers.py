"""Line drivers that are enabled late, released early or held; a byte too many behind each frame."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from ..bench import Bench, Expected, site
from ..units import MS, FieldUnit, Shape
from ..wire import Burst
from .registry import Site, field_case


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
