"""The values of a bus as lines of the text page, and the words that the HTML page shares."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from ..languages import page_words
from .findings import and_more

if TYPE_CHECKING:
    from ..registers.watch import WatchedValue

_ROWS: Final = 60  # on the page; --json has all
_NAME, _LAST = 28, 22  # columns


def lines(values: Sequence[WatchedValue]) -> Iterator[str]:
    """A table of the values, nothing where there are none."""
    if not values:
        return
    yield ""
    unit, name, last, least, mean, most = map(page_words, ("unit", "value", "last", "min", "mean", "max"))
    yield f"{unit:>4}  {name:<{_NAME}}{last:<{_LAST}}{least:>8}{mean:>8}{most:>8}"
    for value in values[:_ROWS]:
        numbers = "".join(f"{short(number):>8}" for number in (value.minimum, value.mean, value.maximum))
        row = f"{value.unit:>4}  {cut(label(value), _NAME - 1):<{_NAME}}{cut(value.last, _LAST - 1):<{_LAST}}{numbers}"
        yield row.rstrip()
        if value.outside:
            outside = "{some:,} of {all:,} readings are outside the limits of the map"
            yield f"{'':6}{page_words(outside, some=value.outside, all=value.readings)}"
    if len(values) > _ROWS:
        yield and_more(len(values) - _ROWS, "more value", "more values")


def label(value: WatchedValue) -> str:
    """The name by a map; else where it stands, and as what it is read."""
    return value.name or f"{value.area} {value.address} {value.type}"


def short(number: float | None) -> str:
    """A number in at most seven characters."""
    if number is None:
        return ""
    text = f"{number:.5g}"
    return text if len(text) <= 7 else f"{number:.2g}" if len(f"{number:.2g}") <= 7 else f"{number:.0e}"


def cut(text: str, width: int) -> str:
    """A text in so many columns."""
    return text if len(text) <= width else f"{text[: width - 2]}.."
