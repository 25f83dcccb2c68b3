"""Whole frames with a right CRC that should not have been sent, not so, not then, or not by that unit; and missing
ones.

Not so: their content breaks the specification ([1]) in limits, counts, values, function codes. A device refuses such a
request, as it must; the exception keeps its own finding.
"""

from __future__ import annotations

import struct

from ..conversation import Exchange, adu
from .stage import BROADCAST_NS, MS, Stage, defect

_ILLEGAL_FUNCTION, _ILLEGAL_VALUE = 1, 3
_RESERVED = (9, 10, 13, 14, 18, 19, 25, 30, 50, 80, 120)
_BITS = (1, 2)
_WORDS = (3, 4)


def _refused(stage: Stage, code: str, pdu: bytes, exception: int = _ILLEGAL_VALUE) -> None:
    """A request that is wrong, to a unit that is polled, and the exception that answers it."""
    unit = stage.random.choice(stage.polls).request[0]
    request = stage.ask(adu(unit, pdu))
    stage.found(code, request)
    frame = stage.answer(adu(unit, bytes((pdu[0] | 0x80, exception))), request)
    stage.found("exception", frame, exception=exception)
    stage.pause()


@defect("quantity-out-of-range")
def quantity_out_of_range(stage: Stage) -> None:
    """The master asks for more than a frame may carry, or for nothing."""
    random = stage.random
    address = random.randrange(1000)
    function = random.choice((1, 2, 3, 4))
    over = random.randint(2001, 4000) if function in _BITS else random.randint(126, 999)
    quantity = 0 if random.random() < 0.3 else over
    _refused(stage, "quantity-out-of-range", struct.pack(">BHH", function, address, quantity))


@defect("invalid-coil-value")
def invalid_coil_value(stage: Stage) -> None:
    """The master writes a coil with a value other than 0000 and FF00."""
    value = stage.random.choice((0x0001, 0x00FF, 0xFFFF, 0x0100, 0x1234))
    _refused(stage, "invalid-coil-value", struct.pack(">BHH", 5, stage.random.randrange(1000), value))


@defect("byte-count-mismatch")
def byte_count_mismatch(stage: Stage) -> None:
    """A write's byte count, and its data, do not fit its own quantity."""
    quantity = stage.random.randint(2, 8)
    count = 2 * (quantity + stage.random.choice((-1, 1, 2)))
    head = struct.pack(">BHHB", 16, stage.random.randrange(1000), quantity, count)
    _refused(stage, "byte-count-mismatch", head + stage.random.randbytes(count))


