"""Kinds of fields: what each can be compared with, how that is written, and what it comes to.

A kind turns what stands behind a field's name into something wanted (`tree.Wanted`), or says at which column it cannot.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fnmatch import fnmatchcase
from typing import Final, Protocol

from dissectors.values import harmless

from ..languages import tr
from ..tables.columns import AREA_CODES, AreaCode
from ..words import UNITS_NS
from . import FilterError, meant
from .tree import Bound, BytesWanted, Chars, Since, Span, Spans, TextPart, TextWanted, Wanted

EQUAL: Final = ("==", "!=")
ORDER: Final = ("<", "<=", ">", ">=")
_MICRO: Final = {"µs": "us", "μs": "us"}
_LONGEST: Final = 256  # bytes or characters to look for
BITS: Final = (AreaCode.COILS, AreaCode.DISCRETE_INPUTS)
REGISTERS: Final = (AreaCode.INPUT_REGISTERS, AreaCode.HOLDING_REGISTERS)
_SHOWN: Final = {BITS[-1]: "000017, 10020, 1x20", REGISTERS[-1]: "40108, 400108, 4x108"}


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


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A value that can be completed: what is typed, and a word of help."""

    text: str
    help: str


Item = tuple[Literal, Literal | None]  # a value, or a range of them


class FieldKind(Protocol):
    """A kind of field."""

    @property
    def operators(self) -> tuple[str, ...]:
        """Those that it takes; `in` goes with `==`."""
        ...

    @property
    def values(self) -> str:
        """What it is compared with, for the reference."""
        ...

    def wanted(self, operator: str, items: Sequence[Item]) -> Wanted:
        """What a comparison asks for; `!=` as `==`. Raises FilterError."""
        ...

    def choices(self) -> Iterable[Suggestion]:
        """Values with a name."""
        ...


class Ordered:
    """The part that all kinds of numbers share: comparisons are spans."""

    operators: tuple[str, ...] = EQUAL + ORDER

    def bound(self, literal: Literal, *, exact: bool = True) -> Bound:
        """The number that a literal stands for; one that is only a bound may lie outside what there is."""
        raise NotImplementedError

    def area(self, literal: Literal) -> int | None:  # noqa: ARG002 - for kinds that have areas
        """The only area that a literal speaks of."""
        return None

    def choices(self) -> Iterable[Suggestion]:
        return ()

    def wanted(self, operator: str, items: Sequence[Item]) -> Wanted:
        return Spans(tuple(self._span(operator, low, high) for low, high in items))

    def _span(self, operator: str, low: Literal, high: Literal | None) -> Span:
        number, area = self.bound(low, exact=operator not in ORDER), self.area(low)
        if high is not None:
            last = self.bound(high)
            if self.area(high) != area:
                raise FilterError(tr("both ends of a range must be in the same area"), high.column)
            if type(last) is type(number) and _bound_number(last) < _bound_number(number):
                raise FilterError(tr("a range goes upwards: {low}..{high}", low=high.shown, high=low.shown), low.column)
            return Span(number, last, area=area)
        if operator in ORDER:
            strict = operator in ("<", ">")
            return Span(number, None, strict, area) if operator[0] == ">" else Span(None, number, strict, area)
        return Span(number, number, area=area)


@dataclass(frozen=True)
class NumberKind(Ordered):
    """A number from `least` to `most`; `whole` ones also in hexadecimal."""

    least: float
    most: float
    whole: bool = True

    @property
    def values(self) -> str:
        return f"number, {self.limits}"

    @property
    def limits(self) -> str:
        """From where to where."""
        if self.most >= 2**62:
            return tr("{least:g} and up", least=self.least)
        most = f"{self.most:g}" if self.most < 10**6 else f"{self.most}"
        return tr("{least:g} to {most}", least=self.least, most=most)

    def bound(self, literal: Literal, *, exact: bool = True) -> Bound:
        number = plain_number(literal, tr("a number"))
        if self.whole and number != int(number):
            raise FilterError(tr("a whole number is needed, not {this}", this=literal.shown), literal.column)
        if exact and not self.least <= number <= self.most:
            message = tr("{number} is outside {limits}", number=literal.text, limits=self.limits)
            raise FilterError(message, literal.column)
        return int(number) if self.whole else float(number)


@dataclass(frozen=True)
class Duration(Ordered):
    """A time with its unit, in ns or in characters of the line."""

    values = "time: us, ms, s, min, h, or chars (characters at the line's speed)"

    def bound(self, literal: Literal, *, exact: bool = True) -> Bound:  # noqa: ARG002 - any time may be
        return duration(literal)


@dataclass(frozen=True)
class Moment(Ordered):
    """A time since the capture's first row, or an absolute one in quotes."""

    values = 'time since the first row (12.5 s), or a date and time in quotes ("2026-11-21 08:29:51", UTC)'

    def bound(self, literal: Literal, *, exact: bool = True) -> Bound:  # noqa: ARG002 - any time may be
        if literal.form == "string":
            return _absolute(literal)
        since = duration(literal)
        if isinstance(since, Chars):
            raise FilterError(tr("a moment is told in us, ms, s, min or h"), literal.column)
        assert not isinstance(since, Since)
        return Since(since)


