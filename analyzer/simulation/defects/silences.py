"""Silences that are too long or too short, and bytes where there should be silence."""

from __future__ import annotations

from ..conversation import adu
from .registry import TIMED, defect
from .stage import MS, Stage

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
def noise(stage: Stage, exchanges: int) -> None:
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
            start = len(stage.data)
            for _ in range(stage.random.randint(1, 4)):
                stage.put(stage.random.choice((0x00, 0xFF, stage.random.getrandbits(8))))
            stage.found_at("noise", start, pattern="idle")
            stage.pause()
        else:
            stage.play(exchange)


def _beside(stage: Stage, pattern: str, glitch: int, asked: bytes, answered: bytes, after_ns: float) -> None:
    """An exchange with a glitch right before or after its answer."""
    request = stage.ask(asked)
    if pattern == "before":
        stage.now += max(after_ns, 1.1 * stage.silence)
        start = len(stage.data)
        stage.put(glitch)
        stage.found_at("noise", start, pattern=pattern, unit=asked[0])
        stage.now += stage.random.uniform(0.0, 0.8) * stage.character
        stage.send("response", answered, request.id)
    else:
        stage.answer(answered, request, after_ns)
        stage.now += stage.random.uniform(0.0, 0.8) * stage.character
        start = len(stage.data)
        stage.put(glitch)
        stage.found_at("noise", start, pattern=pattern, unit=asked[0])
    stage.pause()
