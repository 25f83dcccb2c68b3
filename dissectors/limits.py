"""Limits of an ADU, and what can be known of a PDU's length and what it is held to, as plain data.

What every floor above asks when it says how long a frame may be and whose address a unit may have: [1] 4.1, [2] 2.2 and
2.5.1, [3] 3.1.3. Knows no bytes: check values stand in `crc`, envelopes in `envelopes`.

A check speaks of a field by its offset in the PDU (0 is the function code; in a declaration, before it has a place,
0 is the field itself), so that one frame and an array of frames can be put through it alike. `soft` marks a limit of
the specification that real frames do break (a quantity of 126, a coil value of 1); what contradicts a frame's own
structure is hard. Numbers are big-endian.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from math import log2
from operator import or_
from typing import TYPE_CHECKING, Any, Final, TypeVar

from .fields import ENGLISH, Wording

if TYPE_CHECKING:
    from numpy.typing import NDArray

CRC_SIZE: Final = 2  # bytes of the check value ([2] 2.5.1.2)
OVERHEAD: Final = 1 + CRC_SIZE  # bytes of an RTU ADU besides its PDU: unit and check value
MIN_ADU: Final = 1 + OVERHEAD  # bytes: unit, function code, check value
MAX_ADU: Final = 256  # bytes ([2] 2.5.1); what a count predicts may exceed it, the wire may not
MAX_PDU: Final = MAX_ADU - OVERHEAD  # bytes ([1] 4.1)
BROADCAST: Final = 0  # the unit that every server hears and none answers ([2] 2.2)
LAST_UNIT: Final = 247  # the last address that a server may have; 248 to 255 are reserved ([2] 2.2)
EXCEPTION: Final = 0x80  # set in the function code of an exception response ([1] 7)
EXCEPTION_ADU: Final = MIN_ADU + 1  # bytes of an exception response: its code besides


_LISTED: Final = 6  # values that a message names
_Q = TypeVar("_Q", int, "NDArray[Any]")


@dataclass(frozen=True, slots=True)
class Count:
    """The counted part of a PDU: `scale` more bytes for each one that the field counts."""

    offset: int
    width: int
    scale: int


@dataclass(frozen=True, slots=True)
class Bound:
    """A field in `low` to `high`, both allowed."""

    offset: int
    width: int
    low: int
    high: int
    soft: bool = True

    @property
    def bits(self) -> float:
        """How seldom chance fulfils it: minus the binary logarithm."""
        return 8 * self.width - log2(self.high - self.low + 1)

    def fits(self, values: NDArray[Any]) -> NDArray[Any]:
        """Which of these values it lets pass."""
        return (values >= self.low) & (values <= self.high)

    def broken(self, value: int, wording: Wording = ENGLISH) -> str | None:
        """What is wrong with this value, or None."""
        if self.low <= value <= self.high:
            return None
        return wording.fill_template("{value} is outside {low} to {high}", value=value, low=self.low, high=self.high)


@dataclass(frozen=True, slots=True)
class Choice:
    """A field that is one of `values`."""

    offset: int
    width: int
    values: tuple[int, ...]
    soft: bool = True

    @property
    def bits(self) -> float:
        """As of `Bound`."""
        return 8 * self.width - log2(len(self.values))

    def fits(self, values: NDArray[Any]) -> NDArray[Any]:
        """As of `Bound`."""
        return reduce(or_, (values == value for value in self.values), values != values)

    def broken(self, value: int, wording: Wording = ENGLISH) -> str | None:
        """What is wrong with this value, or None."""
        if value in self.values:
            return None
        digits = 2 * self.width
        shown = f"{value:0{digits}X}"
        if len(self.values) > _LISTED:
            return wording.fill_template("{value} is not defined", value=shown)
        choices = wording.say(" or ").join(f"{v:0{digits}X}" for v in self.values)
        return wording.fill_template("{value} should be {choices}", value=shown, choices=choices)


@dataclass(frozen=True, slots=True)
class Multiple:
    """A field that is a multiple of `n`."""

    offset: int
    width: int
    n: int
    soft: bool = False

    @property
    def bits(self) -> float:
        """As of `Bound`."""
        return log2(self.n)

    def fits(self, values: NDArray[Any]) -> NDArray[Any]:
        """As of `Bound`."""
        fitting: NDArray[Any] = values % self.n == 0
        return fitting

    def broken(self, value: int, wording: Wording = ENGLISH) -> str | None:
        """What is wrong with this value, or None."""
        return (
            wording.fill_template("{value} is not a multiple of {n}", value=value, n=self.n) if value % self.n else None
        )


@dataclass(frozen=True, slots=True)
class Sized:
    """A byte count (1 byte) that is what a quantity (2 bytes) in the same PDU takes: see `taken`."""

    count_offset: int
    quantity_offset: int
    bits: bool
    soft: bool = False


@dataclass(frozen=True, slots=True)
class Echo:
    """A field that a response repeats from its request."""

    request_offset: int
    response_offset: int
    width: int


@dataclass(frozen=True, slots=True)
class RequestedByteCount:
    """A byte count (1 byte) in a response that is what a quantity (2 bytes) in its request takes: see `taken`."""

    count_offset: int
    quantity_offset: int
    bits: bool


Check = Bound | Choice | Multiple


def taken(quantity: _Q, bits: bool) -> _Q:
    """The bytes that a quantity of bits or of registers takes; of many quantities, put as an array of integers."""
    return (quantity + 7) >> 3 if bits else 2 * quantity
