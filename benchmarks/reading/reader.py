"""A text as its bytes, read by one lattice of readings."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import tzinfo
from typing import Final

from captures.text import stamps
from captures.text.judging import ByteJudge, no_judge
from captures.text.logs import Piece, UnreadLine
from captures.text.plain import plain, quoted
from captures.text.tools import LineMark, marks

from . import copying
from .lattice import ByteSpan, SlotRecord, SpannedLine, choose, join, join_neighbours, learn, settle, skeleton, weighed
from .wraps import unwrapped

_LEAST_BITS: Final = -3.0  # of what is taken where a text holds nothing better
_ALONE: Final = -6.0  # of one byte, which only stands alone
_OFFSET: Final = re.compile(r"(?:^|[^\w.:-])(?:0[xX])?([0-9A-Fa-f]{3,8})[hH]?[ \t]*[:|-]?[ \t]*$")


def read_lines(
    lines: Sequence[str], judge: ByteJudge = no_judge, zone: tzinfo | None = None
) -> list[Piece | UnreadLine]:
    """All of a text at once."""
    record = SlotRecord()
    return list(_contents(settled(list(enumerate(lines, 1)), judge, zone, record)))


def settled(
    lines: Sequence[tuple[int, str]], judge: ByteJudge, zone: tzinfo | None, record: SlotRecord
) -> list[SpannedLine]:
    """Lines with their numbers, read together: what of each is taken, and what of that was said before."""
    memory: dict[str, list[ByteSpan]] = {}
    read = [_line(number, text, judge, zone, memory) for number, text in lines]
    read = unwrapped(read, lambda number, text: _line(number, text, judge, zone, memory))
    read = once(read)
    join(read, judge, record)
    join_neighbours(read, judge, record)
    learn(read, record)
    settle(read, record)
    if not any(line.taken for line in read):
        _least(read)
    _speak(read)
    copying.leave_out(read)
    return read


def once(lines: list[SpannedLine]) -> list[SpannedLine]:
    """Lines without those that each stand there k times at one time: as many handlers print each."""
    groups: dict[str, list[list[SpannedLine]]] = {}
    for line in lines:
        if not (line.fine and line.spans):
            continue
        alike = groups.setdefault(skeleton(line.clean[: min(span.of.start for span in line.spans)]), [])
        if alike and alike[-1][0].text == line.text and line.number == alike[-1][-1].number + 1:
            alike[-1].append(line)
        else:
            alike.append([line])
    for alike in groups.values():
        if len(alike) > 1 and all(len(same) > 1 for same in alike):
            for same in alike:
                for line in same[1:]:
                    line.spans, line.said = [], same[0].number
    return lines


def _line(
    number: int, text: str, judge: ByteJudge, zone: tzinfo | None, memory: dict[str, list[ByteSpan]]
) -> SpannedLine:
    text = plain(text)
    stamp, clean = stamps.find(text, zone)
    line = SpannedLine(number, text, clean, None if stamp is None else stamp.t_ns, stamp is not None and stamp.fine)
    line.marks = _with_names(clean, marks(clean))
    line.spans = weighed(line, judge, memory)
    return line


_NAMES: Final = re.compile(
    r"(?<![\w.])([^\W_][\w.-]{0,20}?) ?([-=]{1,2}>|→|<[-=]{1,2}|←) ?([^\W_][\w.-]{0,20}?)(?=[:,\s\])])"
)


def _with_names(clean: str, found: Sequence[LineMark]) -> Sequence[LineMark]:
    """Marks of a line; of an arrow between two names, whose name comes first tells who speaks."""
    match = _NAMES.search(clean)
    if match is None or not all(any(map(str.isalpha, name)) for name in (match[1], match[3])):
        return found
    if not any(mark.arrow and match.start() <= mark.start < match.end() for mark in found):
        return found
    others = [mark for mark in found if not match.start() <= mark.start < match.end()]
    way = (
        (1 if match[1].lower() < match[3].lower() else 2)
        if match[2][0] not in "<←"
        else (2 if match[1].lower() < match[3].lower() else 1)
    )
    return [LineMark(match.start(), match.end(), way), *others]


def _least(lines: Sequence[SpannedLine]) -> None:
    """Where a text holds nothing that is plainly bytes, what is the likeliest."""
    likely = [span for line in lines for span in line.spans if len(span.of.data) > 1 or span.bits > _ALONE]
    best = max((span.bits for span in likely), default=-99.0)
    if best < _LEAST_BITS:
        return
    for line in lines:
        for span in line.spans:
            span.bits += 2.1 - best if len(span.of.data) > 1 or span.bits > _ALONE else -20
        for span in choose(line.spans):
            span.taken = True


def _speak(lines: Sequence[SpannedLine]) -> None:
    """Marks and times of what was taken: of its line, or of the heading above."""
    heading: tuple[int, int | None] | None = None
    newest: int | None = None
    for line in lines:
        taken = line.taken
        if not taken:
            if line.marks or line.t_ns is not None:
                words = [mark.mark for mark in line.marks]
                mark = words[-1] if len(set(words)) == 1 else 0
                above = heading[1] if heading is not None and line.t_ns is None else line.t_ns
                heading = mark, above
            elif line.clean.strip():
                heading = (0, heading[1]) if heading is not None else None
            continue
        _mark_spans(line, taken)
        first = taken[0]
        bare = re.search(r"[^\W\d_]", _OFFSET.sub("", line.clean[: first.of.start])) is None
        if heading is not None and bare and not any(span.mark for span in taken):
            for span in taken:
                span.mark = heading[0]
        if line.t_ns is None and heading is not None and bare:
            line.t_ns = heading[1]
        elif not bare:
            heading = None
    days = 0
    for line in lines:
        if line.t_ns is None or line.t_ns > 86_400 * 10**9:
            continue
        if newest is not None and line.t_ns + days * 86_400 * 10**9 < newest - 43_200 * 10**9:
            days += 1
        line.t_ns += days * 86_400 * 10**9
        newest = line.t_ns


def _mark_spans(line: SpannedLine, taken: Sequence[ByteSpan]) -> None:
    """Each run with the mark before it; an arrow behind the first run joins a request with its answer."""
    newest: LineMark | None = None
    ahead = 0
    pointed = any(mark.arrow and mark.end <= taken[0].of.start for mark in line.marks[:1])
    for span in taken:
        for mark in line.marks[ahead:]:
            if mark.end > span.of.start:
                break
            ahead += 1
            joins = taken[0].of.end <= mark.start and not pointed
            if not (mark.arrow and (joins or (newest is not None and newest.plain))):
                newest = mark
        span.mark = 0 if newest is None else newest.mark
    if len(taken) == 1 and not taken[0].mark:
        behind = [mark for mark in line.marks if mark.start >= taken[0].of.end and not mark.arrow]
        taken[0].mark = behind[0].mark if len(behind) == 1 else 0
    if len({span.of.gap for span in taken}) > 1 and not line.marks:
        for span in taken:
            span.mark = {"][": 1, "><": 2}.get(span.of.gap, 0)


def _contents(lines: Sequence[SpannedLine]) -> Iterable[Piece | UnreadLine]:
    above: ByteSpan | None = None
    for line in lines:
        text = line.text if len(line.text) <= 200 else line.text[:197] + "..."
        taken = line.taken
        for i, span in enumerate(taken):
            if span.copy:
                yield UnreadLine(line.number, text, f"the same bytes as in line {span.copy}")
                continue
            continues = above is not None and _continues(above, span)
            envelope = span.checked[0].envelope if span.checked else ""
            repeats = bool(span.checked) and all(one.repeats for one in span.checked)
            yield Piece(
                span.data,
                line.number,
                text,
                span.of.ascii,
                span.mark,
                line.t_ns,
                line.port,
                continues and not i,
                envelope,
                repeats,
            )
            above = span
        if line.said:
            yield UnreadLine(line.number, text, f"the same bytes as in line {line.said}")
        elif not taken and line.clean.strip():
            yield UnreadLine(line.number, text, f"no bytes found in {quoted(line.text)}", empty=True)


def _continues(above: ByteSpan, span: ByteSpan) -> bool:
    if span.joined and span.joined == above.joined and above.line.t_ns == span.line.t_ns:
        return True
    return (
        above.slot == span.slot
        and above.line.t_ns == span.line.t_ns
        and above.mark == span.mark
        and not above.whole
        and not span.whole
        and _offset_of(span) is not None
        and _offset_of(above) is not None
        and (_offset_of(span) or 0) - (_offset_of(above) or 0) == len(above.of.data)
    )


def _offset_of(span: ByteSpan) -> int | None:
    match = _OFFSET.search(span.line.clean[: span.of.start])
    return None if match is None else int(match[1], 16)
