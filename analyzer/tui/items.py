"""What is looked at below the views: a tree of items over some bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

from ..languages import counted, tr

if TYPE_CHECKING:
    from dissectors.fields import Field


@dataclass(frozen=True, slots=True)
class Item:
    """A line of the tree.

    `name` tells it from its siblings, `text` is what it says; `start` and `length` are the bytes meant (0 bytes: none).
    `ready` is whether it begins open; `values` that it holds a register's interpretations.
    """

    name: str
    text: str
    start: int = 0
    length: int = 0
    kind: str = ""  # of text: `paint.INKS`
    label: str = ""  # shown before the text instead of the name
    children: Sequence[Item] = ()
    ready: bool = True
    values: bool = False


class UnopenedItems(Sequence[Item]):
    """At least one item, made once somebody opens what holds them: most frames are only passed by."""

    def __init__(self, make: Callable[[], Iterable[Item]]) -> None:
        self._make = make

    @cached_property
    def _made(self) -> tuple[Item, ...]:
        return tuple(self._make())

    def __bool__(self) -> bool:
        return True

    def __len__(self) -> int:
        return len(self._made)

    def __getitem__(self, index: Any) -> Any:
        return self._made[index]


@dataclass(frozen=True, slots=True)
class FrameDetail:
    """What is looked at: its bytes and what they mean."""

    title: str
    data: bytes
    items: tuple[Item, ...]
    fields: tuple[Field, ...] = ()

    def spot(self, start: int, length: int) -> str:
        """Bytes in words: `bytes 3-4 of 11`."""
        if not length:
            return counted(len(self.data), "byte", "bytes")
        if length == 1:
            return tr("byte {at} of {all}", at=start, all=len(self.data))
        return tr("bytes {at}-{to} of {all}", at=start, to=start + length - 1, all=len(self.data))


NOTHING: Final = FrameDetail("", b"", ())


def chosen(detail: FrameDetail, path: Sequence[str]) -> Item | None:
    """The item at a path of names."""
    items: Sequence[Item] = detail.items
    match = None
    for name in path:
        match = next((item for item in items if item.name == name), None)
        if match is None:
            return None
        items = match.children
    return match
