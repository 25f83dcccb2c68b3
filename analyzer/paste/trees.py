"""A paste as text: what was taken and why, then each frame as one line in words and a line a field.

Columns are offset in the frame, bytes, name, meaning. What is wrong stands on the line that it concerns, marked `!`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from dissectors.annotation import Field
from dissectors.lengths import Role

from .model import Found, Noise, Paste

_HEX_BYTES: Final = 8  # of a field that are shown; the frame's are all in --json
_BOLD, _DIM, _RED, _PLAIN = "\x1b[1m", "\x1b[2m", "\x1b[31m", "\x1b[0m"
_NONE: Final = ("", "", "", "")


def tree(paste: Paste, *, colour: bool = False) -> str:
    """The paste as lines, newline at the end."""
    bold, dim, red, plain = (_BOLD, _DIM, _RED, _PLAIN) if colour else _NONE
    lines = [f"{dim}{paste.why}{plain}"]
    for piece in paste.pieces:
        lines.append("")
        if isinstance(piece, Noise):
            lines.append(f"{bold}in no frame{plain}  {count(piece.length)} at {piece.start}: {shown(piece.data, 16)}")
            continue
        lines.append(f"{bold}{heading(piece)}{plain}")
        problem = trouble(piece)
        if problem:
            lines.append(f"{red}! {problem}{plain}")
        fields = piece.fields()
        lines.extend(_rows(fields, red, dim, plain))
        if piece.also is not None:
            lines.extend(_other(piece, piece.also, fields, (bold, red, dim, plain)))
    return "\n".join(lines) + "\n"


def heading(frame: Found, role: Role | None = None) -> str:
    """A frame in one line: direction, then its summary."""
    return f"{(frame.role if role is None else role).name.lower():<8}  {frame.summary(role)}"


def trouble(frame: Found) -> str | None:
    """What is wrong with the frame as a whole, and what can still be read."""
    adu = frame.adu
    if frame.missing:
        least = "" if _length_known(frame) else "at least "
        return f"cut: needs {least}{frame.missing} more {'byte' if frame.missing == 1 else 'bytes'}; what is there is read"
    if adu.check_ok is False and adu.check_computed is not None and adu.check_received is not None:
        name, order = ("LRC", 1) if adu.protocol == "ascii" else ("CRC", 2)
        received = adu.check_received.to_bytes(order, "little").hex(" ").upper()
        computed = adu.check_computed.to_bytes(order, "little").hex(" ").upper()
        return f"{name} wrong: {received} received, {computed} computed; the fields are as received and may be damaged"
    return None


def _length_known(frame: Found) -> bool:
    from .tiling import predicted

    if frame.adu.protocol == "tcp":
        return len(frame.adu.data) > 6
    return predicted(frame.adu.data, frame.role) is not None


def _other(frame: Found, role: Role, fields: Sequence[Field], style: tuple[str, str, str, str]) -> Iterator[str]:
    """The same bytes as the other direction."""
    bold, red, dim, plain = style
    others = frame.fields(role)
    yield ""
    if others == fields:
        yield f"{bold}or {role.name.lower()}{plain}  the same bytes, field by field: requests and answers of this function look alike"
        return
    yield f"{bold}or {heading(frame, role)}{plain}"
    yield from _rows(others, red, dim, plain)


def _rows(fields: Sequence[Field], red: str, dim: str, plain: str) -> Iterator[str]:
    flat = list(_flat(fields, 0))
    hexes = [_bytes(field, depth) for depth, field in flat]
    names = ["  " * depth + field.name for depth, field in flat]
    wide = min(max((len(text) for text in hexes), default=0), 3 * _HEX_BYTES + 2)
    long = min(max((len(text) for text in names), default=0), 30)
    for (_, field), octets, name in zip(flat, hexes, names, strict=True):
        yield f"{dim}{field.start:>4}  {octets:<{wide}}{plain}  {name:<{long}}  {field.text}".rstrip()
        if field.problem:
            yield f"{red}{'':>4}  {'':<{wide}}  ! {field.problem}{plain}"


def _flat(fields: Sequence[Field], depth: int) -> Iterator[tuple[int, Field]]:
    for field in fields:
        yield depth, field
        yield from _flat(field.fields, depth + 1)


def _bytes(field: Field, depth: int) -> str:
    if field.bit is not None:
        return f"bit {field.bit}" if field.bits == 1 else f"bits {field.bit}-{field.bit + (field.bits or 1) - 1}"
    return "" if field.fields and depth else shown(bytes.fromhex(field.raw), _HEX_BYTES)


def shown(data: bytes, most: int) -> str:
    """Bytes in hex, the first ones of many."""
    return data[:most].hex(" ").upper() + (" …" if len(data) > most else "")


def count(number: int) -> str:
    """`1 byte`, `2 bytes`."""
    return f"{number} byte" if number == 1 else f"{number} bytes"
