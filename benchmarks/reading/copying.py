"""Copies: programs say the same bytes several times, each time in words of their own.

A model of kinds (a slot and who speaks): kind B repeats kind A where nearly all that B says is in what A has just said,
or in what it says next, and each event of A is repeated at most once. Never between two speakers, so that no echo is
taken for a copy of its request; never where B has no words of its own. Buffers that grow say their beginnings again.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from .lattice import ByteSpan, Slot, SpannedLine, skeleton

_WORD: Final = re.compile(r"\w")
Kind = tuple[Slot, int]
_NEAR: Final = 16  # lines between a report and its copy
_BESIDE: Final = 6  # spans of a line before one that may say the same
_LEAST: Final = 3  # bytes: fewer are in any bytes by chance
_MOST_KINDS: Final = 24
_SHARE: Final = 3  # for each event that is no copy so many are


@dataclass(slots=True)
class _KindStream:
    """All that one kind says: its bytes, where events begin in them, and the events."""

    data: bytearray = field(default_factory=bytearray)
    begins: list[int] = field(default_factory=list)
    spans: list[ByteSpan] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)  # of their lines

    def add(self, span: ByteSpan) -> None:
        self.begins.append(len(self.data))
        self.data += span.data
        self.spans.append(span)
        self.numbers.append(span.line.number)


def leave_out(lines: Sequence[SpannedLine]) -> None:
    """Mark what was said before, or is said whole behind."""
    streams: dict[Kind, _KindStream] = {}
    _groups(lines)
    heading = ""
    kinds: dict[int, Kind] = {}
    for line in lines:
        _within(line)
        if not line.taken and line.clean.strip():
            heading = skeleton(line.clean)[-40:]
        for span in line.taken:
            if not span.copy:
                bare = not any(map(str.isalpha, span.slot[0]))
                slot = (f"{heading}|{span.slot[0]}", *span.slot[1:]) if bare else span.slot
                kinds[id(span)] = (slot, span.mark)
                streams.setdefault(kinds[id(span)], _KindStream()).add(span)
    for stream in streams.values():
        _growing(stream)
        _twice(stream)
    slots: dict[Slot, int] = {}
    for kind, stream in streams.items():
        slots[kind[0]] = min(slots.get(kind[0], stream.numbers[0]), stream.numbers[0])
    by_first = sorted(streams, key=lambda kind: streams[kind].numbers[0])
    spans = [span for line in lines for span in line.taken]
    for kind in by_first[:_MOST_KINDS]:
        others = [slot for slot in slots if slot != kind[0]] if _has_words(kind) else []
        for chosen in (
            ([slot] for slot in others[:_MOST_KINDS])
            if len(others) < 2
            else ([*([slot] for slot in others[:_MOST_KINDS]), others])
        ):
            other = _KindStream()
            for span in spans:
                if not span.copy and kinds[id(span)][0] in chosen and not {span.mark, kind[1]} >= {1, 2}:
                    other.add(span)
            if other.spans:
                _repeats(streams[kind], other)


def _groups(lines: Sequence[SpannedLine]) -> None:
    """Of a frame in parts those that say what was said whole, or in other parts: a frame, then its fields."""
    groups: dict[int, list[ByteSpan]] = defaultdict(list)
    order: list[list[ByteSpan]] = []
    for line in lines:
        for span in line.taken:
            if span.joined:
                groups[span.joined].append(span)
                if len(groups[span.joined]) == 1:
                    order.append(groups[span.joined])
            elif span.whole:
                order.append([span])
    said: list[tuple[bytes, int, bool]] = []  # data, the last line, whether in parts
    for group in order:
        data, first = b"".join(span.data for span in group), group[0].line.number
        for earlier, last, parts in said[-8:]:
            inside = parts and first <= last
            if (
                len(group) > 1
                and (earlier == data or (inside and data in earlier))
                and first - last < _NEAR
                and (inside or _has_letters(group))
            ):
                for span in group:
                    span.copy = last
        said.append((data, group[-1].line.number, len(group) > 1))


def _has_letters(group: Sequence[ByteSpan]) -> bool:
    """Whether words tell what each part is."""
    texts = {
        re.sub(r"[^^\W\d_]*\d\w*", "", span.line.clean[: span.of.start] + span.line.clean[span.of.end :]).strip()
        for span in group
    }
    return len(texts) * 2 > len(group)


def _has_words(kind: Kind) -> bool:
    return any(map(str.isalpha, kind[0][0]))


def _within(line: SpannedLine) -> None:
    """What stands twice in a line, with nobody else speaking between: `'\\x01…' (01 03 …)`."""
    taken = line.taken
    for i, span in enumerate(taken):
        for earlier in taken[max(i - _BESIDE, 0) : i]:
            same = span.data == earlier.data or (len(span.data) >= _LEAST and span.data in earlier.data)
            between = any(earlier.of.end <= mark.start < span.of.start for mark in line.marks)
            echo = (
                span.whole
                and all(one.repeats for one in span.checked)
                and span.of.writing == earlier.of.writing
                and not _WORD.search(line.clean, earlier.of.end, span.of.start)
            )
            if (
                same
                and not echo
                and not earlier.copy
                and not between
                and span.mark == earlier.mark
                and len(span.data) > 1
            ):
                span.copy = line.number
            elif (
                not same
                and len(earlier.data) >= _LEAST
                and earlier.data in span.data
                and span.mark == earlier.mark
                and not between
            ):
                earlier.copy = line.number


def _growing(stream: _KindStream) -> None:
    """Of a buffer that is shown each time that more has come, the last."""
    spans = stream.spans
    grown = [
        i for i in range(len(spans) - 1)
        if not spans[i].whole
        and len(spans[i].data) < len(spans[i + 1].data)
        and spans[i + 1].data.startswith(spans[i].data)
    ]  # fmt: skip
    if any(len(spans[i].data) >= 2 and (spans[i + 1].whole or i + 1 in grown) for i in grown):
        for i in grown:
            spans[i].copy = spans[i + 1].line.number


def _twice(stream: _KindStream) -> None:
    """Where each event of a kind comes k times at one time, once."""
    groups: list[list[ByteSpan]] = []
    for span in stream.spans:
        if groups and groups[-1][0].data == span.data and groups[-1][0].line.t_ns == span.line.t_ns and span.line.fine:
            groups[-1].append(span)
        else:
            groups.append([span])
    if len(stream.spans) > 1 and all(len(group) > 1 and len(group[0].data) >= 4 for group in groups):
        for group in groups:
            for span in group[1:]:
                span.copy = group[0].line.number


def _repeats(stream: _KindStream, other: _KindStream) -> None:
    """Leave out what a kind says of that which another has said, where it says nothing else."""
    hits: list[tuple[ByteSpan, int]] = []
    misses = 0
    at = 0  # in the other's bytes: what was repeated is not repeated again
    for span in stream.spans:
        if span.copy:
            continue
        found = _found(span, other, at)
        if found is None:
            misses += 1
            continue
        begin, number = found
        at = begin
        hits.append((span, number))
    if len(hits) >= 1 and misses * _SHARE <= len(hits) and _are_copies(hits, stream, other):
        for span, number in hits:
            span.copy = number


def _are_copies(hits: Sequence[tuple[ByteSpan, int]], stream: _KindStream, other: _KindStream) -> bool:
    """Whether two kinds report the same, rather than say the same to each other."""
    alike = all(span.whole for span, _ in hits) and all(one.whole for one in other.spans)
    if not alike or stream.spans[0].mark or other.spans[0].mark:
        return True
    return any(not all(one.repeats for one in span.checked) for span, _ in hits)


def _found(span: ByteSpan, other: _KindStream, at: int) -> tuple[int, int] | None:
    """Where in another kind's bytes, from a place on, those of a span are, near it: said before, or whole behind."""
    if len(span.data) < _LEAST:
        return None
    number = span.line.number
    first, last = bisect_left(other.numbers, number - _NEAR), bisect_left(other.numbers, number + _NEAR)
    behind = bisect_left(other.numbers, number + 1)
    if first >= last:
        return None
    begin = max(other.begins[first], at)
    end = other.begins[behind] if behind < len(other.begins) else len(other.data)
    place = other.data.find(span.data, begin, end)
    if place < 0 and not span.whole:
        for i in range(behind, last):
            if (
                other.spans[i].right
                and len(other.spans[i].data) > len(span.data)
                and not other.spans[i].copy
                and span.data in other.spans[i].data
            ):
                return other.begins[i], other.numbers[i]
    if place < 0:
        return None
    i = bisect_left(other.begins, place + 1) - 1
    return None if other.spans[i].copy else (place, other.numbers[i])
