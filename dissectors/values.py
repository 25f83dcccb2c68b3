"""What registers and addresses mean to an engineer.

Registers are 16-bit numbers as they came (each most significant byte first). Wider values take two or four of them,
and devices disagree on the order; the four orders are named by where the bytes A (most significant) to D go: ABCD
(big-endian), CDAB (words swapped), BADC (bytes swapped in each word), DCBA (little-endian); four registers likewise.

Addresses: the wire counts from 0 (physical); the logical number counts from 1 and leads with the area's digit
(0 coils, 1 discrete inputs, 3 input registers, 4 holding registers), in 5 digits up to 9999 or in 6.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

Area = Literal["0x", "1x", "3x", "4x"]
Order = Literal["ABCD", "CDAB", "BADC", "DCBA"]

AREAS: Final[dict[Area, str]] = {
    "0x": "coil",
    "1x": "discrete input",
    "3x": "input register",
    "4x": "holding register",
}
ORDERS: Final[tuple[Order, ...]] = ("ABCD", "CDAB", "BADC", "DCBA")

_SHORT_LAST: Final = 9999  # the last number that 5 digits can name


class ValueFormError(ValueError):
    """An address or a set of registers that cannot be read as asked; the message says why, in one line."""


def signed(register: int) -> int:
    """A register as a 16-bit two's complement number."""
    return register - 0x10000 if register & 0x8000 else register


def hexadecimal(register: int) -> str:
    """`0xAE41`."""
    return f"0x{register:04X}"


def bits(register: int) -> str:
    """`1010 1110 0100 0001`, most significant bit first."""
    digits = f"{register:016b}"
    return " ".join(digits[i : i + 4] for i in range(0, 16, 4))


def ordered(registers: Sequence[int], order: Order = "ABCD") -> bytes:
    """The bytes of registers, put from a device's order into most significant first."""
    if order == "ABCD":
        words = registers
    elif order == "CDAB":
        words = registers[::-1]
    elif order == "BADC":
        words = [_swapped(r) for r in registers]
    else:
        words = [_swapped(r) for r in registers[::-1]]
    return b"".join(word.to_bytes(2, "big") for word in words)


def registers_of(data: bytes, order: Order = "ABCD") -> list[int]:
    """The registers that hold these bytes (an even number of them, most significant first) in a device's order."""
    words = [int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data), 2)]
    if order in ("CDAB", "DCBA"):
        words.reverse()
    return [_swapped(word) for word in words] if order in ("BADC", "DCBA") else words


def integer(registers: Sequence[int], order: Order = "ABCD", *, signed: bool = False) -> int:
    """Registers as one integer of 16 bits each."""
    return int.from_bytes(ordered(registers, order), "big", signed=signed)


def floating(registers: Sequence[int], order: Order = "ABCD") -> float:
    """Two registers as an IEEE 754 single, four as a double; another number of them is a ValueFormError."""
    form = {2: ">f", 4: ">d"}.get(len(registers))
    if form is None:
        raise ValueFormError(f"a float takes 2 or 4 registers, not {len(registers)}")
    value: float = struct.unpack(form, ordered(registers, order))[0]
    return value


