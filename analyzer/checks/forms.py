"""The one collection of what a rule can say: an entry a form, found in `analyzer.checks.rules`.

    @form("at-least-frames", '"at"i "least"i NUMBER "frames"i', "it holds so many frames", "at least 100 frames")
    def at_least_frames(line: LineSettings, number: Token) -> Start:
        ...

A form's grammar is lark's; words in quotes are keywords, and the terminals below stand for the rest. The function gets
the line's settings and the terminals that were found (None for an optional one that was not), and returns what begins a
measure, or raises CheckError with a column. The parser, the errors, `--list` and `docs/check.md` follow from these.
"""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final, TypeVar

from ..registry import Registry
from .model import Measure

if TYPE_CHECKING:
    from dissectors.maps.units import UnitMaps

Start = Callable[[], Measure]
CHARTS: Final[ContextVar[UnitMaps | None]] = ContextVar("CHARTS", default=None)
"""The register maps of units, while a form's function makes a rule."""

TERMINALS: Final = r"""
thing: WORD+
numbers: NUMBER ("," NUMBER)*
ranges: RANGE ("," RANGE)*
NUMBER: /[0-9]+(\.[0-9]+)?/
COMPARED: /<=|>=|<|>/
SHARE: /p50|p95|p99|max|min|mean/i
UNIT: /(ns|us|µs|μs|ms|s|min|h)(?![a-z0-9_])/i
RANGE: /([0134]x)?[0-9]+(\s*(-|\.\.)\s*([0134]x)?[0-9]+)?/i
WORD: /[a-z_][a-z0-9_]*(-[a-z0-9_]+)*/i
FILTER: /([^:"']|"[^"]*"|'[^']*'|["'][^"']*$)+/
%import common.WS
%ignore WS
"""
# What a terminal is called in an error.
SHOWN: Final = {
    "NUMBER": "a number",
    "COMPARED": "a comparison such as <",
    "SHARE": "p50, p95, p99, max, min or mean",
    "UNIT": "a unit such as ms",
    "RANGE": "addresses such as 4x0-100 or 40001-40100",
    "WORD": "a finding's code or a plain word for it such as 'crc errors'",
    "FILTER": "a display filter (rtuscope help filters)",
    "$END": "the end",
}


@dataclass(frozen=True, slots=True)
class Form:
    """One form of rule: its grammar, what it asserts in words, examples, and what makes a measure of it."""

    name: str
    grammar: str
    help: str
    examples: tuple[str, ...]
    make: Callable[..., Start]


_F = TypeVar("_F", bound=Callable[..., Start])
_FORMS: Final = Registry[Form]("analyzer.checks.rules", "form of rule")


def form(name: str, grammar: str, help: str, *examples: str) -> Callable[[_F], _F]:
    """Enters a function as the maker of this form."""

    def enter(make: _F) -> _F:
        _FORMS.enter(name, Form(name, grammar, help, examples, make))
        return make

    return enter


@cache
def forms() -> tuple[Form, ...]:
    """All forms, a family after the other."""
    return tuple(_FORMS.entries().values())
