"""The parts of a tail as JSON, in pieces: what stands before a value hangs on its place, the rest on the value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from captures.ragged import counted_on
from dissectors.blocks import Registers
from dissectors.columnar import Spot
from dissectors.declaration import AnyConstruct
from dissectors.layout import Slots, Tail, described
from dissectors.length_rules import Role

from .blocks import NumberJson, block_pieces, register_rests
from .forms import BatchBytes, FormPart, FormRows
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
    width_of,
)
from .nested_lines import BlockLine, PartTexts
from .sheet import Cursor, Ints, Store, encoded, inside, parted, without

_SIZE_BITS: Final = 9  # of a part in an ADU, and of its place there


@dataclass(frozen=True, slots=True)
class Fields:
    """Makes what sets parts as JSON; `lines` their texts."""

    store: Store
    lines: PartSetters

    def made(self, named: PartSetters, name: str, con: AnyConstruct) -> Setter:
        """What sets a part."""
        makers: dict[str, Callable[[], Setter]] = {
            "number": lambda: _NumberField(name, con, self.store),
            "block": lambda: _BlockField(name, con, self.store),
            "level": lambda: _LevelField(name, self, named),
            "bytes": lambda: _BytesField(name, con, self.store),
        }
        return makers[kind_of(con)]()


def _put_openings(cursor: Cursor, openings: Ints, first: bool) -> None:
    cursor.put(without(openings, 1) if first else openings)


class _NumberField:
    def __init__(self, name: str, part: Any, store: Store) -> None:
        self._width: int = part.width
        zero = bytes(part.width)
        self._openings = store.table(lambda at: b"," + parted(described(name, part, at, zero))[0])
        self._rest = store.table(
            lambda value: b"".join(parted(described(name, part, BODY, value.to_bytes(part.width, "big")))[1:])
        )

    def count(self, spot: Spot, counts: Ints) -> None:
        counts[spot.pdu] += 2

    def put(self, spot: Spot, page: Page, first: bool = False) -> None:
        with page.cursor.part(spot.pdu) as mine:
            _put_openings(mine, self._openings.take_pieces(page.places(spot)), first)
            mine.put(self._rest.take_pieces(values_of(self._width, spot, page.source)))


class _BytesField:
    def __init__(self, name: str, part: Any, store: Store) -> None:
        self._texts = store.table_by_key(lambda key: b"," + encoded(described(name, part, *key).to_json()))

    def count(self, spot: Spot, counts: Ints) -> None:
        counts[spot.pdu] += 1

    def put(self, spot: Spot, page: Page, first: bool = False) -> None:
        keys = list(zip(page.places(spot).tolist(), page.bytes_of(spot), strict=True))
        with page.cursor.part(spot.pdu) as mine:
            _put_openings(mine, self._texts.take_pieces(keys), first)


class _Heads:
    """A field that holds others, up to its bytes, which end before its text."""

    PIECES = 3

    def __init__(self, name: str, store: Store) -> None:
        self._texts = store.table(lambda key: _head(name, key >> _SIZE_BITS, key & ((1 << _SIZE_BITS) - 1)))

    def put(self, spot: Spot, page: Page, cursor: Cursor, first: bool) -> None:
        """These pieces."""
        _put_openings(cursor, self._texts.take_pieces(page.places(spot) << _SIZE_BITS | spot.sizes), first)
        cursor.put(page.source.hex(spot.at, spot.sizes, cursor.sheet))
        cursor.put(b'","text":"')


def _head(name: str, at: int, size: int) -> bytes:
    line = {"name": name, "start": at, "length": size, "value": None, "raw": ""}
    return b"," + encoded(line)[: -len(b'"}')]


_FIELDS: Final = b'","fields":['
_END: Final = b"]}"


class _BlockField:
    """A block of registers, or of bytes that each stand for something, with its elements."""

    def __init__(self, name: str, part: Any, store: Store) -> None:
        self._part: BlockPart = part
        self._head = _Heads(name, store)
        self._line = BlockLine(part, store, inside)
        self._empty = _BytesField(name, part, store)
        width = width_of(part)
        self._openings = store.table(lambda at: b"," + parted(_element(name, part, at, bytes(width)))[0])
        self._rest = store.table_of_many(lambda values: _rests(name, part, width, values))

    def count(self, spot: Spot, counts: Ints) -> None:
        empty, there = _parted(spot, len(counts))
        self._empty.count(empty, counts)
        self._line.count(there, counts)
        counts[there.pdu] += _Heads.PIECES + 2 + 2 * blocks_of(self._part, there).counts

    def put(self, spot: Spot, page: Page, first: bool = False) -> None:
        empty, there = _parted(spot, len(page.begins))
        self._empty.put(empty, page, first)
        with page.cursor.part(there.pdu) as mine:
            self._head.put(there, page, mine, first)
        self._line.put(there, page)
        with page.cursor.part(there.pdu) as mine:
            self._put_elements(there, page, mine)

    def _put_elements(self, spot: Spot, page: Page, cursor: Cursor) -> None:
        counts, width = blocks_of(self._part, spot).counts, width_of(self._part)
        i = counted_on(counts)
        openings = self._openings.take_pieces(np.repeat(page.places(spot), counts) + width * i)
        at = np.repeat(spot.at, counts) + width * i
        values = page.source.octets(at) if width == 1 else page.source.words(at)
        cursor.put(_FIELDS)
        cursor.spread(counts, np.where(i > 0, openings, without(openings, 1)), self._rest.take_pieces(values))
        cursor.put(_END)


def _parted(spot: Spot, count: int) -> tuple[Spot, Spot]:
    """Blocks without an element, and the others."""
    full = np.zeros(count, np.bool_)
    full[spot.pdu] = spot.sizes > 0
    return spot.among(~full), spot.among(full)


def _rests(name: str, part: Any, width: int, values: list[int]) -> list[bytes]:
    """The fields of these values, from the value on."""
    if isinstance(part, Registers):
        return register_rests(part, values)
    return [b"".join(parted(_element(name, part, BODY, value.to_bytes(width, "big")))[1:]) for value in values]


def _element(name: str, part: Any, at: int, data: bytes) -> Any:
    """The field of a block's only element."""
    return described(name, part, at, data).fields[0]


