"""Frames with a right CRC whose content breaks the specification ([1]): limits, counts, values, function codes.

A device refuses such a request, as it must; the exception keeps its own finding.
"""

from __future__ import annotations

import struct

from ..conversation import adu
from .registry import defect
from .stage import Stage

_ILLEGAL_FUNCTION, _ILLEGAL_VALUE = 1, 3
_RESERVED = (9, 10, 13, 14, 18, 19, 25, 30, 50, 80, 120)
_BITS = (1, 2)


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
