"""Kinds of fields: what each can be compared with, how that is written, and what it comes to.

A kind turns what stands behind a field's name into something wanted (`tree.Wanted`), or says at which column it cannot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Final, Protocol

from ..languages import tr
from ..tables.columns import AREA_CODES, AreaCode
from . import FilterError, meant
from .literals import Item, Literal, a_text, alone, duration, hex_bytes, moment_ns, plain_number, spelled, typed_name
from .tree import Bound, BytesWanted, Chars, Since, Span, Spans, TextPart, TextWanted, Wanted

EQUAL: Final = ("==", "!=")
ORDER: Final = ("<", "<=", ">", ">=")
BITS: Final = (AreaCode.COILS, AreaCode.DISCRETE_INPUTS)
REGISTERS: Final = (AreaCode.INPUT_REGISTERS, AreaCode.HOLDING_REGISTERS)
_SHOWN: Final = {BITS[-1]: "000017, 10020, 1x20", REGISTERS[-1]: "40108, 400108, 4x108"}


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A value that can be completed: what is typed, and a word of help."""

    text: str
    help: str


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
            return moment_ns(literal)
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
        wanted = tuple(hex_bytes(alone(item)) for item in items)
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


def _integer(literal: Literal, most: int) -> int:
    return int(NumberKind(0, most).bound(literal))  # type: ignore[arg-type]


def _bound_number(bound: Bound) -> float:
    return bound.count if isinstance(bound, Chars) else bound.ns if isinstance(bound, Since) else bound


def _all(named: Iterable[str]) -> str:
    names = list(named)
    return tr("; there are {names}", names=", ".join(names)) if len(names) <= 8 else ""
