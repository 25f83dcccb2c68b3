"""What an autopsy says: one explanation of damaged bytes, with its evidence, and those that come close to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

FRAME: Final = 1.0  # bits from which a stretch of noise is held to be a frame that came damaged


class Place(NamedTuple):
    """Where a byte was lost or added, and its value.

    Within a run of equal bytes nobody can tell which one it was: `first` to `last` are all the same repair. Of a lost
    byte: offsets in the frame as sent. Of an added one: offsets in the bytes as captured.
    """

    first: int
    last: int
    value: int


@dataclass(frozen=True, slots=True)
class Verdict:
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
    places: tuple[Place, ...] = ()
    length: int | None = None
    at_least: bool = False
    lost: int | None = None
    variant: str | None = None
    rivals: tuple[Verdict, ...] = ()
