"""The rows before a row, across views: what a rule looks back on when something is odd."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

from ..frames import Kind, Row
from .view import View

_KEPT: Final = 32  # rows of earlier views


class Seen(NamedTuple):
    """A row that has passed, with its bytes."""

    row: Row
    captured: bytes

    @property
    def is_frame(self) -> bool:
        return self.row.kind != Kind.NOISE


class Trail:
    """Looks back from any row of a view, at most some rows into the views before."""

    def __init__(self) -> None:
        self._earlier: deque[Seen] = deque(maxlen=_KEPT)

    def back(self, view: View, place: int) -> Iterator[Seen]:
        """The rows before row number `place`, the nearest first, as many as are kept of earlier views."""
        for before in range(place - 1, max(place - 1 - _KEPT, -1), -1):
            yield seen(view, before)
        wanted = _KEPT - place
        for i, earlier in enumerate(reversed(self._earlier)):
            if i >= wanted:
                return
            yield earlier

    def go_on(self, view: View) -> None:
        """This view is done."""
        n = len(view.rows)
        for place in range(max(0, n - _KEPT), n):
            self._earlier.append(seen(view, place))


def seen(view: View, place: int) -> Seen:
    """A row of the view."""
    return Seen(Row(*view.rows[place].item()), view.bytes_of(place))
