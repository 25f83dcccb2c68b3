"""What stands beside bytes and is none: numbers of lines and of bytes, short offsets, counts."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final

from .candidates import Writing
from .choosing import ByteRun, label_in
from .loglines import LogLine

_LINE_NUMBER, _BYTE_NUMBER, _COLUMN_NUMBER, _SHORT_OFFSET = (
    re.compile(pattern)
    for pattern in (
        r"\s*(\d{1,6})(?=[\s:.)|])",
        r"(?<![\w.:])(\d{1,4})[:.)][ \t]{1,4}([0-9A-Fa-f]{2})\W*$",
        r"\s*(\d+)\s*$",
        r"\W*+(?:0[xX])?([0-9A-Fa-f]{2})[hH]?[ \t]?[:\])|]",
    )
)
_NUMBERED_END: Final = 16  # characters that a line with a byte's number ends with
_COUNTING: Final = 3  # lines
_RULER: Final = 6  # lines that count from 0 or 1 on
Numbered = tuple[LogLine, re.Match[str]]


def _counting(lines: Iterable[tuple[LogLine, re.Match[str] | None]], least: int) -> Iterator[list[Numbered]]:
    """So many lines and more, one below the other, whose numbers count on."""
    group: list[Numbered] = []
    for line, match in lines:
        if group and (match is None or int(match[1]) != int(group[-1][1][1]) + 1):
            yield from [group] if len(group) >= least else []
            group = []
        if match is not None:
            group.append((line, match))
    yield from [group] if len(group) >= least else []


def leave_out_line_numbers(lines: Sequence[LogLine]) -> None:
    """`98 01 03 … 99 01 03 …`: what counts on from line to line before frames is none of their bytes.

    One frame that begins behind its number tells for all; where one begins with it, units are counted.
    """
    filled = ((line, _LINE_NUMBER.match(line.clean)) for line in lines if line.clean.strip())
    for counting in _counting(filled, _COUNTING):
        firsts = [(line, line.runs[0]) for line, _ in counting if line.runs]
        pairs = [
            (line, run)
            for line, run in firsts
            if run.shape == "pairs" and len(run.data) > 1 and not line.clean[: run.start].strip()
        ]
        for line, run in pairs if {run.checked[0].start for _, run in pairs if run.checked} == {1} else ():
            text = line.clean[run.start + 2 :]
            run.start += 2 + len(text) - len(text.lstrip())
            run.data = run.data[1:]
            run.checked = [span._replace(start=span.start - 1, end=span.end - 1) for span in run.checked]


def leave_out_byte_numbers(lines: Sequence[LogLine]) -> None:
    """`receive:  9: 01`, `receive: 10: 03`: what counts the bytes that come a line each is none of them."""
    found = [
        (line, _BYTE_NUMBER.search(line.clean, max(len(line.clean) - _NUMBERED_END, 0))) for line in lines if line.runs
    ]
    for counting in _counting((one for one in found if one[1] is not None), _COUNTING):
        for line, match in counting:
            run = line.runs[-1]
            run.data, run.start, run.end = bytes.fromhex(match[2]), match.start(2), match.end(2)
            run.shape, run.level, run.others = "pairs", Writing.LIKELY, ()
            run.label = label_in(match.string[max(match.start(1) - 56, 0) : match.start(1)])


def leave_out_column_numbers(lines: Sequence[LogLine]) -> None:
    """Numbers of columns, from 0 or 1 on, written one below the other above those of a frame."""
    for counting in _counting(((line, _COLUMN_NUMBER.match(line.clean)) for line in lines), _RULER):
        for line, _ in counting if counting[0][1][1] in ("0", "1") else ():
            line.runs, line.clean, line.quiet = [], "", True


def leave_out_short_offsets(lines: Sequence[LogLine]) -> None:
    """`00: 01 03 … 08: 76 87`: two digits that count the bytes of the rows above are none of them.

    They are offsets of all rows that begin at 00, if one goes on at the next.
    """
    dumps: list[list[tuple[LogLine, ByteRun, int]]] = []
    at = 0  # bytes of the newest; 0 behind other lines
    for line in lines:
        match = _SHORT_OFFSET.match(line.clean)
        run = None if match is None else next((run for run in line.runs if run.end > match.end()), None)
        if match is None or run is None:
            at = at if line.quiet else 0
            continue
        if at not in {int(match[1], base) for base in ((10, 16) if match[1].isdigit() else (16,))}:
            at = 0
            continue
        inside = int(run.start < match.end())  # `08: 60` as one run
        dumps += [] if at else [[]]
        dumps[-1].append((line, run, inside))
        at += len(run.data) - inside
    right = all(run.checked and not inside for rows in dumps for _, run, inside in rows)  # without the digits
    for rows in dumps if right or any(len(rows) > 1 for rows in dumps) else ():
        for i, (line, run, inside) in enumerate(rows):
            run.data, run.offset, run.shape = run.data[inside:], f"{i:04x}", rows[0][1].shape
            run.sure = len(rows) > 1
            line.runs = line.runs[line.runs.index(run) :]
            line.continues = i > 0


def leave_out_counts(lines: Sequence[LogLine]) -> None:
    """`[12] F7 0F …`: how many bytes stand behind, in a cell of its own, is none of them."""
    for line in lines:
        for before, run in pairwise(line.runs):
            shown = line.clean[before.start : before.end]
            if shown.isdigit() and len(before.data) == 1 and int(shown) == len(run.data):
                before.taken = False


def leave_out_sizes(lines: Sequence[LogLine]) -> None:
    """`WRITE: 8B` above eight bytes says how many they are, and is none of them."""
    filled = [line for line in lines if any(run.taken for run in line.runs)]
    for line, below in pairwise(filled):
        run = line.runs[-1]
        shown = line.clean[run.start : run.end]
        size = sum(len(one.data) for one in below.runs if one.taken)
        if size > 1 and shown.upper() == f"{size}B":
            run.taken, line.quiet = False, True
