"""The parts of a tail on one line, in pieces: as summaries have them, or as the fields that hold them do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from string import Formatter
from typing import Any

import construct
import numpy as np
from numpy.typing import NDArray

from dissectors.blocks import EachByte
from dissectors.columnar import Spot
from dissectors.declaration import AnyConstruct
from dissectors.fields import filled
from dissectors.layout import described

from .blocks import EachText, RegisterText
from .nested import (
    BODY,
    BlockPart,
    NoPiecesError,
    Page,
    PartSetters,
    Setter,
    blocks_of,
    kind_of,
    values_of,
)
from .sheet import Ints, Pieces, Store

Escape = Callable[[str], bytes]


@dataclass(frozen=True, slots=True)
class PartTexts:
    """Makes what sets parts as text; `placeholder`: a part's name, and how that one stands there."""

    store: Store
    escape: Escape
    brief: bool
    placeholder: tuple[str, str] = ("", "")

    def made(self, named: PartSetters, name: str, con: AnyConstruct) -> Setter:
        """What sets a part."""
        makers: dict[str, Callable[[], Setter]] = {
            "number": lambda: self._number(name, con),
            "block": lambda: BlockLine(con, self.store, self.escape),
            "level": lambda: _LevelLine(con, named, self),
            "bytes": lambda: self._bytes(name, con),
        }
        return makers[kind_of(con)]()

    def _number(self, name: str, con: Any) -> Setter:
        width: int = con.width
        texts = self.store.table(lambda value: self._text(name, con, value.to_bytes(width, "big")))
        return RowPiece(lambda spot, page: texts.take_pieces(values_of(width, spot, page.source)))

    def _bytes(self, name: str, con: Any) -> Setter:
        texts = self.store.table_by_key(lambda data: self._text(name, con, data))
        return RowPiece(lambda spot, page: texts.take_pieces(list(page.bytes_of(spot))))

    def _text(self, name: str, con: Any, data: bytes) -> bytes:
        field = described(name, con, BODY, data, brief=self.brief)
        return self.escape(filled(dict([self.placeholder]).get(name, f"{{{name}}}"), [field]) or "")

    def literal(self, text: str) -> Setter:
        """What sets the same text everywhere."""
        escaped = self.escape(text)
        return RowPiece(lambda spot, page: np.full(len(spot.pdu), self.store.fixed(escaped)))  # noqa: ARG005


@dataclass(frozen=True, slots=True)
class RowPiece:
    """A piece of each row."""

    pieces: Callable[[Spot, Page], Pieces]

    def count(self, spot: Spot, counts: Ints) -> None:
        """One."""
        counts[spot.pdu] += 1

    def put(self, spot: Spot, page: Page, first: bool = False) -> None:  # noqa: ARG002
        """This one."""
        with page.cursor.part(spot.pdu) as mine:
            mine.put(self.pieces(spot, page))


class BlockLine:
    """The values of a block."""

    def __init__(self, part: Any, store: Store, escape: Escape) -> None:
        self._part: BlockPart = part
        self._line = EachText(part, store, escape) if isinstance(part, EachByte) else RegisterText(part, store)

    def count(self, spot: Spot, counts: Ints) -> None:
        """Those of each line."""
        counts[spot.pdu] += self._line.sizes(blocks_of(self._part, spot))

    def put(self, spot: Spot, page: Page, first: bool = False) -> None:  # noqa: ARG002
        """The pieces of all lines."""
        with page.cursor.part(spot.pdu) as mine:
            self._line.put(blocks_of(self._part, spot), page.source, mine)


class _LevelLine:
    """The parts of a list one after the other, or those of a record by its words."""

    def __init__(self, con: AnyConstruct, named: PartSetters, lines: PartTexts) -> None:
        template = getattr(con, "words", "")
        if template and any(isinstance(part.subcon, construct.Switch) for part in getattr(con, "subcons", ())):
            raise NoPiecesError  # not all that the words name may be there
        self._words = TemplateText(template, con, lines, lines) if template else None
        if self._words is not None and not self._words.says_something:
            raise NoPiecesError  # all may come to nothing, and then the parts' own texts stand there
        self._between = lines.literal(", ")
        self._named = named

    def count(self, spot: Spot, counts: Ints) -> None:
        for setter, inner in self._segments(spot):
            setter.count(inner, counts)

    def put(self, spot: Spot, page: Page, first: bool = False) -> None:  # noqa: ARG002
        for setter, inner in self._segments(spot):
            setter.put(inner, page)

    def _segments(self, spot: Spot) -> Iterator[tuple[Setter, Spot]]:
        if self._words is not None:
            yield from self._words.segments(spot)
            return
        for i, inner in enumerate(spot.inner):
            if i:
                yield self._between, inner
            yield self._named.of(inner), inner


class TemplateText:
    """A template over the named parts of a struct; `first` makes what a text begins with. Raises NoPiecesError."""

    def __init__(self, template: str, con: AnyConstruct, first: PartTexts, lines: PartTexts) -> None:
        self._segments: list[tuple[str, PartSetters] | Setter] = []
        for literal, name, noun, _ in Formatter().parse(template):
            if literal:
                self._segments.append((lines if self._segments else first).literal(literal))
            if name is not None:
                maker = lines if self._segments else first
                maker = replace(maker, placeholder=(name, f"{{{name}:{noun or ''}}}"))
                named = PartSetters(con, None, maker.made)
                self._segments.append((name, named))
                if (noun or maker.escape != lines.escape) and _kinds(name, named) != {"number"}:
                    raise NoPiecesError  # of other parts only the whole of a text tells how it begins

    @property
    def says_something(self) -> bool:
        """Whether there is a text in any case."""
        return any(
            not isinstance(each, tuple) or not _kinds(*each).intersection(("bytes", "level")) for each in self._segments
        )

    def fits(self, spot: Spot, count: int) -> NDArray[np.bool_]:
        """Which rows have all that the template names."""
        names = {each[0] for each in self._segments if isinstance(each, tuple)}
        missing = np.zeros((len(names), count), np.bool_)
        missing[:, spot.pdu] = True
        for name, lacks in zip(names, missing, strict=True):
            for inner in spot.inner:
                lacks[inner.pdu] &= inner.name != name
        fits: NDArray[np.bool_] = np.logical_not(missing.any(0))
        return fits

    def segments(self, spot: Spot) -> Iterator[tuple[Setter, Spot]]:
        """What is set one after the other, each with the part that it is of."""
        for each in self._segments:
            if isinstance(each, tuple):
                yield from ((each[1].of(inner), inner) for inner in spot.inner if inner.name == each[0])
            else:
                yield each, spot


def _kinds(name: str, named: PartSetters) -> set[str]:
    """Of what kinds the parts of that name are."""
    return {kind_of(con) for con in named.parts(name)}