class _LevelField:
    def __init__(self, name: str, fields: Fields, named: PartSetters) -> None:
        self._head = _Heads(name, fields.store)
        self._lines = fields.lines
        self._named = named

    def count(self, spot: Spot, counts: Ints) -> None:
        counts[spot.pdu] += _Heads.PIECES + 2
        self._lines.of(spot).count(spot, counts)
        for inner in spot.inner:
            self._named.of(inner).count(inner, counts)

    def put(self, spot: Spot, page: Page, first: bool = False) -> None:
        with page.cursor.part(spot.pdu) as mine:
            self._head.put(spot, page, mine, first)
        self._lines.of(spot).put(spot, page)
        with page.cursor.part(spot.pdu) as mine:
            mine.put(_FIELDS)
        for i, inner in enumerate(spot.inner):
            self._named.of(inner).put(inner, page, first=i == 0)
        with page.cursor.part(spot.pdu) as mine:
            mine.put(_END)


class TailPieces:
    """The JSON of a form's tail, which stands behind so many numbers. Raises NoPiecesError."""

    def __init__(self, tail: Tail, behind: int, store: Store) -> None:
        self._behind = behind
        lines = PartSetters(tail.part, tail.name, PartTexts(store, inside, brief=False).made)
        self._named = PartSetters(tail.part, tail.name, Fields(store, lines).made)

    def sizes(self, rows: FormRows) -> Ints:
        """Pieces of each row."""
        counts = np.zeros(len(rows.here), np.int64)
        for spot in rows.spots[self._behind :]:
            self._named.of(spot).count(spot, counts)
        return counts

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """These pieces."""
        page = Page.of(rows, source, cursor)
        for spot in rows.spots[self._behind :]:
            self._named.of(spot).put(spot, page)


def form_fields(store: Store, code: int, role: Role, form: Slots) -> tuple[FormPart, ...] | None:  # noqa: ARG001
    """The fields of a form's frames, from behind the function code to before the check value; None if not in pieces."""
    parts: list[FormPart] = [NumberJson(slot, store) for slot in form.numbers]
    if form.block is not None:
        parts.append(block_pieces(form.block, store))
    if form.tail is not None:
        try:
            parts.append(TailPieces(form.tail, len(form.numbers), store))
        except NoPiecesError:
            return None
    return tuple(parts)
