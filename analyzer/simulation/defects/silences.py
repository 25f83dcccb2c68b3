"""Silences that are too long or too short, bytes where silence should be, and troubles of bus and tap as a whole."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from dissectors.foreign import mstp_check

from ..conversation import Exchange, adu
from .stage import MS, TIMED, Stage, defect

_SLOW_MS = (120.0, 160.0)
_SATURATED_MS = (0.2, 0.5)  # that the master waits beyond 3.5 characters
_HURRIED_NS = 1.0 * MS
_ADJACENT = 6  # registers, polled one by one


@defect("echo", whole=True)
def echo(stage: Stage, exchanges: int) -> Iterator[None]:
    """The master's adapter hears itself: each request stands in the capture twice."""
    for _ in range(exchanges):
        exchange = stage.next()
        assert exchange.response is not None
        request = stage.ask(exchange.request)
        stage.now += stage.random.uniform(0.0, 1.0) * stage.character
        stage.found("echo", stage.send("request", exchange.request, None), also=("gap-too-short",))
        stage.answer(exchange.response, request, exchange.response_ns)
        stage.pause()
        yield


@defect("slow-device", taps=("precise", "irq", "ftdi16"), units=3, whole=True)
def slow_device(stage: Stage, exchanges: int) -> Iterator[None]:
    """One unit answers twenty times later than the others."""
    unit = stage.polls[0].request[0]
    stage.device(unit).response_ns = stage.random.uniform(*_SLOW_MS) * MS
    yield from stage.healthy(exchanges)
    stage.found_on_bus("slow-device", unit=unit)


@defect("poll-waste", whole=True)
def poll_waste(stage: Stage, exchanges: int) -> Iterator[None]:
    """The master reads adjacent registers of one unit one by one, round after round."""
    polled = {poll.request[0] for poll in stage.polls}
    device = stage.random.choice([device for device in stage.client.devices if device.unit in polled])
    first = device.base + stage.random.randrange(30)
    requests = [adu(device.unit, struct.pack(">BHH", 3, first + i, 1)) for i in range(_ADJACENT)]
    others = [poll for poll in stage.polls if poll.request[:2] != requests[0][:2]]
    stage.polls = [*(Exchange(request, None, device.response_ns) for request in requests), *others]
    yield from stage.healthy(exchanges)
    stage.found_on_bus("poll-waste", unit=device.unit, starting_address=first, requests=_ADJACENT)


@defect("bus-saturated", taps=("precise", "irq"), whole=True)
def bus_saturated(stage: Stage, exchanges: int) -> Iterator[None]:
    """The master asks again as soon as it may, and the line is never idle."""
    stage.idle_ms = _SATURATED_MS
    for device in stage.client.devices:
        device.response_ns = _HURRIED_NS
    yield from stage.healthy(exchanges)
    stage.found_on_bus("bus-saturated")


@defect("timing-blind", taps=("ftdi16", "gateway", "untimed"), whole=True)
def timing_blind(stage: Stage, exchanges: int) -> Iterator[None]:
    """No problems found with the bus, but this tap's times cannot show its silences."""
    yield from stage.healthy(exchanges)
    stage.found_on_bus("timing-blind")


@defect("other-protocol", taps=("precise", "irq", "ftdi16"))
def other_protocol(stage: Stage) -> None:
    """Devices of another protocol speak on the pair between two polls."""
    random = stage.random
    kind, source = random.choice((0, 1)), random.randrange(12)
    head = bytes((kind, (source + 1) % 12, source, 0, 0))
    frame = b"\x55\xff" + head + bytes((mstp_check(head),))  # a token of BACnet MS/TP
    start = stage.passing.end
    for byte in frame:
        stage.put(byte)
    stage.found_at("other-protocol", start)
    stage.pause()


_HOLE = (2.2, 9.0)  # characters
_SHORT = (1.7, 2.8)  # characters, for 3.5
_TURNAROUND_MS = (20.0, 60.0)
_GLITCHES = (0x00, 0xFF)


