"""Frames in words (`dissectors.annotation.summary`), put together from pieces by the templates of their functions.

A piece is what a template's placeholder becomes for one value. The text is made to stand in a quoted CSV cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from string import Formatter

import numpy as np

from dissectors.annotation import summary
from dissectors.columnar import Spot
from dissectors.declaration import Function
from dissectors.envelopes import rtu
from dissectors.fields import filled
from dissectors.functions import function
from dissectors.layout import CountedBlock, Slot, Slots, Tail
from dissectors.length_rules import Role
from dissectors.limits import EXCEPTION

from .blocks import BitText, RegisterText, block_text, numbers, taken_apart
from .forms import BatchBytes, FormPart, FormRows
from .nested import NoPiecesError, Page, Setter
from .nested_lines import Escape, PartTexts, TemplateText
from .sheet import Cursor, Ints, Store


class _Always:
    """What a template has between its placeholders."""

    def __init__(self, text: bytes) -> None:
        self._text = text

    def sizes(self, rows: FormRows) -> Ints:
        """One piece a row."""
        return np.ones(len(rows.here), np.int64)

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:  # noqa: ARG002
        """The same for all."""
        cursor.put(self._text)


class _NumberForm(_Always):
    """What a placeholder becomes by a number's value."""

    def __init__(self, slot: Slot, placeholder: str, store: Store, escape: Escape) -> None:
        self._slot = slot
        self._texts = store.table(
            lambda number: escape(filled(placeholder, [slot.described(*taken_apart(slot, number), brief=True)]) or "")
        )

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """The piece of each row."""
        cursor.put(self._texts.take_pieces(numbers(self._slot, rows.here, source)))


class _CountForm(_Always):
    """What a placeholder becomes by how many values a block has."""

    def __init__(self, block: CountedBlock, placeholder: str, store: Store, escape: Escape) -> None:
        field = block.described(b"")
        self._texts = store.table(lambda n: escape(filled(placeholder, [replace(field, value=n)]) or ""))

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:  # noqa: ARG002
        """The piece of each row."""
        cursor.put(self._texts.take_pieces(rows.blocks.counts))


class _ValuesForm:
    """A block's values on one line."""

    def __init__(self, line: RegisterText | BitText) -> None:
        self._line = line

    def sizes(self, rows: FormRows) -> Ints:
        """Pieces of each line."""
        return self._line.sizes(rows.blocks)

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """The pieces of all lines."""
        self._line.put(rows.blocks, source, cursor)


class _Exception(_Always):
    """An exception in words."""

    def __init__(self, code: int, store: Store, escape: Escape) -> None:
        self._texts = store.table(lambda number: escape(summary(rtu(bytes([0, code, number, 0, 0])), Role.RESPONSE)))

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """The piece of each row."""
        cursor.put(self._texts.take_pieces(source.pdus.number(1, 1, rows.here)))


class _TailSummary:
    """The summary of a form with a tail: rows by the first template that has all its fields. Raises NoPiecesError."""

    def __init__(self, declared: Function, role: Role, tail: Tail, begin: Escape, lines: PartTexts) -> None:
        side = role.name.lower()
        self._declaration = tail.declaration
        first = replace(lines, escape=begin)
        otherwise = f"{declared.name} {side}".replace("{", "{{").replace("}", "}}")
        templates = filter(None, (*declared.words(side), otherwise))
        self._words = [TemplateText(template, tail.declaration, first, lines) for template in templates]

    def sizes(self, rows: FormRows) -> Ints:
        """Pieces of each row."""
        counts = np.zeros(len(rows.here), np.int64)
        for setter, spot in self._segments(rows):
            setter.count(spot, counts)
        return counts

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """These pieces."""
        page = Page.of(rows, source, cursor)
        for setter, spot in self._segments(rows):
            setter.put(spot, page)

    def _segments(self, rows: FormRows) -> Iterator[tuple[Setter, Spot]]:
        """What is set one after the other, template by template."""
        count = len(rows.here)
        all_rows = np.arange(count)
        left = Spot(None, self._declaration, all_rows, all_rows, all_rows, tuple(rows.spots))
        for words in self._words:
            fits = words.fits(left, count)
            yield from words.segments(left.among(fits))
            left = left.among(~fits)


def summary_pieces(
    store: Store, begin: Escape, escape: Escape, code: int, role: Role, form: Slots
) -> tuple[FormPart, ...] | None:
    """The parts of a form's summary; None where no template can be put together so.

    `escape` makes text fit to be written, `begin` that at the beginning.
    """
    if code & EXCEPTION:
        return (_Exception(code, store, escape),)
    declared = function(code)
    if form.tail is not None and declared is not None:
        try:
            return (_TailSummary(declared, role, form.tail, begin, PartTexts(store, escape, brief=True)),)
        except NoPiecesError:
            return None
    named = {slot.name: slot for slot in form.numbers}
    fields = {*named} | ({form.block.name} if form.block is not None else set())
    for template in declared.words(role.name.lower()) if declared is not None else ():
        segments = list(Formatter().parse(template))
        names = [name for _, name, _, _ in segments if name is not None]
        if template and fields.issuperset(names):
            return _parts(segments, named, form.block, store, begin, escape)
        if any(name not in fields for name in names if name.isidentifier()):
            continue  # as `summary` does: the first that has all its fields
        return None
    return None


def _parts(
    segments: list[tuple[str, str | None, str | None, str | None]],
    named: dict[str, Slot],
    block: CountedBlock | None,
    store: Store,
    begin: Escape,
    escape: Escape,
) -> tuple[FormPart, ...] | None:
    parts: list[FormPart] = []
    for literal, name, noun, conversion in segments:
        if literal:
            parts.append(_Always((escape if parts else begin)(literal)))
        if name is None:
            continue
        if conversion or "{" in (noun or ""):
            return None
        placeholder = f"{{{name}:{noun}}}" if noun else f"{{{name}}}"
        if name in named:
            parts.append(_NumberForm(named[name], placeholder, store, escape if parts else begin))
        elif block is not None:
            parts.append(
                _CountForm(block, placeholder, store, escape) if noun else _ValuesForm(block_text(block.part, store))
            )
    return tuple(parts)
