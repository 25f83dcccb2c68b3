"""Frames that are damaged on their way, or made wrong by their sender: one kind of damage each.

The master takes no damaged answer, and no unit a damaged request: it waits its timeout and goes on to the next poll.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

from dissectors.crc import VARIANTS, crc16, lrc

from ..truth import TruthFrame
from .stage import Stage, defect

_ANSWERS = 0.7  # the share of damages that answers suffer
_HEADER = 3  # bytes by which a damaged frame is still known for what it was
_LONG = (3, 4)  # functions with long answers
_SLICES = (2, 2, 3, 4, 8, 22)  # bytes
_APART = 12  # exchanges
_FIRST_DATA = 7  # characters of an answer in ASCII mode before its data: colon, unit, function, count
_LRC_AND_END = 4  # characters
_FLOW = b"\x11\x13"

Damage = Callable[[Random, bytes], tuple[bytes, dict[str, Any]]]


def _put(stage: Stage, damage: Damage, code: str, *, answers: float = _ANSWERS, long: bool = False) -> None:
    """Damages the next request or answer."""
    exchange = stage.next(_LONG if long else None)
    assert exchange.response is not None
    if stage.random.random() < answers:
        request = stage.ask(exchange.request)
        captured, detail = _wrong(stage.random, exchange.response, damage)
        frame = stage.answer(exchange.response, request, exchange.response_ns, captured, fault=code)
    else:
        captured, detail = _wrong(stage.random, exchange.request, damage)
        frame = stage.ask(exchange.request, captured, fault=code)
    stage.found(code, frame, **detail)
    stage.unanswered()


def _wrong(random: Random, sent: bytes, damage: Damage) -> tuple[bytes, dict[str, Any]]:
    """Damage that the CRC shows."""
    while True:
        captured, detail = damage(random, sent)
        if crc16(captured):
            return captured, detail


@defect("bit-flip")
def bit_flip(stage: Stage) -> None:
    """One bit of a frame arrives flipped."""

    def damage(random: Random, sent: bytes) -> tuple[bytes, dict[str, Any]]:
        at, bit = random.randrange(len(sent)), random.randrange(8)
        return sent[:at] + bytes((sent[at] ^ 1 << bit,)) + sent[at + 1 :], {"byte": at, "bit": bit}

    _put(stage, damage, "bit-flip")


@defect("byte-missing")
def byte_missing(stage: Stage) -> None:
    """One byte of a frame is lost."""

    def damage(random: Random, sent: bytes) -> tuple[bytes, dict[str, Any]]:
        at = random.randrange(len(sent))
        return sent[:at] + sent[at + 1 :], _run_of_byte(sent, at)

    _put(stage, damage, "byte-missing")


@defect("byte-extra")
def byte_extra(stage: Stage) -> None:
    """One byte too many stands inside a frame."""

    def damage(random: Random, sent: bytes) -> tuple[bytes, dict[str, Any]]:
        at = random.randint(1, len(sent) - 1)
        captured = sent[:at] + random.randbytes(1) + sent[at:]
        return captured, _run_of_byte(captured, at)

    _put(stage, damage, "byte-extra")


def _run_of_byte(data: bytes, at: int) -> dict[str, Any]:
    """A byte and the run of equal ones that it stands in: losing or adding any of them is all the same."""
    first = last = at
    while first and data[first - 1] == data[at]:
        first -= 1
    while last + 1 < len(data) and data[last + 1] == data[at]:
        last += 1
    return {"byte": at, "value": data[at], "places": [first, last]}


@defect("truncated")
def truncated(stage: Stage) -> None:
    """A frame ends early, by two bytes at least."""

    def damage(random: Random, sent: bytes) -> tuple[bytes, dict[str, Any]]:
        return sent[: random.randint(_HEADER, len(sent) - 2)], {"due": len(sent)}

    _put(stage, damage, "truncated")


@defect("bytes-repeated")
def bytes_repeated(stage: Stage) -> None:
    """A slice of an answer comes twice in a row."""

    def damage(random: Random, sent: bytes) -> tuple[bytes, dict[str, Any]]:
        size = min(random.choice(_SLICES), len(sent) - _HEADER - 1)
        at = random.randint(_HEADER, len(sent) - size - 1)
        return sent[: at + size] + sent[at:], {"byte": at, "size": size}

    _put(stage, damage, "bytes-repeated", answers=1.0, long=True)


@defect("crc-error")
def crc_error(stage: Stage) -> None:
    """Several bits of a frame flip, or its check value is just wrong."""

    def damage(random: Random, sent: bytes) -> tuple[bytes, dict[str, Any]]:
        if random.random() < 0.5:
            return sent[:-2] + random.randbytes(2), {}
        data = bytearray(sent)
        for at in random.sample(range(8 * min(_HEADER, len(sent) - 3), 8 * len(sent)), 2 * random.randint(1, 2)):
            data[at // 8] ^= 1 << at % 8
        return bytes(data), {}

    _put(stage, damage, "crc-error")


@defect("collision")
def collision(stage: Stage) -> None:
    """Another unit answers while the one that was asked does: where both drive the line, a 0 of either wins."""
    exchange, following = stage.next(), stage.next()
    assert exchange.response is not None and following.response is not None
    request = stage.ask(exchange.request)
    first, second = exchange.response, following.response
    late = stage.random.randint(1, max(1, min(len(first) - 2, 6)))
    if late + len(second) < len(first) + 2:
        second += stage.random.randbytes(len(first) + 2 - late - len(second))
    both = bytearray(first[:late] + second)
    for at in range(late, len(first)):
        both[at] &= first[at]
    frame = stage.answer(first, request, exchange.response_ns, bytes(both), fault="collision")
    stage.found("collision", frame, due=len(first))
    stage.unanswered()


@defect("parity-error")
def parity_error(stage: Stage) -> None:
    """The UART marks a byte whose parity bit is wrong; half of the time one of its other bits is as well."""
    exchange = stage.next()
    assert exchange.response is not None
    sent, random = exchange.response, stage.random
    at = random.randrange(len(sent))
    request = stage.ask(exchange.request)
    if random.random() < 0.5:
        frame = stage.answer(sent, request, exchange.response_ns, marked=(at,))
        stage.found("parity-error", frame, byte=at)
        stage.pause()
    else:
        captured = sent[:at] + bytes((sent[at] ^ 1 << random.randrange(8),)) + sent[at + 1 :]
        frame = stage.answer(sent, request, exchange.response_ns, captured, fault="parity-error", marked=(at,))
        stage.found("parity-error", frame, also=("bit-flip",), byte=at)
        stage.unanswered()


@defect("crc-variant", whole=True)
def crc_variant(stage: Stage, exchanges: int) -> Iterator[None]:
    """One unit's firmware makes its check values by another convention."""
    variant = stage.random.choice(VARIANTS)
    unit = stage.polls[0].request[0]
    polled = stage.polls[0].request  # seldom, for it never answers well
    stage.polls = [poll for poll in stage.polls if poll.request[0] != unit]
    for i in range(exchanges):
        if stage.polls and i % _APART != _APART - 1:
            yield from stage.healthy(1)
            continue
        device = stage.device(unit)
        body = bytes((unit,)) + device.answer(stage.random, polled[1:-2])
        sent = body + variant.made(body)
        if not crc16(sent):  # right by chance
            continue
        request = stage.ask(polled)
        frame = stage.answer(sent, request, device.response_ns, fault="crc-variant")
        stage.found("crc-variant", frame, variant=variant.name)
        stage.unanswered()
        yield