@defect("padding-bits-set")
def padding_bits_set(stage: Stage) -> None:
    """The bits after the last coil of an answer are not zero."""
    unit, function = stage.random.choice(stage.polls).request[0], stage.random.choice(_BITS)
    quantity = stage.random.choice((1, 3, 5, 10, 12, 19, 37))
    data = bytearray(stage.random.randbytes((quantity + 7) // 8))
    unused = 8 - quantity % 8
    data[-1] |= stage.random.randint(1, (1 << unused) - 1) << quantity % 8
    request = stage.ask(adu(unit, struct.pack(">BHH", function, stage.random.randrange(1000), quantity)))
    frame = stage.answer(adu(unit, bytes((function, len(data))) + data), request)
    stage.found("padding-bits-set", frame)
    stage.pause()


@defect("invalid-function")
def invalid_function(stage: Stage) -> None:
    """The master sends function 0, which does not exist."""
    _refused(stage, "invalid-function", b"\x00" + stage.random.randbytes(4), _ILLEGAL_FUNCTION)


@defect("reserved-function")
def reserved_function(stage: Stage) -> None:
    """The master sends a function that the specification neither defines nor gives to users."""
    function = stage.random.choice(_RESERVED)
    _refused(stage, "reserved-function", bytes((function,)) + stage.random.randbytes(4), _ILLEGAL_FUNCTION)


@defect("frame-too-long")
def frame_too_long(stage: Stage) -> None:
    """A device answers with 127 registers, since it was asked for them: 259 bytes, where 256 are the most."""
    unit = stage.random.choice(stage.polls).request[0]
    request = stage.ask(adu(unit, struct.pack(">BHH", 3, stage.random.randrange(1000), 127)))
    stage.found("quantity-out-of-range", request)
    frame = stage.answer(adu(unit, b"\x03\xfe" + stage.random.randbytes(254)), request)
    stage.found("frame-too-long", frame, also=("quantity-out-of-range", "byte-count-mismatch"))
    stage.pause()


_READS = (1, 2, 3, 4)
_LATE_MS = (10.0, 25.0)  # after the request that the late answer is taken for
_OWN_MS = (40.0, 60.0)  # and that request's own answer after it
_EXCEPTIONS = (1, 2, 3, 4, 6)


def _answered(exchange: Exchange) -> bytes:
    assert exchange.response is not None
    return exchange.response


@defect("no-response")
def no_response(stage: Stage) -> None:
    """A unit that answers otherwise is silent for once."""
    stage.found("no-response", stage.ask(stage.next().request))
    stage.unanswered()


@defect("retry")
def retry(stage: Stage) -> None:
    """A unit is silent, and answers when it is asked again."""
    exchange = stage.next()
    stage.found("no-response", stage.ask(exchange.request))
    stage.unanswered()
    request, _ = stage.play(exchange)
    stage.found("retry", request)


@defect("late-response")
def late_response(stage: Stage) -> None:
    """An answer comes after the master has asked for something else, whose own answer then follows."""
    first = stage.next(_READS)
    second = stage.next(_READS)
    if second.request == first.request:
        return
    request = stage.ask(first.request)
    stage.unanswered()
    own = stage.ask(second.request)
    late = stage.answer(_answered(first), request, stage.random.uniform(*_LATE_MS) * MS)
    stage.found("late-response", late, also=("shifted-answer",), answers=request.start)
    stage.answer(_answered(second), own, stage.random.uniform(*_OWN_MS) * MS)
    stage.pause()


@defect("shifted-answer")
def shifted_answer(stage: Stage) -> None:
    """An answer comes when the master has asked the same unit for as many other registers, and is taken for theirs."""
    first = stage.next(_WORDS)
    unit, pdu = first.request[0], first.request[1:-2]
    address = int.from_bytes(pdu[1:3]) ^ 0x0400
    request = stage.ask(first.request)
    stage.unanswered()
    own = stage.ask(adu(unit, pdu[:1] + address.to_bytes(2) + pdu[3:]))
    late = stage.answer(_answered(first), request, stage.random.uniform(*_LATE_MS) * MS)
    stage.found("shifted-answer", late, also=("late-response",), answers=request.start, taken_for=own.start)
    count = _answered(first)[2]
    stage.answer(adu(unit, pdu[:1] + bytes((count, *range(count)))), own, _OWN_MS[0] * MS)
    stage.pause()


@defect("unexpected-response")
def unexpected_response(stage: Stage) -> None:
    """A unit answers that nobody has asked."""
    before, exchange = stage.next(), stage.next(_READS)
    request, _ = stage.play(before)
    while exchange.request[:2] == bytes((request.unit, request.function)):
        exchange = stage.next(_READS)
    stage.found("unexpected-response", stage.send("response", _answered(exchange), None))
    stage.pause()


@defect("duplicate-response")
def duplicate_response(stage: Stage) -> None:
    """Two devices have the same address: both answer, one after the other."""
    exchange = stage.next(_READS)
    request = stage.ask(exchange.request)
    stage.answer(_answered(exchange), request, exchange.response_ns)
    unit, function, count = _answered(exchange)[:3]
    twin = adu(unit, bytes((function, count)) + stage.random.randbytes(count))
    stage.found("duplicate-response", stage.answer(twin, request, exchange.response_ns), also=("padding-bits-set",))
    stage.pause()


@defect("response-mismatch")
def response_mismatch(stage: Stage) -> None:
    """A unit answers with other registers than it was asked for, or confirms to have written others."""
    exchange = stage.next((3, 4, 16))
    unit, pdu = exchange.request[0], exchange.request[1:-2]
    if pdu[0] in (3, 4):
        count = _answered(exchange)[2]
        wrong = count + 2 * stage.random.choice((1, 2, 3)) if count < 200 else count - 2
        answer = bytearray((pdu[0], wrong)) + stage.random.randbytes(wrong)
    else:
        answer = bytearray(_answered(exchange)[1:-2])
        answer[stage.random.choice((2, 4))] ^= stage.random.randint(1, 255)
    request = stage.ask(exchange.request)
    frame = stage.answer(adu(unit, bytes(answer)), request, exchange.response_ns)
    stage.found("response-mismatch", frame, also=("quantity-out-of-range",) if pdu[0] == 16 else ())
    stage.pause()


@defect("exception")
def exception(stage: Stage) -> None:
    """A unit refuses with an exception."""
    exchange = stage.next()
    unit, function = exchange.request[:2]
    code = stage.random.choice(_EXCEPTIONS)
    request = stage.ask(exchange.request)
    frame = stage.answer(adu(unit, bytes((function | 0x80, code))), request, exchange.response_ns)
    stage.found("exception", frame, exception=code)
    stage.pause()


@defect("broadcast-answered")
def broadcast_answered(stage: Stage) -> None:
    """A device answers a write to unit 0."""
    pdu = stage.made(16).request[1:-2]
    request = stage.ask(adu(0, pdu))
    stage.found("broadcast-answered", stage.answer(adu(0, pdu[:5]), request))
    stage.now += BROADCAST_NS


@defect("broadcast-read")
def broadcast_read(stage: Stage) -> None:
    """The master sends a read to unit 0, which nobody can answer."""
    stage.found("broadcast-read", stage.ask(adu(0, stage.next(_READS).request[1:-2])))
    stage.now += BROADCAST_NS


@defect("reserved-unit")
def reserved_unit(stage: Stage) -> None:
    """The master polls a device whose address is over 247, and it answers."""
    exchange, unit = stage.next(_READS), stage.random.randint(248, 255)
    request = stage.ask(adu(unit, exchange.request[1:-2]))
    stage.found("reserved-unit", request)
    stage.found("reserved-unit", stage.answer(adu(unit, _answered(exchange)[1:-2]), request))
    stage.pause()


@defect("crc-collision")
def crc_collision(stage: Stage) -> None:
    """Registers hold bytes with a right CRC: those of a frame, or with the frame's own beginning."""
    unit = stage.random.choice(stage.client.devices).unit
    poll = adu(unit, struct.pack(">BHH", 3, stage.random.randrange(100), 20))
    inner = adu(unit, struct.pack(">BHH", 3, stage.random.randrange(100), 2))
    at = 2 * stage.random.randint(1, 14)
    window = [3 + at, len(inner)]
    payload = stage.random.randbytes(at) + inner + stage.random.randbytes(40 - at - len(inner))
    if stage.random.random() < 0.3:
        begins = adu(unit, b"\x03\x28" + stage.random.randbytes(3))  # as long as a request is
        window, payload = [0, len(begins)], begins[3:] + stage.random.randbytes(43 - len(begins))
    request = stage.ask(poll)
    frame = stage.answer(adu(unit, b"\x03\x28" + payload), request)
    stage.found("crc-collision", frame, window=window)
    stage.pause()
