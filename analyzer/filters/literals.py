"""Values as they are written in a filter, and what each comes to; a FilterError says at which column it cannot."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Final

from dissectors.values import harmless

from ..languages import tr
from ..words import UNITS_NS
from . import FilterError
from .tree import Bound, Chars

_MICRO: Final = {"µs": "us", "μs": "us"}
_LONGEST: Final = 256  # bytes or characters to look for


@dataclass(frozen=True, slots=True)
class Literal:
    """A value as it was written: a `number` (with a unit or without), an `address` (4x108), a `string` or a `word`."""

    form: str
    text: str
    column: int
    unit: str = ""

    @property
    def shown(self) -> str:
        """As the user wrote it, nearly: on one line."""
        return harmless(f"{self.text} {self.unit}".rstrip())


Item = tuple[Literal, Literal | None]  # a value, or a range of them


def plain_number(literal: Literal, noun: str) -> Decimal:
    """A number without a unit."""
    if literal.form != "number":
        raise FilterError(tr("{noun} is needed, not {this!r}", noun=noun, this=literal.shown), literal.column)
    if literal.unit:
        raise FilterError(tr("a number without a unit is needed, not {this}", this=literal.shown), literal.column)
    digits = literal.text.lower().lstrip("-")
    if digits.startswith("0x"):
        return Decimal(int(literal.text, 16))
    return Decimal(literal.text)


def duration(literal: Literal) -> Bound:
    """A number with a unit of time: in ns, or characters."""
    if literal.form != "number":
        raise FilterError(tr("a time such as 50 ms is needed, not {this!r}", this=literal.shown), literal.column)
    unit = literal.unit.lower()
    number = plain_number(Literal("number", literal.text, literal.column), tr("a time"))
    if unit in ("char", "chars"):
        return Chars(float(number), literal.column)
    if not unit:
        if number == 0:
            return 0
        message = tr("a time needs a unit: {number} us, ms, s, min, h or chars", number=literal.text)
        raise FilterError(message, literal.column)
    ns = number * UNITS_NS[_MICRO.get(unit, unit)]
    return int(ns) if ns == int(ns) else float(ns)


def alone(item: Item) -> Literal:
    """The value of an item that must not be a range."""
    literal, high = item
    if high is not None:
        raise FilterError(tr("a range needs numbers"), literal.column)
    return literal


def a_text(literal: Literal) -> str:
    """A text to look for."""
    if literal.form not in ("string", "word"):
        raise FilterError(tr('a text in quotes is needed: "{this}"', this=literal.shown), literal.column)
    if not 0 < len(literal.text) <= _LONGEST:
        raise FilterError(tr("a text of 1 to {most} characters is needed", most=_LONGEST), literal.column)
    return literal.text


def spelled(name: str) -> str:
    """A name as it is compared: case, spaces, `_` and `-` do not matter."""
    return re.sub(r"[\s_-]+", "-", name.strip().casefold())


def typed_name(name: str) -> str:
    """A name as it is typed."""
    return name if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name) else f'"{name}"'


def hex_bytes(literal: Literal) -> bytes:
    """Bytes to look for, as hexadecimal digits."""
    text = literal.text
    bare = re.sub(r"0x|[\s,:-]+", "", text.lower())
    if literal.form == "address" or literal.unit:
        message = tr('bytes in quotes are needed, such as "03 02", not {this}', this=literal.shown)
        raise FilterError(message, literal.column)
    if not bare or re.search(r"[^0-9a-f]", bare) or len(bare) % 2:
        message = tr('{text!r} is not a row of bytes, two hexadecimal digits each: "03 02"', text=text)
        raise FilterError(message, literal.column)
    if len(bare) > 2 * _LONGEST:
        raise FilterError(tr("at most {most} bytes can be looked for", most=_LONGEST), literal.column)
    return bytes.fromhex(bare)


def moment_ns(literal: Literal) -> int:
    """A time of the calendar, in ns since 1970; UTC unless it says its zone."""
    from datetime import UTC, datetime, timedelta

    try:
        moment = datetime.fromisoformat(literal.text.strip())
    except ValueError as error:
        message = tr('{text!r} is not a time: write "2026-11-21 08:29:51", UTC', text=literal.text)
        raise FilterError(message, literal.column) from error
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return (moment - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1) * 1000
