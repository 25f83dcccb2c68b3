"""16 Mask Write Register ([1] 6.16): (value AND and_mask) OR (or_mask AND NOT and_mask); the response repeats it."""

from __future__ import annotations

from typing import Final

from construct import Struct

from dissectors.declaration import Function
from dissectors.parts import Address, Mask

_MASKS: Final = Struct("reference_address" / Address("4x"), "and_mask" / Mask(), "or_mask" / Mask())

MASK_WRITE_REGISTER: Final = Function(
    0x16,
    "Mask Write Register",
    request=_MASKS,
    response=_MASKS,
    clause="6.16",
    area="4x",
    echoes=("reference_address", "and_mask", "or_mask"),
    request_words="mask register {reference_address}: and {and_mask}, or {or_mask}",
    response_words="register {reference_address} masked: and {and_mask}, or {or_mask}",
)
