"""05 Write Single Coil, 06 Write Single Register ([1] 6.5, 6.6): the response repeats the request."""

from __future__ import annotations

from typing import Final

from construct import Struct

from dissectors.declaration import Function
from dissectors.parts import Address, Output, Register

_COIL: Final = Struct("output_address" / Address("0x"), "output_value" / Output())
_REGISTER: Final = Struct("register_address" / Address("4x"), "register_value" / Register())

WRITE_SINGLE_COIL: Final = Function(
    0x05,
    "Write Single Coil",
    request=_COIL,
    response=_COIL,
    clause="6.5",
    area="0x",
    echoes=("output_address", "output_value"),
    request_words="write coil {output_address}: {output_value}",
    response_words="coil {output_address} written: {output_value}",
)

WRITE_SINGLE_REGISTER: Final = Function(
    0x06,
    "Write Single Register",
    request=_REGISTER,
    response=_REGISTER,
    clause="6.6",
    area="4x",
    echoes=("register_address", "register_value"),
    request_words="write register {register_address}: {register_value}",
    response_words="register {register_address} written: {register_value}",
)