def characters(registers: Sequence[int]) -> str:
    """Two characters a register, most significant byte first; what is not printable ASCII is a dot."""
    return "".join(chr(b) if 0x20 <= b < 0x7F else "." for b in ordered(registers))


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read some registers: `kind` is u16, s16, hex, bits, u32, s32, f32, u64, s64, f64 or text.

    `order` is None where it cannot matter.
    """

    kind: str
    order: Order | None
    value: int | float | str
    text: str


def readings(registers: Sequence[int]) -> tuple[Reading, ...]:
    """Every way to read these registers as one value: one, two or four give numbers; any count gives text."""
    views: list[Reading] = []
    if len(registers) == 1:
        register = registers[0]
        views.append(Reading("u16", None, register, str(register)))
        views.append(Reading("s16", None, signed(register), str(signed(register))))
        views.append(Reading("hex", None, hexadecimal(register), hexadecimal(register)))
        views.append(Reading("bits", None, bits(register), bits(register)))
    elif len(registers) in (2, 4):
        width = 16 * len(registers)
        for order in ORDERS:
            unsigned_value = integer(registers, order)
            signed_value = integer(registers, order, signed=True)
            float_value = floating(registers, order)
            views.append(Reading(f"u{width}", order, unsigned_value, str(unsigned_value)))
            views.append(Reading(f"s{width}", order, signed_value, str(signed_value)))
            views.append(Reading(f"f{width}", order, float_value, f"{float_value:.{7 if width == 32 else 16}g}"))
    views.append(Reading("text", None, characters(registers), characters(registers)))
    return tuple(views)


def logical(address: int, area: Area, digits: int | None = None) -> str:
    """The logical number of a physical address: 107 in `4x` is `40108`, or `400108` in 6 digits.

    Without `digits`, 5 where they suffice. An address that the digits cannot name is a ValueFormError.
    """
    number = address + 1
    if digits is None:
        digits = 5 if number <= _SHORT_LAST else 6
    if digits not in (5, 6):
        raise ValueFormError(f"logical addresses have 5 or 6 digits, not {digits}")
    if not 0 <= address <= 0xFFFF or (digits == 5 and number > _SHORT_LAST):
        raise ValueFormError(f"address {address} has no logical number of {digits} digits")
    return f"{area[0]}{number:0{digits - 1}d}"


def prefixed(address: int, area: Area) -> str:
    """The `4x` form: 107 in `4x` is `4x108`, counting from 1."""
    return f"{area}{address + 1}"


def physical(logical_address: str) -> tuple[Area, int]:
    """Area and physical address of a logical one: `40108`, `400108` and `4x108` are all (`4x`, 107).

    `0x…` is taken for coils, not for hexadecimal. Anything else is a ValueFormError.
    """
    text = logical_address.strip().lower()
    for area in AREAS:
        if text.startswith(area):
            return area, _from_one(text[2:], 0x10000, logical_address)
        if text[:1] == area[0] and len(text) in (5, 6):
            return area, _from_one(text[1:], _SHORT_LAST if len(text) == 5 else 0x10000, logical_address)
    raise ValueFormError(f"{logical_address!r} is not a logical address: use 40108, 400108 or 4x108, areas 0, 1, 3, 4")


def _from_one(digits: str, last: int, whole: str) -> int:
    if not (digits.isascii() and digits.isdigit()):
        raise ValueFormError(f"{whole!r} is not a logical address: digits must follow the area")
    if not 1 <= int(digits) <= last:
        raise ValueFormError(f"{whole!r} is not a logical address: {int(digits)} is outside 1 to {last}")
    return int(digits) - 1


def _swapped(register: int) -> int:
    return (register & 0xFF) << 8 | register >> 8


# Text that came from the bus, made safe to show: the one place where foreign bytes become characters.
#
# A device may say anything in its strings. Control characters (C0, C1), line and paragraph separators, bidirectional
# overrides, zero-width and other invisible characters come out as their escape (`\x1b`, `\u202e`), so that a name
# cannot move a cursor, recolour a terminal, forge a line or turn the text around it.


def harmless(text: str) -> str:
    """`text` with every character that does not print as itself written as its escape; what stands for a byte of a
    file's name that is no UTF-8 as `\\xe9`."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else _escape(c) for c in text)


def _escape(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # as the system's names are decoded (PEP 383)
        return f"\\x{code - 0xDC00:02x}"
    return character.encode("unicode_escape").decode("ascii")


FORMULA_STARTS: Final = ("=", "+", "-", "@", "\t", "\r", "\n")
"""How a cell begins that a spreadsheet would run as a formula; an apostrophe before it keeps it a text."""


def device_text(data: bytes) -> str:
    """A device's string: ASCII by the specification, UTF-8 where it is, other bytes as `\\xNN`; harmless."""
    return harmless(data.decode("utf-8", "backslashreplace"))


def is_text(data: bytes) -> bool:
    """Whether these bytes are printable ASCII, trailing NULs apart, and so probably meant as text."""
    body = data.rstrip(b"\0")
    return bool(body) and all(0x20 <= byte < 0x7F for byte in body)
