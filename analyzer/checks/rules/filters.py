"""What the display filter can tell: whatever has no form of its own."""

from __future__ import annotations

from lark import Token

from captures.line import LineSettings

from ...filters import Filter, FilterError, compile_filter
from ..errors import CheckError
from ..forms import CHARTS, Start, form
from ..parsing import at
from .counts import PassingCount


def _filter(text: Token, line: LineSettings) -> Filter:
    try:
        return compile_filter(text, line, CHARTS.get())
    except FilterError as error:
        raise CheckError(error.message, at(text) + error.column) from error


@form(
    "none-where",
    '"none"i "where"i FILTER',
    "no row passes a display filter",
    "none where unit == 17 and exception == 4",
)
def none_where(line: LineSettings, text: Token) -> Start:
    wanted = _filter(text, line)
    return lambda: PassingCount(wanted)


@form("all-where", '"all"i "where"i FILTER ":" FILTER',
      "all rows that pass the first filter pass the second, and there are some",
      "all where function == 3 and request: quantity <= 50")  # fmt: skip
def all_where(line: LineSettings, chosen: Token, due: Token) -> Start:
    first, second = _filter(chosen, line), _filter(due, line)
    return lambda: PassingCount(first, None, second)