@defect("flow-control-loss", whole=True)
def flow_control_loss(stage: Stage, exchanges: int) -> Iterator[None]:
    """The capturing port has XON/XOFF on: no 11 and no 13 ever arrives."""
    for poll in [poll for poll in stage.polls if poll.request[1] in _LONG][::3]:  # those hold one always
        high = stage.random.choice(_FLOW) << 8
        stage.device(poll.request[0]).words[int.from_bytes(poll.request[2:4], "big")] = high | 0x80
    for _ in range(exchanges):
        stage.play(stage.next())
        _lose_flow_control(stage)
        yield


def _lose_flow_control(stage: Stage) -> None:
    """What has passed since the last step, without those bytes."""
    passing = stage.passing
    remaining = [at for at, byte in enumerate(passing.data) if byte not in _FLOW]
    frames, shift = [], 0
    for frame in passing.frames:
        captured = frame.adu.translate(None, _FLOW)
        frames.append(_moved(frame, frame.start - shift, len(captured)))
        shift += len(frame.adu) - len(captured)
        if len(captured) < len(frame.adu):
            stage.found("flow-control-loss", frames[-1], lost=len(frame.adu) - len(captured))
    passing.frames[:] = frames
    passing.times = array("d", [passing.times[at] for at in remaining])
    passing.data = bytearray(passing.data[at] for at in remaining)


def _moved(frame: TruthFrame, start: int, length: int) -> TruthFrame:
    fault = None if length == len(frame.adu) else "flow-control-loss"
    return TruthFrame(
        frame.id, frame.direction, frame.unit, frame.function, frame.adu, frame.pair, start, length, fault
    )


@defect("lrc-error", whole=True)
def lrc_error(stage: Stage, exchanges: int) -> Iterator[None]:
    """A line in ASCII mode, on which a digit of an answer arrives as another now and then."""
    for number in range(exchanges):
        exchange = stage.next(None if number % _APART else _LONG)
        assert exchange.response is not None
        request = stage.ask(exchange.request, _spelt(exchange.request))
        spelt = _spelt(exchange.response)
        if number % _APART:
            stage.answer(exchange.response, request, exchange.response_ns, spelt)
            stage.pause()
            yield
            continue
        at = stage.random.randrange(_FIRST_DATA, len(spelt) - _LRC_AND_END)
        other = stage.random.choice([digit for digit in b"0123456789ABCDEF" if digit != spelt[at]])
        captured = spelt[:at] + bytes((other,)) + spelt[at + 1 :]
        stage.found("lrc-error", stage.answer(exchange.response, request, exchange.response_ns, captured))
        stage.unanswered()
        yield


def _spelt(sent: bytes) -> bytes:
    """An RTU frame as ASCII mode writes it."""
    body = sent[:-2]
    return b":" + (body + bytes((lrc(body),))).hex().upper().encode() + b"\r\n"
