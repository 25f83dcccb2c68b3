"""What an autopsy is given: the damaged bytes, and all that the conversation knows about them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

from dissectors.adu import MAX_PDU, MIN_ADU, OVERHEAD
from dissectors.answers import Expectation, expectation
from dissectors.crc import crc_bytes, needed, registers
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length, rule


@dataclass(frozen=True)
class DamagedFrame:
    """Damaged bytes: a frame with a wrong CRC, or a stretch of noise that may have been one.

    `role` is the one that the deframer took the frame for, None where nobody knows. `request` is the whole right
    request that waits for its answer (or that this frame was taken to answer), None where none does. All else helps
    where it is known: `known` frames that this bus has sent before (requests recur), the `units` on it, offsets with
    UART `errors`, and `flow_free`: how many bytes this port has given without one 11 or 13 among them, 0 where there
    were some.
    """

    data: bytes
    role: Role | None = None
    request: bytes | None = None
    known: Collection[bytes] = ()
    units: Collection[int] = ()
    errors: tuple[int, ...] = ()
    flow_free: int | None = None

    @cached_property
    def before(self) -> list[int]:
        """The CRC register before each byte and after the last."""
        return registers(self.data)

    @cached_property
    def needed(self) -> list[int]:
        """The CRC register that each place would need for the rest to end right."""
        return needed(self.data)

    @cached_property
    def expected(self) -> Expectation | None:
        """What the answer that is due must look like; None where none is, as after a broadcast."""
        return expectation(self.request) if self.request and len(self.request) >= MIN_ADU and self.request[0] else None

    @cached_property
    def due(self) -> int | None:
        """Length of the answer that is due (not of an exception), where its request tells."""
        if self.expected is None:
            return None
        length = pdu_length(self.expected.header[1:], Role.RESPONSE)
        return None if length is None or length < 0 else length + OVERHEAD

    @cached_property
    def header(self) -> bytes:
        """The first bytes that the answer that is due must have: all of it, where it only echoes its request."""
        if self.expected is None:
            return b""
        header = self.expected.header
        return header + crc_bytes(header) if len(header) + 2 == self.due else header


# What an autopsy says: one explanation of damaged bytes, with its evidence, and those that come close to it.


FRAME: Final = 1.0  # bits from which a stretch of noise is held to be a frame that came damaged


class ByteRepair(NamedTuple):
    """Where a byte was lost or added, and its value.

    Within a run of equal bytes nobody can tell which one it was: `first` to `last` are all the same repair. Of a lost
    byte: offsets in the frame as sent. Of an added one: offsets in the bytes as captured.
    """

    first: int
    last: int
    value: int


@dataclass(frozen=True, slots=True)
class Explanation:
    """One explanation of a damaged frame.

    `code` is a finding's: bit-flip, byte-missing, byte-extra, bytes-repeated, flow-control-loss, truncated,
    crc-variant, collision or crc-error. `bits` is how likely it is (log2, over bytes that nothing predicts: random ones
    seldom get more than `FRAME`), `certainty` (0 to 1) its share of all the explanations tried. `repaired` is the frame
    as it was sent, if this is what happened.

    What else is set hangs on the code:

    bit-flip            `byte` (offset in the frame) and `bit` (0 the least significant)
    byte-missing        `places`, all that fit, the likeliest first
    byte-extra          `places`, as above
    bytes-repeated      `byte` where the doubled slice begins, `length` of the slice
    flow-control-loss   `lost` bytes, as many `places` as could be solved
    truncated           `length` that the frame should have (`at_least` where it ends before it tells)
    crc-variant         `variant`, the convention's name
    collision           `length` of the answer that was due, where that is known
    """

    code: str
    bits: float
    certainty: float = 0.0
    repaired: bytes | None = None
    byte: int | None = None
    bit: int | None = None
    places: tuple[ByteRepair, ...] = ()
    length: int | None = None
    at_least: bool = False
    lost: int | None = None
    variant: str | None = None
    rivals: tuple[Explanation, ...] = ()


# How long the frame should be that these bytes begin.


class Length(NamedTuple):
    """An ADU's length; `least` where the bytes end before all of it is told: it is at least that."""

    length: int
    least: bool = False


def told(data: bytes, role: Role) -> Length | None:
    """The length that a frame's first bytes tell for a role, 0 where they can't be one; None where nothing tells."""
    pdu = data[1:MAX_PDU]
    if not pdu:
        return None
    length = pdu_length(pdu, role)
    if length is not None:
        return Length(length + OVERHEAD if length > 0 else 0)
    declared = rule(pdu[0], role)
    if declared is None or (declared.base is None and declared.walk is None):
        return None
    # With more bytes behind, something tells or breaks, unless these go on to an end that nobody counts.
    if pdu_length(pdu + bytes(MAX_PDU - len(pdu)), role) is None:
        return None
    return Length(max(declared.base or 0, len(pdu) + 1) + OVERHEAD, least=True)


def answer_length(case: DamagedFrame) -> Length | None:
    """The length of the answer that is due, as its request or its own header tell."""
    if case.expected is None:
        return None
    if case.due is not None:
        return Length(case.due)
    return told(case.data, Role.RESPONSE) if case.expected.fits(case.data) else None


def agrees(length: Length | None, data: bytes) -> bool:
    """Whether these bytes are as long as that, for all that is known."""
    return length is None or length.length == len(data) or (length.least and length.length < len(data))
