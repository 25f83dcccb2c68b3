"""What notebooks show: small tables in HTML, of texts that are foreign, as those for a terminal are.

Whatever a line or a file brings is made harmless (`dissectors.values.harmless`) and escaped here, and nowhere else.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import Any, Final, Generic, TypeVar

from dissectors.values import harmless

_SHOWN: Final = 20
_LEFT: Final = ' style="text-align: left"'

Item = TypeVar("Item")


def html_text(value: object) -> str:
    """A value as text that is only text."""
    return html.escape(harmless("" if value is None else str(value)))


def html_table(head: Sequence[object], lines: Iterable[Sequence[object]]) -> str:
    """A table; no row of heads where there are none."""
    top = "".join(f"<th{_LEFT}>{html_text(cell)}</th>" for cell in head)
    body = "".join(f"<tr>{''.join(f'<td{_LEFT}>{html_text(cell)}</td>' for cell in line)}</tr>" for line in lines)
    return f"<table>{f'<thead><tr>{top}</tr></thead>' if head else ''}<tbody>{body}</tbody></table>"


def html_page(title: str, *parts: str) -> str:
    """A title over parts that are HTML already."""
    return f"<div><b>{html_text(title)}</b>{''.join(parts)}</div>"


class Stream(Generic[Item]):
    """An iterator that a notebook shows: its first items, read anew, so that none is taken from who iterates."""

    def __init__(
        self, make: Callable[[], Iterator[Item]], head: Sequence[str], line: Callable[[Item], Sequence[object]]
    ) -> None:
        self._make, self._head, self._line = make, head, line
        self._items: Iterator[Item] | None = None

    def __iter__(self) -> Iterator[Item]:
        return self

    def __next__(self) -> Item:
        if self._items is None:
            self._items = self._make()
        return next(self._items)

    def __repr__(self) -> str:
        return f"<to iterate over: {', '.join(self._head)}>"

    def _repr_html_(self) -> str:
        first = list(islice(self._make(), _SHOWN + 1))
        more = f"<p>the first {_SHOWN}; there are more</p>" if len(first) > _SHOWN else ""
        return html_table(self._head, map(self._line, first[:_SHOWN])) + more


class ShownList(list[Item]):
    """A list that a notebook shows one under another."""

    def _repr_html_(self) -> str:
        shown: list[Any] = [*self]
        return "".join(each._repr_html_() for each in shown) or "<p>none</p>"
