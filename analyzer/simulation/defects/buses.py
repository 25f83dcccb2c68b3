"""Troubles of the bus as a whole, and of the tap."""

from __future__ import annotations

import struct

from dissectors.foreign import mstp_check

from ..conversation import Exchange, adu
from .registry import defect
from .stage import MS, Stage

_SLOW_MS = (120.0, 160.0)
_SATURATED_MS = (0.2, 0.5)  # that the master waits beyond 3.5 characters
_HURRIED_NS = 1.0 * MS
_ADJACENT = 6  # registers, polled one by one


@defect("echo", whole=True)
def echo(stage: Stage, exchanges: int) -> None:
    """The master's adapter hears itself: each request stands in the capture twice."""
    for _ in range(exchanges):
        exchange = stage.next()
        assert exchange.response is not None
        request = stage.ask(exchange.request)
        stage.now += stage.random.uniform(0.0, 1.0) * stage.character
        stage.found("echo", stage.send("request", exchange.request, None), also=("gap-too-short",))
        stage.answer(exchange.response, request, exchange.response_ns)
        stage.pause()


@defect("slow-device", taps=("precise", "irq", "ftdi16"), units=3, whole=True)
def slow_device(stage: Stage, exchanges: int) -> None:
    """One unit answers twenty times later than the others."""
    unit = stage.polls[0].request[0]
    stage.device(unit).response_ns = stage.random.uniform(*_SLOW_MS) * MS
    stage.healthy(exchanges)
    stage.found_on_bus("slow-device", unit=unit)


@defect("poll-waste", whole=True)
def poll_waste(stage: Stage, exchanges: int) -> None:
    """The master reads adjacent registers of one unit one by one, round after round."""
    device = stage.random.choice(stage.client.devices)
    first = device.base + stage.random.randrange(30)
    requests = [adu(device.unit, struct.pack(">BHH", 3, first + i, 1)) for i in range(_ADJACENT)]
    others = [poll for poll in stage.polls if poll.request[:2] != requests[0][:2]]
    stage.polls = [*(Exchange(request, None, device.response_ns) for request in requests), *others]
    stage.healthy(exchanges)
    stage.found_on_bus("poll-waste", unit=device.unit, starting_address=first, requests=_ADJACENT)


@defect("bus-saturated", taps=("precise", "irq"), whole=True)
def bus_saturated(stage: Stage, exchanges: int) -> None:
    """The master asks again as soon as it may, and the line is never idle."""
    stage.idle_ms = _SATURATED_MS
    for device in stage.client.devices:
        device.response_ns = _HURRIED_NS
    stage.healthy(exchanges)
    stage.found_on_bus("bus-saturated")


@defect("timing-blind", taps=("ftdi16", "gateway", "untimed"), whole=True)
def timing_blind(stage: Stage, exchanges: int) -> None:
    """Nothing is wrong with the bus, but this tap's times cannot show its silences."""
    stage.healthy(exchanges)
    stage.found_on_bus("timing-blind")


@defect("other-protocol", taps=("precise", "irq", "ftdi16"))
def other_protocol(stage: Stage) -> None:
    """Devices of another protocol speak on the pair between two polls."""
    random = stage.random
    kind, source = random.choice((0, 1)), random.randrange(12)
    head = bytes((kind, (source + 1) % 12, source, 0, 0))
    frame = b"\x55\xff" + head + bytes((mstp_check(head),))  # a token of BACnet MS/TP
    start = len(stage.data)
    for byte in frame:
        stage.put(byte)
    stage.found_at("other-protocol", start)
    stage.pause()
