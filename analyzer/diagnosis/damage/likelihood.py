"""How likely is it that a certain frame was sent here? The yardstick of all repairs, in bits (log2).

A repair that makes the CRC right proves little: somewhere in a long frame some repair always does. It counts as far as
the frame that it gives is one that this bus would send now: its length as its header says, its numbers within limits,
the answer that the pending request asked for, a request that came before. Each byte that this predicts is worth up to
8 bits; one that nothing predicts is worth none.
"""

from __future__ import annotations

from functools import lru_cache
from math import inf, log2
from typing import Final

from dissectors.adu import EXCEPTION, LAST_UNIT, MIN_ADU
from dissectors.declaration import USER_DEFINED
from dissectors.functions.exceptions import EXCEPTIONS
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length, plausibility, rule
from dissectors.limits import Bound, Choice, Multiple, Sized
from dissectors.registry import revision

from .case import DamagedFrame

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
    return _checked(pdu[0], role, revision()) + (LENGTH_TOLD if predicted and counted(pdu[0], role) else 0.0)


def counted(function: int, role: Role) -> bool:
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
