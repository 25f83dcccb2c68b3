"""What stands behind a form's numbers and has no fixed places: lists, alternatives, blocks of odd kinds, in pieces.

Where each part lies is found for all rows at once (`dissectors.columnar.spots`). What a part becomes hangs on its
place and on its bytes: numbers and registers on these two apart, bytes of the device's own as they are. Here is what
a part is; `nested_lines` and `nested_fields` set it. A declaration with a part of another kind has no such pieces, and
the annotation of each of its frames tells.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final, Protocol

import construct
import numpy as np

from dissectors.blocks import EachByte, Items, Record, Registers, Variant
from dissectors.columnar import Spot
from dissectors.declaration import AnyConstruct, Number, dependencies
from dissectors.layout import described
from dissectors.length_rules import field_names

from .forms import BatchBytes, FormBlocks, FormRows
from .sheet import Cursor, Ints

BlockPart = Registers | EachByte

BODY: Final = 2  # where a declared part begins in an ADU at the earliest


class NoPiecesError(Exception):
    """A part that nothing here sets."""


@dataclass(frozen=True, slots=True, eq=False)
class Page:
    """Where parts of some rows are set: `begins` is where their ADUs begin in the bytes."""

    source: BatchBytes
    cursor: Cursor
    begins: Ints

    @classmethod
    def of(cls, rows: FormRows, source: BatchBytes, cursor: Cursor) -> Page:
        """That of a form's rows."""
        return cls(source, cursor, source.pdus.begins[rows.here] - 1)

    def places(self, spot: Spot) -> Ints:
        """Where a part begins in each ADU."""
        return spot.at - self.begins[spot.pdu]

    def bytes_of(self, spot: Spot) -> Iterator[bytes]:
        """The bytes of a part."""
        for at, size in zip(spot.at.tolist(), spot.sizes.tolist(), strict=True):
            yield self.source.pdus.data[at : at + size].tobytes()


class Setter(Protocol):
    """What sets a part of some kind: of all rows that have it at one place of their order (`spot`)."""

    def count(self, spot: Spot, counts: Ints) -> None:
        """Add to each row how many pieces it has of that part."""

    def put(self, spot: Spot, page: Page, first: bool = False) -> None:
        """These pieces; of fields the `first` has no comma before it."""


Made = Callable[["PartSetters", str, AnyConstruct], Setter]


class PartSetters:
    """The named parts of a declaration, each with what sets it."""

    def __init__(self, con: AnyConstruct, name: str | None, made: Made) -> None:
        self._setters: dict[tuple[str, AnyConstruct], Setter] = {}
        self._made = made
        self._add(con, name)

    def of(self, spot: Spot) -> Setter:
        """What sets these parts."""
        return self._setters[str(spot.name), spot.part]

    def parts(self, name: str) -> list[AnyConstruct]:
        """All parts of that name. Raises NoPiecesError where there is none."""
        found = [con for each, con in self._setters if each == name]
        if not found:
            raise NoPiecesError
        return found

    def _add(self, con: AnyConstruct, name: str | None) -> None:
        while isinstance(con, construct.Renamed):
            name, con = name or str(con.name), con.subcon
        if type(con) in (construct.Switch, Variant):
            self._add_cases(con, name)
            return
        for part in _inner(con):
            self._add(part, None)
        if name is not None:
            self._setters[name, con] = self._made(self, name, con)
        elif not isinstance(con, construct.Struct):
            raise NoPiecesError

    def _add_cases(self, con: Any, name: str | None) -> None:
        for case in (*con.cases.values(), con.default):
            if isinstance(case, construct.Renamed | construct.Switch):
                raise NoPiecesError
            if case is not construct.Pass:
                self._add(case, None if type(con) is Variant else name)


def _inner(con: Any) -> list[AnyConstruct]:
    """The parts of a list or a struct, of which each must have a name of its own."""
    if isinstance(con, Items):
        if {con.octets, con.number}.intersection(field_names(con.subcon)):
            raise NoPiecesError
        return [con.subcon]
    parts: list[Any] = list(con.subcons) if isinstance(con, construct.Struct) else []
    names = [part.name for part in parts]
    names += {each.name for part in parts for case in _cases(part) for each in getattr(case, "subcons", ())}
    if len({None, *names}) <= len(names):
        raise NoPiecesError
    return parts


def _cases(con: Any) -> list[AnyConstruct]:
    """The alternatives whose parts stand beside those before them."""
    inner = getattr(con, "subcon", con)
    return [*inner.cases.values(), inner.default] if isinstance(inner, Variant) else []


def kind_of(con: Any) -> str:
    """How a part is said. Raises NoPiecesError where more than its place and its bytes tells."""
    if type(con) in (Items, construct.Struct, Record):
        return "level"
    if dependencies(con) != ():
        raise NoPiecesError
    if isinstance(con, Registers | EachByte):
        return "block"
    told_by_value = isinstance(con, Number) and not described("", con, BODY, bytes(con.width)).fields
    return "number" if told_by_value else "bytes"


def values_of(width: int, spot: Spot, source: BatchBytes) -> Ints:
    return source.octets(spot.at) if width == 1 else source.words(spot.at)


def width_of(part: BlockPart) -> int:
    return 2 if isinstance(part, Registers) else 1


def blocks_of(part: BlockPart, spot: Spot) -> FormBlocks:
    return FormBlocks(spot.at, spot.sizes, np.full(len(spot.at), -1), spot.sizes // width_of(part))