@dataclass(frozen=True)
class Named(Ordered):
    """Numbers that have names; `numeric` ones are compared by the number as well.

    With `contains` and `matches`, part of a name or a pattern stands for every name that has it.
    """

    what: str
    names: Callable[[], Mapping[int, str]]
    operators: tuple[str, ...] = EQUAL
    numeric: bool = False
    least: int = 0

    @property
    def values(self) -> str:
        names = list(self.names().values())
        listed = ", ".join(names) if len(names) <= 4 else "a name"
        return f"number, or {listed}" if self.numeric else listed

    def choices(self) -> Iterable[Suggestion]:
        return [Suggestion(typed_name(name), f"{tr(self.what)} {number}") for number, name in self.names().items()]

    def bound(self, literal: Literal, *, exact: bool = True) -> Bound:
        if literal.form == "number" and self.numeric:
            return NumberKind(self.least, 255).bound(literal, exact=exact)
        if literal.form not in ("word", "string"):
            message = tr("a name is needed for {what}, not {this}", what=tr(self.what), this=literal.shown)
            raise FilterError(message, literal.column)
        named = {spelled(name): number for number, name in self.names().items()}
        number = named.get(spelled(literal.text))
        if number is None:
            near = meant(spelled(literal.text), named)
            message = tr("no {what} {name!r}", what=tr(self.what), name=literal.text)
            raise FilterError(message + (near or _all(named)), literal.column)
        return number

    def wanted(self, operator: str, items: Sequence[Item]) -> Wanted:
        if operator not in (TextPart.WITHIN.value, TextPart.PATTERN.value):
            return super().wanted(operator, items)
        spans = []
        for literal, _ in items:
            needle = a_text(literal).casefold()
            for number, name in self.names().items():
                folded = name.casefold()
                if needle in folded if operator == TextPart.WITHIN.value else fnmatchcase(folded, needle):
                    spans.append(Span(number, number))
        return Spans(tuple(spans))


@dataclass(frozen=True)
class Flag(Ordered):
    """True or false."""

    operators = EQUAL
    values = "true or false; its name alone means true"

    def choices(self) -> Iterable[Suggestion]:
        return (Suggestion("true", ""), Suggestion("false", ""))

    def bound(self, literal: Literal, *, exact: bool = True) -> Bound:  # noqa: ARG002 - there are two
        truths = {"true": 1, "false": 0}
        if literal.text.lower() not in truths or literal.form != "word":
            raise FilterError(tr("true or false is needed, not {this}", this=literal.shown), literal.column)
        return truths[literal.text.lower()]


@dataclass(frozen=True)
class Addresses(Ordered):
    """Addresses. Physical ones count from 0; where `areas` are named, numbers of 5 or 6 digits are logical ones."""

    areas: tuple[AreaCode, ...] = ()

    @property
    def values(self) -> str:
        if not self.areas:
            return "physical address, 0 to 65535"
        return f"logical number ({_SHOWN[self.areas[-1]]}), or a physical address below 10000"

    def bound(self, literal: Literal, *, exact: bool = True) -> Bound:  # noqa: ARG002 - always checked
        return self._read(literal)[1]

    def area(self, literal: Literal) -> int | None:
        return self._read(literal)[0]

    def _read(self, literal: Literal) -> tuple[int | None, int]:
        from dissectors.values import AREAS, ValueFormError, physical

        digits = literal.form == "number" and literal.text.isdigit() and len(literal.text) >= 5 and not literal.unit
        if not self.areas or not (digits or literal.form == "address"):
            if literal.form == "address":
                message = tr("a physical address is needed; logical ones go with register and bit")
                raise FilterError(message, literal.column)
            return None, _integer(literal, 0xFFFF)
        try:
            area, address = physical(literal.text)
        except ValueFormError as error:
            message = tr(
                "{text!r} is not a logical address: use 40108, 400108 or 4x108, areas 0, 1, 3, 4", text=literal.text
            )
            raise FilterError(message, literal.column) from error
        if AREA_CODES[area] not in self.areas:
            fit = "bit" if AREA_CODES[area] in BITS else "register"
            message = tr(
                "{address} is a {area}: write {fit} == {address}", address=literal.text, area=tr(AREAS[area]), fit=fit
            )
            raise FilterError(message, literal.column)
        return int(AREA_CODES[area]), address


@dataclass(frozen=True)
class Hex:
    """Bytes, written in hexadecimal."""

    operators = (*EQUAL, "contains")
    values = 'bytes in quotes, such as "03 02" or "0302"'

    def choices(self) -> Iterable[Suggestion]:
        return ()

    def wanted(self, operator: str, items: Sequence[Item]) -> Wanted:
        wanted = tuple(_literal_bytes(alone(item)) for item in items)
        return BytesWanted(wanted, whole=operator != TextPart.WITHIN.value)


@dataclass(frozen=True)
class Prose:
    """Words; case does not matter."""

    operators = (*EQUAL, "contains", "matches")
    values = "text in quotes; with matches, * and ? stand for any characters and for one"

    def choices(self) -> Iterable[Suggestion]:
        return ()

    def wanted(self, operator: str, items: Sequence[Item]) -> Wanted:
        part = TextPart(operator) if operator in ("contains", "matches") else TextPart.WHOLE
        return TextWanted(tuple(a_text(alone(item)).casefold() for item in items), part)


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


def _integer(literal: Literal, most: int) -> int:
    return int(NumberKind(0, most).bound(literal))  # type: ignore[arg-type]


def _literal_bytes(literal: Literal) -> bytes:
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


def _absolute(literal: Literal) -> int:
    from datetime import UTC, datetime, timedelta

    try:
        moment = datetime.fromisoformat(literal.text.strip())
    except ValueError as error:
        message = tr('{text!r} is not a time: write "2026-11-21 08:29:51", UTC', text=literal.text)
        raise FilterError(message, literal.column) from error
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return (moment - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1) * 1000


def _bound_number(bound: Bound) -> float:
    return bound.count if isinstance(bound, Chars) else bound.ns if isinstance(bound, Since) else bound


def _all(named: Iterable[str]) -> str:
    names = list(named)
    return tr("; there are {names}", names=", ".join(names)) if len(names) <= 8 else ""
