"""Which runs of characters in a line are bytes: the check values say, then the writing, then a person's sense.

Here too: whose a direction mark of the line is.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Final, NamedTuple

from ..checked import Checked
from .candidates import (
    WORD,
    H,
    HexWindow,
    TextLine,
    Writing,
    counts_up,
    in_its_place,
    shows,
)
from .digitruns import hex_candidates, other_candidates, run_together
from .judging import ByteJudge
from .runs import ByteRun, Experience, covered
from .tools import NONE, RX, TX, LineMark, either_way

MOST_JUDGED: Final = 4096  # bytes of one run that a judge is shown
_LEAST: Final = 4  # bytes that can hold a check value
_HEADED: Final = 6  # bytes for which the header of a frame speaks
_ENOUGH: Final = 0.5  # of a number's bytes that a check value must cover
_LABEL: Final = 28  # characters
_RUN_TOGETHER: Final = "digits run together"
_PAIR_OF_HEX: Final = re.compile(r"(?<!\d)0\d(?!\d)")  # `00`, `03`: numbers are not written so
_NUMBERS: Final = re.compile(r"0[xX][0-9A-Fa-f]+|\b(?=[a-fA-F]*\d)[0-9A-Fa-f]+\b|\d+")
_BLANKS: Final = re.compile(r"[\s|*#/<>`-]+(?=([:=]?))")
_CUT: Final = re.compile(r"[ ,]?,? ?(?:\.\.\.(?![\w.])|…)")  # behind bytes of which there are more
_HALVED: Final = re.compile(
    rf"[ \t]{{1,4}}(?:{H}|{H}{{3}})(?=[ \t]*$|[ \t]+{H}{{2}}(?:\s|$))"
)  # behind which there is half a byte


def runs_in(line: TextLine, judge: ByteJudge, experience: Experience) -> list[ByteRun]:
    """The runs of a line, none overlapping another, in order; none is taken yet."""
    ranked = [_ranked(candidate, line, judge, experience) for candidate in hex_candidates(line)]
    if not any(entry.whole for entry in ranked):  # right in hex: no other reading needed
        ranked += [_ranked(candidate, line, judge, experience) for candidate in other_candidates(line)]
        if not any(entry.whole for entry in ranked):
            ranked += _parted(line, judge, experience)
    return _labelled([part for run in _apart(ranked, line) for part in _cells_of(run, line.text)], line.text)


def _apart(ranked: list[_Ranked], line: TextLine) -> list[ByteRun]:
    """The best candidates none of which overlaps another, in order; others that begin with one are its other readings.

    A number before the bytes of a row, which may be an offset, is none of them.
    """
    offsets = {entry.candidate.lead for entry in ranked if entry.candidate.offset is not None}
    ranked.sort(key=lambda entry: (entry.whole or entry.candidate.start not in offsets, *entry.rank), reverse=True)
    occupied: list[tuple[int, int, ByteRun]] = []
    for _, candidate, checked, whole in ranked:
        at = bisect_left(occupied, (candidate.lead,))
        clash = next((occupied[i][2] for i in (at - 1, at) if _overlaps(occupied, i, candidate)), None)
        if clash is None:
            occupied.insert(at, (candidate.lead, candidate.end, _run(candidate, line, checked)))
        elif candidate.start == clash.start:
            clash.others = (*clash.others, candidate)
            clash.rivals = (*clash.rivals, candidate.shape) if whole else clash.rivals
    return [run for _, _, run in occupied]


def _labelled(runs: list[ByteRun], text: str) -> list[ByteRun]:
    """Runs, each with the words behind the run before it; what stands behind a dump's row is the same as characters."""
    behind = 0  # the newest run that may be bytes
    for i, run in enumerate(runs):
        if behind:
            run.label = label_in(text[max(behind, run.start - 2 * _LABEL) : run.start])
        behind = run.end if run.is_likely else behind
        if run.offset is None:
            continue
        shown = run.checked or shows(run.data, text[run.end :])
        if shown or all(len(other.data) <= len(run.data) for other in runs[i + 1 :]):
            return runs[: i + 1]
        run.offset = None  # `298365 17 [Task] TX 01 03 …`: no characters of a byte stand behind
    return runs


def _cells_of(run: ByteRun, text: str) -> list[ByteRun]:
    """A run as it is; one by one the frames of one that fill the cells of a table, between tabs."""
    cells = text[run.start : run.end].split("\t")
    sizes = [span.end - span.start for span in run.checked]
    if len(cells) == 1 or [3 * size - 1 for size in sizes] != [*map(len, cells)]:
        return [run]
    parts, start = [], run.start
    for span, size, cell in zip(run.checked, sizes, cells, strict=True):
        part = replace(run, data=run.data[span.start : span.end], start=start, end=start + len(cell), others=())
        part.checked = (span._replace(start=0, end=size),)
        parts.append(part)
        start += len(cell) + 1
    return parts


class _Ranked(NamedTuple):
    """A candidate with what speaks for it; `whole`: all of it has right check values."""

    rank: tuple[int, int, bool, int, Writing, int]
    candidate: HexWindow
    checked: Sequence[Checked]
    whole: bool


def _ranked(candidate: HexWindow, line: TextLine, judge: ByteJudge, experience: Experience) -> _Ranked:
    candidate = in_its_place(candidate, line)
    size, shown = len(candidate.data), line.text[candidate.start : candidate.end]
    padded = candidate.shape == "decimal" and _PAIR_OF_HEX.search(shown) is not None
    no_frame = size < _LEAST or (experience.damaged and (padded or _is_no_frame(candidate, shown)))
    checked = () if no_frame else _checked_in(candidate, judge)
    if padded:  # no header says more than that numbers are not written so
        checked = [span for span in checked if span.envelope != "tcp"]
    right = covered(checked)
    learnt = (False, 0) if padded else _learnt_of(candidate, line, judge, experience)
    rank = (right, right - size if right else 0, *learnt, candidate.level, len(shown))
    return _Ranked(rank, candidate, checked, right == size > 0)


