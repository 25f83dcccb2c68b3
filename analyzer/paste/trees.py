"""A paste as text: what was taken and why, then each frame as one line in words and a line a field.

Columns are offset in the frame, bytes, name, meaning. What is wrong stands on a line of its own below, marked `!`.

A frame does not say what its registers hold. A pair that is a float of everyday size in one of the two usual orders is
worth a hint; all readings are given where asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final, NamedTuple

from dissectors.fields import Field
from dissectors.length_rules import Role
from dissectors.values import Order, floating, harmless, readings

from ..languages import counted, field_name, retold, tr, wording
from ..requests.advice import enveloped
from ..terminal_text import TerminalText, painted, terminal_text
from .model import Paste, PastedFrame, PastedNoise, Piece

_HEX_BYTES: Final = 8  # of a field that are shown; --json has all
_NOISE_BYTES: Final = 16
_ASKS: Final = 3  # requests that are shown
_LEFT_OUT: Final = 12  # lines that were not read, told one by one
_NAME: Final = 24  # columns
_CHECKS: Final = ("crc", "lrc")  # their trouble is told once, above the fields


class Style(NamedTuple):
    """Graphic renditions (`painted`), empty without colour."""

    bold: str = ""
    dim: str = ""
    red: str = ""


COLOURED: Final = Style("1", "2", "31")


class _TreeRow(NamedTuple):
    at: str
    octets: str
    name: str
    text: str
    problem: str | None = None


def tree(paste: Paste, *, colour: bool = False, values: bool = False) -> TerminalText:
    """The paste as lines, newline at the end; `values` adds registers as 32- and 64-bit numbers in every order."""
    style = COLOURED if colour else Style()
    lines: list[str] = [painted(harmless(paste.why), style.dim)]
    refused = {frame.request_start for frame in paste.frames() if frame.exception is not None}
    told: set[str] = set()
    for piece in paste.pieces:
        lines.append("")
        if isinstance(piece, PastedNoise):
            octets = hex_shown(piece.data, _NOISE_BYTES)
            length = counted(piece.length, "byte", "bytes")
            where = tr("{bytes} at {start}: {octets}", bytes=length, start=piece.start, octets=octets)
            lines.append(terminal_text(painted(tr("outside frames"), style.bold), f"  {where}"))
            lines.extend(_findings(piece, style, told))
        else:
            lines.extend(_frame(piece, style, values, told, advised=piece.start not in refused))
    if left := left_out(paste):
        lines += ["", *(terminal_text(painted(tr("not read"), style.bold), f"    {line}") for line in left)]
    return terminal_text(*(terminal_text(line, "\n") for line in lines))


def left_out(paste: Paste) -> list[str]:
    """What of the text was not read, a line each; lines without anything like bytes are only counted."""
    lines = [
        tr("line {number}: {why}", number=one.line, why=harmless(retold(one.why)))
        for one in paste.unread
        if not one.empty
    ]
    if not lines:
        return lines
    if len(lines) > _LEFT_OUT:
        lines[_LEFT_OUT:] = [tr("and {lines}", lines=counted(len(lines) - _LEFT_OUT, "more line", "more lines"))]
    if empty := sum(one.empty for one in paste.unread):
        lines.append(tr("{lines} without bytes", lines=counted(empty, "line", "lines")))
    return lines


def _frame(frame: PastedFrame, style: Style, values: bool, told: set[str], *, advised: bool) -> Iterator[str]:
    yield painted(heading(frame), style.bold)
    problem = trouble(frame)
    if problem:
        yield painted(f"! {problem}", style.red)
    yield from _findings(frame, style, told)
    if advised and (advice := advice_words(frame)) is not None:
        yield painted(f"  {advice}", style.bold)
    fields = frame.fields(wording=wording())
    yield from _table(fields, style)
    if values:
        for field in fields:
            yield from every_reading(field)
    if frame.also is None:
        return
    others = frame.fields(frame.also, wording())
    yield ""
    if others == fields:
        same = tr("its request and its response look alike: all fields equal")
        yield terminal_text(painted(tr("or {name}", name=tr(frame.also.name.lower())), style.bold), f"  {same}")
        return
    yield painted(tr("or {name}", name=heading(frame, frame.also)), style.bold)
    yield from _table(others, style)


def _findings(piece: Piece, style: Style, told: set[str]) -> Iterator[str]:
    """What is wrong with a piece, likely why, and what to do; what was told above is not told again."""
    for finding in piece.findings:
        yield painted(f"! {tr(finding.severity.name.lower())} {finding.code}: {finding.text}", style.red)
        for head, words in ((tr("likely"), finding.cause), (tr("do"), finding.remedy)):
            line = f"  {head}: {words}"
            if words and line not in told:
                told.add(line)
                yield painted(line, style.dim)


def heading(frame: PastedFrame, role: Role | None = None) -> str:
    """A frame in one line: direction, unit, and what it says."""
    direction = tr((frame.role if role is None else role).name.lower())
    if frame.adu.protocol == "pdu":
        return f"{direction:<8}  {frame.summary(role, wording())}"
    unit = tr("unit {unit}", unit="?" if frame.adu.unit is None else frame.adu.unit)
    return f"{direction:<8}  {unit}: {frame.summary(role, wording())}"


def advice_words(frame: PastedFrame) -> str | None:
    """Why the request fails and what to ask instead, on one line; None where nothing tells."""
    found = frame.advice
    if found is None:
        return None
    why = {
        "range-end": tr("address + quantity runs past 65535"),
        "quantity": tr("the quantity is too large for one request"),
        "register-number": tr("a register number was sent as the address"),
        "read-function": tr("the unit does not support this function, try the other read function"),
        "write-function": tr("the unit does not support this function, try the other write function"),
        "function": tr("the unit does not support this function"),
    }[found.reason]
    if not found.ask_instead:
        return why
    shown = [enveloped(request, frame.adu.protocol) for request in found.ask_instead[:_ASKS]]
    head = tr("ask instead") if found.ask_instead[0].is_read else tr("write instead, after a check with the plant")
    return f"{why}; {head}: {', '.join(shown)}{' …' if len(found.ask_instead) > _ASKS else ''}"


def trouble(frame: PastedFrame) -> str | None:
    """What is wrong with the frame as a whole, and what can still be read."""
    adu = frame.adu
    if frame.missing:
        more = counted(frame.missing, "more byte", "more bytes")
        words = (
            tr("cut: needs {bytes}", bytes=more)
            if frame.length_known
            else tr("cut: needs at least {bytes}", bytes=more)
        )
        if (whole := frame.to_send) is not None:
            words += tr(", the CRC; the whole frame: {frame}", frame=whole.hex(" ").upper())
        return words
    if adu.check_ok is False and adu.check_computed is not None and adu.check_received is not None:
        name, width = ("LRC", 1) if adu.protocol == "ascii" else ("CRC", 2)
        received = adu.check_received.to_bytes(width, "little").hex(" ").upper()
        computed = adu.check_computed.to_bytes(width, "little").hex(" ").upper()
        return tr(
            "{name} wrong: received {received}, computed {computed}; the fields below are as received",
            name=name, received=received, computed=computed,
        )  # fmt: skip
    return None


def _table(fields: Sequence[Field], style: Style) -> Iterator[str]:
    rows = list(_rows(fields, 0))
    wide = max((len(row.octets) for row in rows), default=0)
    long = min(max((len(row.name) for row in rows), default=0), _NAME)
    for row in rows:
        means = f"  {row.name:<{long}}  {row.text}".rstrip()
        yield terminal_text(painted(f"{row.at:>4}  {row.octets:<{wide}}", style.dim), means)
        if row.problem:
            yield painted(f"{'':>{6 + wide}}  ! {row.problem}", style.red)


def _rows(fields: Sequence[Field], depth: int) -> Iterator[_TreeRow]:
    indent = "  " * depth
    floats = likely_floats(fields)
    for _, same in groupby(enumerate(fields), _row_of):
        (i, field), *others = same
        if others:
            yield _bit_row([field, *(bit for _, bit in others)], indent)
            continue
        text = field.text + (f"   {floats[i]}" if i in floats else "")
        problem = None if field.name in _CHECKS else field.problem
        yield _TreeRow(str(field.start), _octets(field), indent + field_name(field.name), text, problem)
        yield from _rows(field.fields, depth + 1)


def _row_of(place: tuple[int, Field]) -> tuple[str, int]:
    """What fields of one row share: coils or inputs of one byte stand in one, others each in their own."""
    number, field = place
    return (field.name, field.start) if field.bits == 1 else ("", number)


def _bit_row(bits: Sequence[Field], indent: str) -> _TreeRow:
    """A byte of coils on one line, the lowest address first as in the summary."""
    first, last = (bit.text.partition(":")[0] for bit in (bits[0], bits[-1]))
    states = "".join("1" if bit.value else "0" for bit in bits)
    where = tr("{first} to {last}: ", first=first, last=last) if bits[0].address is not None else ""
    name = indent + field_name(f"{bits[0].name}s")
    return _TreeRow(str(bits[0].start), bits[0].raw.upper(), name, f"{where}{states[:4]} {states[4:]}")


def _octets(field: Field) -> str:
    if field.bit is not None:
        if field.bits == 1:
            return tr("bit {bit}", bit=field.bit)
        return tr("bits {first}-{last}", first=field.bit, last=field.bit + (field.bits or 1) - 1)
    return hex_shown(bytes.fromhex(field.raw), _HEX_BYTES)


def hex_shown(data: bytes, most: int) -> str:
    """Bytes in hex, the first ones of many."""
    return data[:most].hex(" ").upper() + (" …" if len(data) > most else "")


_USUAL: Final[tuple[Order, ...]] = ("ABCD", "CDAB")
_SMALLEST: Final = 1e-3
_LARGEST: Final = 1e7
_REGISTER: Final = "register"
_WIDE: Final = {2: 18, 4: 26}  # columns of a number, by its registers


def likely_floats(fields: Sequence[Field]) -> dict[int, str]:
    """For the first register of each pair that looks like a float, by position: what to say."""
    values = [int(field.value) for field in fields if field.name == _REGISTER and isinstance(field.value, int)]
    texts: dict[int, str] = {}
    if len(values) < len(fields):
        return texts
    for i in range(0, len(values) - 1, 2):
        pair = values[i : i + 2]
        hints = [f"{order} {floating(pair, order):.7g}" for order in _USUAL if _everyday(floating(pair, order))]
        if hints and all(pair):
            texts[i] = tr("with the next as float: {readings}", readings=tr(" or ").join(hints))
    return texts


def _everyday(number: float) -> bool:
    return _SMALLEST <= abs(number) <= _LARGEST


def every_reading(field: Field) -> Iterator[str]:
    """Lines with all readings of the pairs and fours among a field's registers."""
    registers = [child for child in field.fields if child.name == _REGISTER and isinstance(child.value, int)]
    for size in (2, 4):
        if len(registers) < size:
            continue
        wide = _WIDE[size]
        yield ""
        heads = "".join(f"{f'{kind}{16 * size}':>{wide}}" for kind in ("u", "s", "f"))
        yield f"  {tr('registers'):<15}{tr('order'):<7}{heads}"
        for i in range(0, len(registers) - size + 1, size):
            yield from _by_order(registers[i : i + size], i, wide)


def _by_order(registers: Sequence[Field], first: int, wide: int) -> Iterator[str]:
    """A line an order; `first`: the number of the first register in its field."""
    by_order: dict[str, list[str]] = {}
    for reading in readings([int(register.value or 0) for register in registers]):
        if reading.order is not None:
            by_order.setdefault(reading.order, []).append(f"{reading.text:>{wide}}")
    where = f"{_name(registers[0], first)}-{_name(registers[-1], first + len(registers) - 1)}"
    for order, texts in by_order.items():
        yield f"  {where:<15}{order:<7}{''.join(texts)}"
        where = ""


def _name(register: Field, position: int) -> str:
    """Its logical address, or its place where that is not known."""
    return register.text.partition(":")[0] if register.address is not None else f"#{position}"
