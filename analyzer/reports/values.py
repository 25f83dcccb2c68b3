"""The values of a bus as lines of the text page, and the words that the HTML page shares."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from ..registers.watch import WatchedValue

_ROWS: Final = 60  # on the page; --json has all
_NAME, _LAST = 28, 22  # columns


def lines(values: Sequence[WatchedValue]) -> Iterator[str]:
    """A table of the values, nothing where there are none."""
    if not values:
        return
    yield ""
    yield f"{'unit':>4}  {'value':<{_NAME}}{'last':<{_LAST}}{'min':>8}{'mean':>8}{'max':>8}"
    for value in values[:_ROWS]:
        numbers = "".join(f"{short(number):>8}" for number in (value.minimum, value.mean, value.maximum))
        row = f"{value.unit:>4}  {cut(label(value), _NAME - 1):<{_NAME}}{cut(value.last, _LAST - 1):<{_LAST}}{numbers}"
        yield row.rstrip()
        if value.outside:
            yield f"{'':6}{value.outside:,} of {value.readings:,} readings are outside the limits of the map"
    if len(values) > _ROWS:
        yield f"and {len(values) - _ROWS} more (--json has all)"


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
