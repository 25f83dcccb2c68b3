"""The candidates of some lines weighed together: one sum of bits a candidate, and the best that do not overlap.

Evidence: the writing's prior, what stands around, right check values, edges over several spans (rows, reads in pieces,
a byte a line), and the record of candidates behind the same words (a slot), learnt in the text. What no check value
supports never changes what one supports.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import accumulate
from math import log2
from typing import Final

from captures.text.judging import ByteJudge, Checked
from captures.text.tools import LineMark, either_way

from .writings import Spelling, candidates_in, counts_up, more_in, shows

FRAME_BITS: Final = {"rtu": 16.0, "tcp": 13.0, "ascii": 14.0}
_ODD_BITS: Final = 10.0  # a right check value, though the header says another length, or its bytes are turned round
_HEADER_BITS: Final = 5.0  # no right check value, but a length as the header says
_UNREAD: Final = 1.0  # a byte that no check value covers
_MOST_UNREAD: Final = 9.0
_LONGEST: Final = 4096  # bytes shown to the judge at once
_REACH: Final = 520  # bytes of neighbours looked at together
_LOOKED_AT: Final = 20  # places at which a judge looks for a frame

Slot = tuple[str, str, str]


@dataclass(slots=True, eq=False)
class ByteSpan:
    """A candidate of a line with what speaks for it."""

    of: Spelling
    line: SpannedLine
    slot: Slot
    checked: Sequence[Checked] = ()
    bits: float = 0.0
    announced: bool = False  # as long as its header says, without a right check value
    joined: int = 0  # the number of the edge over several spans that it is part of
    lead: int = 0  # bytes at its beginning that are none: a count, a line's number
    trail: int = 0
    taken: bool = False
    mark: int = 0
    copy: int = 0  # the line that says the same

    @property
    def data(self) -> bytes:
        """Its bytes."""
        return self.of.data[self.lead : len(self.of.data) - self.trail]

    @property
    def whole(self) -> bool:
        """Whether check values cover all of it."""
        return bool(self.checked) and sum(span.end - span.start for span in self.checked) == len(self.of.data)

    @property
    def right(self) -> bool:
        return bool(self.checked) or self.joined > 0


@dataclass(slots=True, eq=False)
class SpannedLine:
    """A line: as it is, without its times, and its spans."""

    number: int
    text: str
    clean: str
    t_ns: int | None = None
    fine: bool = False
    marks: Sequence[LineMark] = ()
    spans: list[ByteSpan] = field(default_factory=list)
    port: str = ""
    offset: int | None = None
    quiet: bool = False
    said: int = 0  # the line before that is the same

    @property
    def taken(self) -> list[ByteSpan]:
        return sorted((span for span in self.spans if span.taken), key=lambda span: span.of.start)


@dataclass(slots=True)
class SlotRecord:
    """What was learnt of a text: how often candidates of a slot were met, and how often right."""

    met: dict[Slot, int] = field(default_factory=lambda: defaultdict(int))
    right: dict[Slot, int] = field(default_factory=lambda: defaultdict(int))
    writings: dict[tuple[str, str], int] = field(default_factory=lambda: defaultdict(int))
    threshold: float = 0.0
    anything: bool = False  # there are right check values
    copies: dict[tuple[Slot, Slot], list[int]] = field(default_factory=dict)
    edges: int = 0

    def bits(self, span: ByteSpan) -> float:
        """The log odds that what stands in this slot is bytes."""
        met, right = self.met[span.slot], self.right[span.slot]
        size = len(span.of.data)
        if right:
            return min(max(6 + 2 * log2((right + 0.3) / (met - right + 0.3)), -4), 14)
        if not self.anything:
            return 0
        writing = (span.of.writing, span.of.gap)
        known = 1 if self.writings[writing] else -2
        return known - (2 if met > 3 or size < 3 else 0) - (0 if span.announced or size > 5 else 3)


_NUMBERS: Final = re.compile(r"(?<![a-z])(?:0x)?[0-9a-f]*\d[0-9a-f]*(?![a-z])|\d+|(?<![0-9a-z])[a-f]{2}(?![0-9a-z])|#")
_SEVERAL: Final = re.compile(r"#(?:[\s,:.;|'\"/#-]{1,8}#)+")
_ARROWS: Final = re.compile(r"[-=]*[<>]{1,3}[-=]*|[→←⇒⇐▶◀]")
_BLANKS: Final = re.compile(r"[\s*`|>]+")
_KEPT: Final = 40  # characters of a skeleton


@lru_cache(maxsize=8192)
def skeleton(text: str) -> str:
    """A text without its numbers, whoever speaks."""
    masked = _NUMBERS.sub("#", either_way(text.lower()))
    return _SEVERAL.sub("#", _without_signs(masked))


@lru_cache(maxsize=8192)
def _cells(text: str) -> str:
    """The same, with each number apart."""
    return _without_signs(_NUMBERS.sub("#", either_way(text.lower())))


def _without_signs(masked: str) -> str:
    return _BLANKS.sub(" ", _ARROWS.sub("~", masked)).strip()


def slot_of(clean: str, candidate: Spelling) -> Slot:
    """Where a candidate stands: what is before it in its line, and its writing."""
    before = clean[max(candidate.start - 3 * _KEPT, 0) : candidate.start]
    told = skeleton(before) if len(candidate.sizes) > 1 else _cells(before)
    return told[-_KEPT:], candidate.writing, candidate.gap


_UNIT: Final = re.compile(
    r"\s?(?:ms|us|µs|ns|s|sec|мс|мкс|с|сек|V|mV|A|mA|W|kW|kWh|Hz|kHz|°|%|ºC|bar|baud|bps|usec|kB|KB|MB|B|bytes?|байта?|RUB|EUR|USD|руб|шт|times|retries|℃)(?![\w-])"
)
_OTHER_THING: Final = re.compile(
    r"(?:\b(?:mac|bssid|uuid|guid|sha\d*|md5|hash|commit|rev|revision|version|ver|firmware|build|serial|s/n|sn|key|token|chip|eui|ip|"
    r"ptr|pointer|date|time|id|oid|imei|line|port|heap|free|tel|phone|register|reg|address|addr|start|count|quantity|unit|slave|fc|func(?:tion)?|transaction|baud(?:rate)?|timeout|errors?|retries)\b|"
    r"[#@]|::|://\S*)[\s:=#(\[]{0,3}$"
)
_BYTE_WORD: Final = re.compile(
    r"(?:\b(?:bytes?|data|raw|hex|frame|buf(?:fer)?|packet|payload|message|msg|telegram|pdu|adu|trame|daten|dump|command|cmd|"
    r"данные|пакет|кадр|фрейм|байты|команда)\b|数据|报文)[\w\s():=\[<{'\"-]{0,12}$|<buffer $"
)
_COUNT_BEHIND: Final = re.compile(
    r"[\s)\]'\",]{0,4}[(\[]?(?:len(?:gth)?[ =:]*)?(\d{1,4})(?: ?(?:bytes?|байта?|octets?|字节))?[)\]]?"
)
_COUNT_BEFORE: Final = re.compile(
    r"(?<![\w.])(\d{1,4}) ?(?:bytes?|байта?|octets?|B|字节)?[)\]/]?[\s:=-]{1,4}[\[(<{'\"]?$|"
    r"[/\[(](\d{1,3})[)\]]?[:=\s{\[]{0,5}$"
)
_SOLID: Final = re.compile(r"[^\W_]|[$#@%&+]")


_ONE_BYTE: Final = re.compile(r"(?<!\d)1 (?:bytes?|байт)\)?[:\s]{1,3}$")
_COMPUTED: Final = re.compile(
    r"(?:!=|<>|\b(?:expect(?:ed|ing)?|calculat\w+|computed|should be|correct(?: one)?)\b[\s:=]*(?:0x)?)\s*$"
)


def _surroundings(clean: str, one: Spelling, marks: Sequence[LineMark]) -> float:
    """What stands around a candidate speaks for bytes, or against them."""
    before = clean[max(one.start - 28, 0) : one.start].lower()
    behind = clean[one.end : one.end + 24]
    count = len(one.sizes) or len(one.data)
    bits = 0.0
    direct = any(mark.end <= one.start and not _SOLID.search(clean, mark.end, one.start) for mark in marks)
    bits += 4 if direct else 0
    bits += 3 if _BYTE_WORD.search(before) else 0
    head, tail = _SOLID.search(clean, 0, one.start) is None, _SOLID.search(clean, one.end) is None
    bits += 3 if head and tail else 0
    said = _COUNT_BEHIND.match(behind)
    bits += 4 if said is not None and int(said[1]) == len(one.data) and len(one.data) > 1 else 0
    ahead = _COUNT_BEFORE.search(before)
    bits += 4 if ahead is not None and int(ahead[1] or ahead[2]) == len(one.data) and len(one.data) > 1 else 0
    if count < 7 and _UNIT.match(behind):
        bits -= 5
    if _OTHER_THING.search(before):
        bits -= 7
    if (computed := _COMPUTED.search(before)) is not None:
        bits -= 40 if computed[0].strip() in ("!=", "<>") else 6
    if before.endswith(("-", ".", "+")) or behind[:2] in ("..",) or re.match(r"[-./]\w", behind):
        bits -= 5
    if counts_up(one.data):
        bits -= 12
    return bits


def weighed(line: SpannedLine, judge: ByteJudge, memory: dict[str, list[ByteSpan]]) -> list[ByteSpan]:
    """The candidates of a line with their own evidence; rarer writings only where no run of it is right.

    `memory`: lines that were met, as logs repeat themselves.
    """
    known = memory.get(line.clean)
    if known is not None:
        return [ByteSpan(one.of, line, one.slot, one.checked, one.bits, one.announced) for one in known]
    candidates, tokens = candidates_in(line.clean)
    spans = _weighed(line, candidates, judge, [])
    right = [span for span in spans if span.whole or span.announced]
    if not right or any(not _is_inside(token.start, token.end, right) for token in tokens):
        spans += _weighed(line, more_in(line.clean, tokens), judge, [span for span in right if span.whole])
    if len(line.clean) < _REMEMBERED:
        if len(memory) >= _REMEMBERED:
            memory.clear()
        memory[line.clean] = [ByteSpan(one.of, line, one.slot, one.checked, one.bits, one.announced) for one in spans]
    return spans


_HOPELESS: Final = -5.5  # bits of a writing that only check values or a slot make bytes of
_REMEMBERED: Final = 512  # lines, and characters of one


def _is_inside(start: int, end: int, right: Sequence[ByteSpan]) -> bool:
    return any(one.of.start < end and start < one.of.end for one in right)


def _weighed(
    line: SpannedLine, candidates: Iterable[Spelling], judge: ByteJudge, right: list[ByteSpan]
) -> list[ByteSpan]:
    spans = []
    right = list(right)
    for one in sorted(candidates, key=lambda one: one.bits + len(one.data) / 8, reverse=True):
        if right and _is_inside(one.start, one.end, right):
            continue
        span = ByteSpan(one, line, slot_of(line.clean, one), bits=one.bits)
        spans.append(span)
        if len(one.data) == 1 and one.writing in _OF_COLUMNS:
            before = line.clean[max(one.start - 28, 0) : one.start].lower()
            if _ONE_BYTE.search(before):
                span.bits += 13
            elif _BYTE_WORD.search(before):
                span.bits += 1
            elif before.strip():
                span.bits -= 3
            continue
        span.checked = judge(one.data[:_LONGEST]) if len(one.data) >= 4 else ()
        if one.writing.startswith("fields") and any(found.turned for found in span.checked):
            span.checked = ()
        if span.checked or one.bits > _HOPELESS:
            span.bits += _surroundings(line.clean, one, line.marks) + bits_of_checks(one.data, span.checked)
        if span.whole and span.bits > 4:
            right.append(span)
        if not span.checked and one.bits > _HOPELESS and 6 <= len(one.data) <= 260 and not counts_up(one.data):
            announced = judge(one.data, damaged=True)
            span.bits += _HEADER_BITS if announced else 0
            span.announced = len(announced) == 1
    return spans


def bits_of_checks(data: bytes, checked: Sequence[Checked]) -> float:
    """Of check values that are right; less what of the bytes they do not cover."""
    if not checked:
        return 0.0
    bits = sum(_ODD_BITS if one.odd or one.turned else FRAME_BITS.get(one.envelope, 16.0) for one in checked)
    rest = min(len(data), _LONGEST) - sum(one.end - one.start for one in checked)
    return bits - min(rest * _UNREAD, _MOST_UNREAD)


_RIGHT: Final = 60.0  # nothing that no check value supports stands above one that is


def choose(spans: Sequence[ByteSpan]) -> list[ByteSpan]:
    """Of the spans of a line those that do not overlap and have the most bits together, and more than none."""
    ordered = sorted((span for span in spans if span.bits > 0), key=lambda span: span.of.end)
    ends = [span.of.end for span in ordered]
    best: list[tuple[float, list[ByteSpan]]] = [(0.0, [])]
    for i, span in enumerate(ordered):
        before = bisect_right(ends, span.of.start, 0, i)
        with_it = best[before][0] + span.bits + (_RIGHT if span.right else 0)
        best.append((with_it, [*best[before][1], span]) if with_it > best[i][0] else best[i])
    return best[-1][1]


def join(lines: Sequence[SpannedLine], judge: ByteJudge, record: SlotRecord) -> None:
    """Edges over spans whose bytes are frames together: of one slot, then of one column of unlike lines."""
    series: dict[tuple[str, ...], list[ByteSpan]] = defaultdict(list)
    for line in lines:
        for span in _free(line):
            if not span.of.writing.startswith("fields"):
                series[span.slot].append(span)
    for members in series.values():
        if len(members) > 1:
            _take_edges(_edges(members, judge), record)
    for group in _groups(lines):
        columns: dict[tuple[int, str], list[ByteSpan]] = defaultdict(list)
        for line in group:
            by_writing: dict[str, list[ByteSpan]] = defaultdict(list)
            for span in _free(line):
                if len(span.of.data) <= 4 and span.of.writing in _OF_COLUMNS:
                    by_writing["decimals" if span.of.writing == "decimals" else "hex"].append(span)
            for writing, spans in by_writing.items():
                spans.sort(key=lambda span: (span.of.start, -len(span.of.data)))
                spans = [
                    span
                    for i, span in enumerate(spans)
                    if not i or span.of.start >= max(one.of.end for one in spans[:i])
                ]
                for k in (*range(min(3, len(spans))), *range(-min(2, len(spans)), 0)):
                    columns[k, writing].append(spans[k])
        ways = [_edges(members, judge) for members in columns.values() if len(members) > 3]
        ways.sort(key=lambda edges: sum(map(len, edges)), reverse=True)
        explained = {line.number for line in group if any(span.joined for span in line.spans)}
        for edges in ways:
            for edge in edges:
                numbers = {span.line.number for span in edge}
                if explained.isdisjoint(numbers):
                    explained |= numbers
                    _take_edges((edge,), record)


def _take_edges(edges: Iterable[Sequence[ByteSpan]], record: SlotRecord) -> None:
    for edge in edges:
        record.edges += 1
        bits = 16 + min(len(edge[0].of.data), 4) - min(0.5 * (len(edge) - 1), 5)
        for span in edge:
            span.joined = span.joined or record.edges
            span.bits = max(span.bits, bits)


def join_neighbours(lines: Sequence[SpannedLine], judge: ByteJudge, record: SlotRecord) -> None:
    """A frame whose rest stands in the next line, behind whatever words."""
    above: SpannedLine | None = None
    for line in lines:
        if not line.spans:
            above = above if not line.clean.strip() else None
            continue
        last = next(reversed(choose(above.spans)), None) if above is not None else None
        if last is not None and not last.right and len(last.of.data) > 2:
            for span in _free(line):
                if span.of.writing != last.of.writing or span.right or span.bits < -12:
                    continue
                both = last.of.data + span.of.data
                found = judge(both)
                if (
                    len(found) == 1
                    and found[0].end == len(both)
                    and found[0].start <= 2
                    and not (found[0].odd or found[0].turned)
                ):
                    record.edges += 1
                    for one in (last, span):
                        one.joined, one.bits = record.edges, max(one.bits, 13.0)
                    break
        above = line


_OF_COLUMNS: Final = ("pairs", "signed", "signed words", "words", "digits", "decimals")


def _groups(lines: Sequence[SpannedLine]) -> Iterator[list[SpannedLine]]:
    """Lines that stand together, none of which has bytes that are right."""
    group: list[SpannedLine] = []
    for line in lines:
        if not line.spans and not line.clean.strip():
            continue
        if not line.spans or any(span.checked for span in choose(line.spans)):
            if len(group) > 3:
                yield group
            group = []
            continue
        group.append(line)
    if len(group) > 3:
        yield group


def _free(line: SpannedLine) -> Iterator[ByteSpan]:
    """The spans of a line that nothing right stands over: of a slot the longest."""
    whole = [span for span in line.spans if (span.whole or span.announced) and span.bits > 4]
    kept: dict[Slot, list[ByteSpan]] = defaultdict(list)
    for span in sorted(line.spans, key=lambda span: (span.of.start, -span.of.end)):
        if not (span.whole or span.announced) and any(
            one.of.start < span.of.end and span.of.start < one.of.end for one in whole
        ):
            continue
        before = kept[span.slot]
        if not before or before[-1].of.end <= span.of.start:
            before.append(span)
            yield span


def _edges(members: Sequence[ByteSpan], judge: ByteJudge) -> list[Sequence[ByteSpan]]:
    """Neighbours of a series whose bytes are a frame together."""
    edges: list[Sequence[ByteSpan]] = []
    starts = [0, *accumulate(len(span.of.data) for span in members)]
    data = b"".join(span.of.data for span in members)
    small = len(data) < 4 * len(members)
    barriers = [i for i, span in enumerate(members) if span.whole or span.announced]
    at = 0
    while at < len(members) - 1:
        place = bisect_left(barriers, at)
        last = min(
            barriers[place] if place < len(barriers) else len(members), bisect_right(starts, starts[at] + _REACH)
        )
        if last <= at + 1 or starts[last] - starts[at] < 4:
            at = max(last, at + 1)
            continue
        found = judge(data[starts[at] : starts[last]])
        ends = set(starts[at : last + 1])
        right = [
            one for one in found
            if not (one.odd or one.turned)
            and (not small or {starts[at] + one.start, starts[at] + one.end} <= ends)
        ]  # fmt: skip
        if not right:
            at = max(at + 1, min(last, bisect_left(starts, starts[at] + _LOOKED_AT)))
            continue
        for one in right:
            first, end = starts[at] + one.start, starts[at] + one.end
            inside = range(bisect_right(starts, first) - 1, bisect_left(starts, end))
            if len(inside) < 2:
                continue
            edges.append([members[i] for i in inside])
        at = max(bisect_left(starts, starts[at] + right[-1].end), at + 1)
    return edges


def learn(lines: Sequence[SpannedLine], record: SlotRecord) -> None:
    """Note what was met in each slot, and what of it was right and the best of its line."""
    for line in lines:
        for span in line.spans:
            record.met[span.slot] += 1
        for span in choose(line.spans):
            if span.right:
                record.right[span.slot] += 1
                record.writings[span.of.writing, span.of.gap] += 1
                record.anything = True


def settle(lines: Sequence[SpannedLine], record: SlotRecord) -> None:
    """Take of each line what has the most bits."""
    for line in lines:
        for span in line.spans:
            more = record.bits(span)
            span.bits += max(more, 0) if span.right else more
        for span in choose(line.spans):
            span.taken = True
        _leave_out_characters(line)


def _leave_out_characters(line: SpannedLine) -> None:
    """Behind the bytes of a dump's row stand the same bytes as characters."""
    for span in line.taken:
        if len(span.of.data) > 1 and shows(span.of.data, line.clean[span.of.end :].strip(" \t|<>")):
            for other in line.taken:
                other.taken = other.taken and other.of.start <= span.of.start
            return


def pieces(lines: Iterable[SpannedLine]) -> Iterator[ByteSpan]:
    """All that was taken, in order."""
    for line in lines:
        yield from (span for span in line.spans if span.taken)
