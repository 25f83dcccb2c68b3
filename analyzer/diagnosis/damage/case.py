"""What an autopsy is given, and by what it judges: the damaged bytes, what the conversation knows, and the yardstick.

How likely is it that a certain frame was sent here? The yardstick of all repairs, in bits (log2). A repair that makes
the CRC right proves little: somewhere in a long frame some repair always does. It counts as far as the frame that it
gives is one that this bus would send now: its length as its header says, its numbers within limits, the answer that
the pending request asked for, a request that came before. Each byte that this predicts is worth up to 8 bits; one that
nothing predicts is worth none.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import inf, log2
from typing import Final, NamedTuple

from dissectors.crc import crc_bytes, needed, registers
from dissectors.declaration import USER_DEFINED
from dissectors.functions.exceptions import EXCEPTIONS
from dissectors.length_rules import Role
from dissectors.lengths import Expectation, expectation, pdu_length, plausibility, rule
from dissectors.limits import EXCEPTION, LAST_UNIT, MAX_PDU, MIN_ADU, OVERHEAD, Bound, Choice, Multiple, Sized
from dissectors.registry import revision


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
    crc-variant, echo, collision or crc-error. `bits` is how likely it is (log2, over bytes that nothing predicts:
    random ones seldom get more than `FRAME`), `certainty` (0 to 1) its share of all the explanations tried.
    `repaired` is the frame as it was sent, if this is what happened.

    What else is set hangs on the code:

    bit-flip            `byte` (offset in the frame) and `bit` (0 the least significant)
    byte-missing        `places`, all that fit, the likeliest first
    byte-extra          `places`, as above
    bytes-repeated      `byte` where the doubled slice begins, `length` of the slice
    flow-control-loss   `lost` bytes, as many `places` as could be solved
    truncated           `length` that the frame should have (`at_least` where it ends before it tells)
    crc-variant         `variant`, the convention's name
    echo                `lost` bytes of the `length` that were sent just before, in `repaired`; `bit`: so many bits of a
                        byte arrive, where those that need no more came right and the others changed
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


def predicted_length(data: bytes, role: Role) -> Length | None:
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
    return predicted_length(case.data, Role.RESPONSE) if case.expected.fits(case.data) else None


def agrees(length: Length | None, data: bytes) -> bool:
    """Whether these bytes are as long as that, for all that is known."""
    return length is None or length.length == len(data) or (length.least and length.length < len(data))


BYTE: Final = 8.0
_FITS: Final = -0.2  # nearly every answer is the one that was asked for
REFUSED: Final = -5.0  # or an exception
UNASKED: Final = -10.0
NO_REQUEST: Final = -1.0
INTERRUPTS: Final = -2.0  # a request while an answer is due
OTHER_ROLE: Final = -6.0  # than the deframer took it for
RECURS: Final = -1.0  # half of the requests
_UNIT_STRANGE: Final = -4.0
_UNIT_RESERVED: Final = -6.0
_UNIT_BROADCAST: Final = -2.0
_DECLARED: Final = 3.3  # one of the 20-odd functions in use, of 256
_USER: Final = -2.0
_UNDECLARED: Final = -4.0
LENGTH_TOLD: Final = 3.0  # a count that agrees with the length, less what choosing the length takes
_BROKEN: Final = -6.0  # a limit of the specification that real frames do break


def likelihood(frame: bytes, case: DamagedFrame) -> float:
    """log2 of how likely this frame, CRC right, was sent, over bytes that nothing predicts; -inf where it can't be."""
    if len(frame) < MIN_ADU:
        return -inf
    best = BYTE * (len(frame) - 2) - log2(len(case.known)) + RECURS if frame in case.known else -inf
    return max(best, *(_of_role(frame, role, case) for role in Role))


def _of_role(frame: bytes, role: Role, case: DamagedFrame) -> float:
    pdu = frame[1:-2]
    length = pdu_length(pdu, role)
    if length is not None and length != len(pdu):
        return -inf
    if case.expected is not None and role is Role.RESPONSE and case.expected.fits(frame):
        return _answering(frame, case, predicted=length is not None) + (
            OTHER_ROLE if case.role is Role.REQUEST else 0.0
        )
    return opening(frame, role, case) + _structure(pdu, role, predicted=length is not None)


def _answering(frame: bytes, case: DamagedFrame, *, predicted: bool) -> float:
    assert case.expected is not None
    if frame[1] & EXCEPTION:
        return 2 * BYTE + REFUSED + (4.0 if frame[2] in EXCEPTIONS else -4.0)
    marked = sum(len(mark) for _, mark in case.expected.marks)
    return _FITS + BYTE * (2 + marked) + (LENGTH_TOLD if predicted and case.due is None else 0.0)


def opening(data: bytes, role: Role, case: DamagedFrame) -> float:
    """log2 of how likely a frame of this role was sent here that begins so; its length left aside."""
    bits = 0.0 if case.role in (None, role) else OTHER_ROLE
    if case.expected is not None and role is Role.RESPONSE:
        if case.expected.fits(data):
            return bits + 2 * BYTE + (REFUSED if data[1] & EXCEPTION else 0.0)
        bits += UNASKED
    elif case.expected is not None:
        bits += INTERRUPTS
    elif role is Role.RESPONSE:
        bits += NO_REQUEST
    return bits + header(data, case)


def header(data: bytes, case: DamagedFrame) -> float:
    """log2 of how likely a frame begins with this unit and this function, as far as these bytes reach."""
    bits = _unit(data[0], case) if data else 0.0
    if len(data) < 2:
        return bits
    function = data[1]
    if rule(function & ~EXCEPTION, Role.REQUEST) is not None:
        return bits + _DECLARED
    return bits + (_USER if function in USER_DEFINED else _UNDECLARED)


def _unit(unit: int, case: DamagedFrame) -> float:
    if unit > LAST_UNIT:
        return _UNIT_RESERVED
    if not unit:
        return _UNIT_BROADCAST
    if not case.units:
        return 0.0
    return BYTE - log2(len(case.units)) if unit in case.units else _UNIT_STRANGE


def _structure(pdu: bytes, role: Role, *, predicted: bool) -> float:
    if broken := plausibility(pdu, role):
        return _BROKEN * len(broken)
    return _checked(pdu[0], role, revision()) + (LENGTH_TOLD if predicted and has_count(pdu[0], role) else 0.0)


def has_count(function: int, role: Role) -> bool:
    """Whether a frame's length hangs on what it holds."""
    declared = rule(function, role)
    return declared is not None and (declared.count is not None or declared.walk is not None)


@lru_cache(maxsize=1024)
def _checked(function: int, role: Role, _revision: int) -> float:
    """Bits of keeping all limits of a PDU."""
    declared = rule(function, role)
    return sum(map(_worth, declared.checks)) if declared is not None else 0.0


def _worth(check: Bound | Choice | Multiple | Sized) -> float:
    if isinstance(check, Bound):
        span = 1 << 8 * check.width
        return log2(span / (min(check.high, span - 1) - check.low + 1))
    if isinstance(check, Choice):
        return BYTE * check.width - log2(len(check.values))
    return log2(check.n) if isinstance(check, Multiple) else BYTE