@defect("gap-in-frame", taps=TIMED)
def gap_in_frame(stage: Stage) -> None:
    """A sender stops inside a frame for longer than 1.5 characters."""
    exchange = stage.next()
    assert exchange.response is not None
    hole = max(stage.random.uniform(*_HOLE) * stage.character, 1.0 * MS)
    answers = stage.random.random() < 0.7
    frame = exchange.response if answers else exchange.request
    at = stage.random.randint(1, len(frame) - 1)
    request = stage.ask(exchange.request, holes=None if answers else {at: hole})
    response = stage.answer(exchange.response, request, exchange.response_ns, holes={at: hole} if answers else None)
    stage.found("gap-in-frame", response if answers else request, byte=at, gap_ns=round(hole))
    stage.pause()


@defect("gap-too-short", taps=TIMED)
def gap_too_short(stage: Stage) -> None:
    """An answer, or the next request, begins less than 3.5 characters after the frame before it."""
    gap = stage.random.uniform(*_SHORT) * stage.silence / 3.5
    exchange = stage.next()
    assert exchange.response is not None
    if stage.random.random() < 0.5:
        request = stage.ask(exchange.request)
        stage.now += gap
        stage.found("gap-too-short", stage.send("response", exchange.response, request.id), gap_ns=round(gap))
    else:
        request = stage.ask(exchange.request)
        stage.answer(exchange.response, request, exchange.response_ns)
        stage.now += gap
        following = stage.next()
        assert following.response is not None
        request = stage.ask(following.request)
        stage.found("gap-too-short", request, gap_ns=round(gap))
        stage.answer(following.response, request, following.response_ns)
    stage.pause()


@defect("turnaround-short", taps=("precise", "irq"))
def turnaround_short(stage: Stage) -> None:
    """After a broadcast the master goes on before the units had their 100 ms."""
    body = stage.made(6).request
    stage.ask(adu(0, body[1:-2]))
    gap = stage.random.uniform(*_TURNAROUND_MS) * MS
    stage.now += gap
    exchange = stage.next()
    assert exchange.response is not None
    request = stage.ask(exchange.request)
    stage.found("turnaround-short", request, gap_ns=round(gap))
    stage.answer(exchange.response, request, exchange.response_ns)
    stage.pause()


@defect("noise", whole=True)
def noise(stage: Stage, exchanges: int) -> Iterator[None]:
    """Bytes between frames: beside one unit's answers, as a badly timed driver leaves them, or on an idle line."""
    pattern = stage.random.choice(("before", "after", "idle"))
    glitch = stage.random.choice(_GLITCHES)
    unit = stage.random.choice(stage.polls).request[0]
    for i in range(exchanges):
        exchange = stage.next()
        if pattern != "idle" and exchange.request[0] == unit:
            _beside(stage, pattern, glitch, exchange.request, exchange.response or b"", exchange.response_ns)
        elif pattern == "idle" and i % 12 == 11:
            stage.play(exchange)
            start = stage.passing.end
            for _ in range(stage.random.randint(1, 4)):
                stage.put(stage.random.choice((0x00, 0xFF, stage.random.getrandbits(8))))
            stage.found_at("noise", start, pattern="idle")
            stage.pause()
        else:
            stage.play(exchange)
        yield


def _beside(stage: Stage, pattern: str, glitch: int, asked: bytes, answered: bytes, after_ns: float) -> None:
    """An exchange with a glitch right before or after its answer."""
    request = stage.ask(asked)
    if pattern == "before":
        stage.now += max(after_ns, 1.1 * stage.silence)
        start = stage.passing.end
        stage.put(glitch)
        stage.found_at("noise", start, pattern=pattern, unit=asked[0])
        stage.now += stage.random.uniform(0.0, 0.8) * stage.character
        stage.send("response", answered, request.id)
    else:
        stage.answer(answered, request, after_ns)
        stage.now += stage.random.uniform(0.0, 0.8) * stage.character
        start = stage.passing.end
        stage.put(glitch)
        stage.found_at("noise", start, pattern=pattern, unit=asked[0])
    stage.pause()