def _learnt_of(candidate: HexWindow, line: TextLine, judge: ByteJudge, experience: Experience) -> tuple[bool, int]:
    """Whether a header says so much, in a writing in which others are right; how often others like it were right."""
    if not experience.taught:
        return False, 0
    direct = candidate.start in line.first and candidate.start > line.begin
    known = len(candidate.data) >= _HEADED and candidate.shape in experience.shapes
    announced = known and bool(judge(candidate.data[:MOST_JUDGED], damaged=True))
    return announced, experience.trust(label_of(line, candidate.start), candidate.shape, direct=direct)


def _parted(line: TextLine, judge: ByteJudge, experience: Experience) -> list[_Ranked]:
    """The only way to part digits that are run together of which all is right; looked for while some are found."""
    if experience.damaged or experience.patience.ends(_RUN_TOGETHER):
        return []
    ways = [*run_together(line)]
    right = [candidate for candidate in ways if _is_beyond_chance(candidate.data, judge)]
    experience.patience.spend(_RUN_TOGETHER, len(ways), found=bool(right))
    return [_ranked(candidate, line, judge, experience) for candidate in right] if len(right) == 1 else []


def _is_beyond_chance(data: bytes, judge: ByteJudge) -> bool:
    """Whether a check value says it of all bytes: zeros are a header of Modbus TCP in many a number."""
    checked = judge(data)
    plain = all(not (span.turned or span.odd) and span.envelope != "tcp" for span in checked)
    return plain and covered(checked) == len(data)


def _is_no_frame(candidate: HexWindow, shown: str) -> bool:
    """Whether it is base64, or numbers that count up."""
    counts = candidate.level is Writing.NUMBER and counts_up(candidate.data)
    return counts or (candidate.shape == "base64" and shown.isalpha())


def _run(candidate: HexWindow, line: TextLine, checked: Sequence[Checked]) -> ByteRun:
    data, start, end, shape, level, ascii_mode, offset, _ = candidate
    words = line.text[start:end].split() if shape == "words" else ()
    halved = shape == "pairs" and not checked and _HALVED.match(line.text, end) is not None
    return ByteRun(
        data, start, end, shape, level, label_of(line, start), ascii=ascii_mode, offset=offset, halved=halved,
        cut=_CUT.match(line.text, end) is not None, checked=checked, width=len(words[0]) if len(words) > 1 else 0,
    )  # fmt: skip


def _overlaps(places: Sequence[tuple[int, int, ByteRun]], i: int, candidate: HexWindow) -> bool:
    return 0 <= i < len(places) and places[i][0] < candidate.end and candidate.lead < places[i][1]


def _checked_in(candidate: HexWindow, judge: ByteJudge) -> Sequence[Checked]:
    """The stretches of a candidate with a right check value; of a number's bytes they must cover enough."""
    data = candidate.data[:MOST_JUDGED]
    checked = judge(data)
    return checked if candidate.level or covered(checked) >= _ENOUGH * len(data) else ()


def label_of(line: TextLine, start: int) -> str:
    """The end of what stands before a run, in small letters and without numbers."""
    return label_in(line.text[max(start - 2 * _LABEL, 0) : start])


@lru_cache(maxsize=4096)
def label_in(before: str) -> str:
    """The same of a text, whoever speaks; nothing where there are no words."""
    words = either_way(_NUMBERS.sub("", before.lower()))
    words = _BLANKS.sub(lambda match: "" if match[1] else " ", words).strip()[-_LABEL:]
    return words if any(char.isalpha() for char in words) else ""


_OF_BRACKETS: Final = {"[": TX, "<": RX}  # as libmodbus and ModScan write them


def with_marks(text: str, runs: Sequence[ByteRun], line_marks: Sequence[LineMark]) -> None:
    """Each run with the mark before it; of one run alone, the one behind it where there is none before.

    An arrow says nothing behind a plain word, nor behind the first run: there it points from one frame to the next.
    """
    if not runs or not line_marks:
        _mark_by_brackets(text, runs)
        return
    told, first = _told(line_marks, runs[0]), runs[0]
    ends = [mark.end for mark in told]
    for run in runs:
        if at := bisect_right(ends, run.start):
            run.mark, run.arrow = told[at - 1].mark, told[at - 1].arrow
            run.direct = not WORD.search(text, ends[at - 1], run.start)
    behind = [mark.mark for mark in line_marks if mark.start >= first.end and not mark.arrow]
    if len(runs) == len(behind) == 1:
        first.mark = first.mark or behind[0]


def _told(line_marks: Sequence[LineMark], first: ByteRun) -> list[LineMark]:
    """The marks of a line that say something."""
    pointed = line_marks[0].arrow and line_marks[0].end <= first.start
    told: list[LineMark] = []
    for mark in line_marks:
        behind_word = bool(told) and told[-1].plain
        if not mark.arrow or (not behind_word and (pointed or mark.start < first.end)):
            told.append(mark)
    return told


def _mark_by_brackets(text: str, runs: Sequence[ByteRun]) -> None:
    """`[01][03]…<01><03>…`"""
    brackets = [text[run.start - 1 : run.start] for run in runs]
    if {*_OF_BRACKETS} <= {*brackets}:
        for run, bracket in zip(runs, brackets, strict=True):
            run.mark = _OF_BRACKETS.get(bracket, NONE)
