"""What stands beside bytes and is none: numbers of lines and of bytes, short offsets, counts."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from .candidates import Writing
from .choosing import ByteRun, label_in
from .loglines import LogLine

_NUMBER: Final = re.compile(r"\s*(\d{1,6})(?=[\s:.)|])")
_SHORT_OFFSET: Final = re.compile(r"\W*+(?:0[xX])?([0-9A-Fa-f]{2})[hH]?[ \t]?[:\])|]")
_NUMBERED: Final = re.compile(r"(?<![\w.:])(\d{1,4})[:.)][ \t]{1,4}([0-9A-Fa-f]{2})\W*$")
_NUMBERED_END: Final = 16  # characters that such a line ends with
_COUNTING: Final = 3  # lines


def leave_out_line_numbers(lines: Sequence[LogLine]) -> None:
    """`98 01 03 … 99 01 03 …`: what counts on from line to line before frames is none of their bytes.

    One frame that begins behind its number tells for all; where one begins with it, units are counted.
    """
    filled = [line for line in lines if line.clean.strip()]
    numbers = [-1 if (match := _NUMBER.match(line.clean)) is None else int(match[1]) for line in filled]
    counting: list[LogLine] = []
    for i, line in enumerate(filled):
        if counting and not 0 < numbers[i] == numbers[i - 1] + 1:
            _leave_out(counting)
            counting = []
        if numbers[i] >= 0:
            counting.append(line)
    _leave_out(counting)


def _leave_out(counting: Sequence[LogLine]) -> None:
    runs = [line.runs[0] for line in counting if line.runs and not line.clean[: line.runs[0].start].strip()]
    pairs = [run for run in runs if run.shape == "pairs" and len(run.data) > 1]
    if len(counting) < _COUNTING or {run.checked[0].start for run in pairs if run.checked} != {1}:
        return
    starts = {id(line.runs[0]): line for line in counting if line.runs}
    for run in pairs:
        text = starts[id(run)].clean[run.start + 2 :]
        run.start += 2 + len(text) - len(text.lstrip())
        run.data = run.data[1:]
        run.checked = [span._replace(start=span.start - 1, end=span.end - 1) for span in run.checked]


def leave_out_byte_numbers(lines: Sequence[LogLine]) -> None:
    """`receive:  9: 01`, `receive: 10: 03`: what counts the bytes that come a line each is none of them."""
    counting: list[tuple[ByteRun, re.Match[str]]] = []
    for line in lines:
        begin = max(len(line.clean) - _NUMBERED_END, 0)
        match = _NUMBERED.search(line.clean, begin) if line.runs else None
        if match is None:
            continue
        if counting and int(match[1]) != int(counting[-1][1][1]) + 1:
            _read_numbered(counting)
            counting = []
        counting.append((line.runs[-1], match))
    _read_numbered(counting)


def _read_numbered(counting: Sequence[tuple[ByteRun, re.Match[str]]]) -> None:
    for run, match in counting if len(counting) >= _COUNTING else ():
        run.data, run.start, run.end = bytes.fromhex(match[2]), match.start(2), match.end(2)
        run.shape, run.level, run.others = "pairs", Writing.LIKELY, ()
        run.label = label_in(match.string[max(match.start(1) - 56, 0) : match.start(1)])


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
        inside = int(run.start < match.end())  # `08: 60` as one run
        here = {int(match[1], base) for base in (10, 16) if base == 16 or match[1].isdigit()}
        if at in here:
            dumps = [*dumps, []] if not at else dumps
            dumps[-1].append((line, run, inside))
            at += len(run.data) - inside
        else:
            at = 0
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
