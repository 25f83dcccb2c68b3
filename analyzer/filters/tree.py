"""A filter as a tree: tests of fields, joined by and, or, not.

What a field is compared with is one of four things: `Spans` of numbers (names become their numbers), bytes to be found
among a frame's, a text to be found in its words, or measures, which have units.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .fields import FilterField


@dataclass(frozen=True, slots=True)
class Chars:
    """A time in characters of the line, whose speed makes it ns; `column` is where it was written."""

    count: float
    column: int


@dataclass(frozen=True, slots=True)
class Since:
    """A time in ns after the capture's first row."""

    ns: int | float


Bound = int | float | Chars | Since


@dataclass(frozen=True, slots=True)
class Span:
    """Numbers from `low` to `high`, both in it unless `strict`; None is no bound. `area`: in this AreaCode alone."""

    low: Bound | None
    high: Bound | None
    strict: bool = False
    area: int | None = None


@dataclass(frozen=True, slots=True)
class Spans:
    """Any of these."""

    spans: tuple[Span, ...]


@dataclass(frozen=True, slots=True)
class BytesWanted:
    """Any of these byte strings; as the `whole` frame or somewhere in it."""

    needles: tuple[bytes, ...]
    whole: bool


class TextPart(Enum):
    """How a text is looked for."""

    WHOLE = "=="
    WITHIN = "contains"
    PATTERN = "matches"  # `*` and `?` stand for any characters and for one


@dataclass(frozen=True, slots=True)
class TextWanted:
    """Any of these texts; case does not matter."""

    needles: tuple[str, ...]
    part: TextPart


@dataclass(frozen=True, slots=True)
class MeasuredSpan:
    """Numbers in a unit of measure (empty: the value's own), from `low` to `high`; None is no bound."""

    low: float | None
    high: float | None
    strict: bool
    unit: str


@dataclass(frozen=True, slots=True)
class MeasuresWanted:
    """Any of these."""

    spans: tuple[MeasuredSpan, ...]


Wanted = Spans | BytesWanted | TextWanted | MeasuresWanted


@dataclass(frozen=True, slots=True)
class Test:
    """A row has the field (`wanted` None), has it with a wanted value, or (`negated`) has it with none of those."""

    field: FilterField
    wanted: Wanted | None = None
    negated: bool = False


@dataclass(frozen=True, slots=True)
class Not:
    part: Node


@dataclass(frozen=True, slots=True)
class And:
    parts: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Or:
    parts: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Same:
    """Tests of addresses and values that one value of the row must pass together."""

    part: Node


Node = Test | Not | And | Or | Same


def tests(node: Node) -> Iterator[Test]:
    """Every test of a tree, from left to right."""
    waiting = [node]
    while waiting:
        one = waiting.pop()
        if isinstance(one, Test):
            yield one
        else:
            waiting += reversed(parts(one))


def parts(node: Node) -> tuple[Node, ...]:
    """What a node joins."""
    if isinstance(node, Test):
        return ()
    return node.parts if isinstance(node, And | Or) else (node.part,)
