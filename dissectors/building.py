"""From fields to bytes: ADUs built by the same declarations that read them.

    build(3, unit=17, starting_address=107, quantity=3)       # 11 03 00 6B 00 03 76 87
    build("Write Multiple Registers", unit=1, starting_address=0, registers=[1, 2], envelope="tcp")

Counts that follow from what is given (bytes, registers, coils) need not be given.
"""

from __future__ import annotations

import struct
from typing import Any, Final, Literal

import construct

from .blocks import Bits, Counted
from .crc import crc_bytes, lrc
from .declaration import DeclarationError, Function, Quantity
from .registry import function, functions

_UNFIT: Final = (construct.ConstructError, struct.error, AttributeError, LookupError, TypeError, ValueError)
_UNITS: Final = range(256)
_TRANSACTIONS: Final = range(1 << 16)


def declared(name: int | str) -> Function:
    """The function of a code, or of a name however it is spelled; DeclarationError where none is declared."""
    if isinstance(name, int):
        found = function(name) if 0 < name < 0x80 else None
    else:
        codes = [code for code in functions() if _spelled(str(functions()[code].name)) == _spelled(name)]
        found = function(codes[0]) if codes else None
    if found is None:
        raise DeclarationError(
            f"no function {name!r} is declared: there are {', '.join(map(str, sorted(functions())))}"
        )
    return found


def build(
    name: int | str,
    *,
    unit: int,
    role: Literal["request", "response"] = "request",
    envelope: Literal["rtu", "ascii", "tcp"] = "rtu",
    transaction: int = 0,
    **fields: Any,
) -> bytes:
    """A whole ADU, check value or MBAP header included; ASCII mode as its characters from `:` to CR LF.

    `name` is a function's code or name, `fields` are those of its declaration, in their order ([1] 6). Raises
    DeclarationError, a line, for a function that is not declared and for fields that are missing, unknown or do not
    fit; limits of the specification may be passed on purpose.
    """
    if unit not in _UNITS or transaction not in _TRANSACTIONS:
        raise DeclarationError(f"unit {unit!r}, transaction {transaction!r}: 0 to 255 and 0 to 65535 are possible")
    chosen = declared(name)
    body = bytes((unit, chosen.code)) + _payload(chosen, role, dict(fields))
    if envelope == "rtu":
        return body + crc_bytes(body)
    if envelope == "ascii":
        return f":{body.hex().upper()}{lrc(body):02X}\r\n".encode()
    return transaction.to_bytes(2, "big") + b"\0\0" + len(body).to_bytes(2, "big") + body


def _payload(chosen: Function, role: str, fields: dict[str, Any]) -> bytes:
    """The bytes behind the function code."""
    layout = chosen.request if role == "request" else chosen.response
    parts = {part.name: getattr(part, "subcon", part) for part in getattr(layout, "subcons", ())}
    where = f"{role} of function {chosen.code} {chosen.name}"
    _count(parts, fields, where)
    if unknown := sorted(fields.keys() - parts.keys()):
        raise DeclarationError(f"{where}: no field {', '.join(unknown)}; it has {', '.join(map(str, parts)) or 'none'}")
    if missing := [str(part) for part in parts if part not in fields]:
        raise DeclarationError(f"{where}: needs {', '.join(missing)}")
    try:
        data: bytes = layout.build(fields)
    except _UNFIT as error:
        raise DeclarationError(f"{where}: {' '.join(str(error).split())}") from error
    return data


def _count(parts: dict[str, Any], fields: dict[str, Any], where: str) -> None:
    """Enter the counts that follow from what they count."""
    for name, part in parts.items():
        if not isinstance(part, Counted) or name not in fields:
            continue
        try:
            length = len(part.encoded(fields[name]))
        except _UNFIT as error:
            raise DeclarationError(f"{where}: {name}: {error}") from error
        if part.count in parts:
            fields.setdefault(part.count, (length + part.less) // part.scale)
        quantities = [each for each in parts if isinstance(parts[each], Quantity) and each not in fields]
        if len(quantities) == 1:
            fields[quantities[0]] = len(fields[name]) if isinstance(part, Bits) else length // 2


def _spelled(name: str) -> str:
    """A name without what people leave out."""
    return "".join(character for character in name.casefold() if character.isalnum())
