"""What stands beside bytes and is none: numbers of lines, short offsets."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby
from typing import Final

from .loglines import LogLine
from .runs import ByteRun

_LINE_NUMBER, _SHORT_OFFSET = (
    re.compile(pattern)
    for pattern in (
        r"\s*(\d{1,6})(?=[\s:.)|])",
        r"\W*+(?:0[xX])?([0-9A-Fa-f]{2})[hH]?[ \t]?[:\])|]",
    )
)
_COUNTING: Final = 3  # lines


def _counts_from(place: tuple[int, LogLine]) -> int | None:
    """The number of the first line, by that of one so many lines below it that counts on; None without a number."""
    match = _LINE_NUMBER.match(place[1].clean)
    return None if match is None else int(match[1]) - place[0]


def leave_out_line_numbers(lines: Sequence[LogLine]) -> None:
    """`98 01 03 … 99 01 03 …`: what counts on from line to line before frames is none of their bytes.

    One frame that begins behind its number tells for all; where one begins with it, units are counted.
    """
    filled = (line for line in lines if line.clean.strip())
    for number, same in groupby(enumerate(filled), _counts_from):
        group = [line for _, line in same]
        firsts = [(line, run) for line in group for run in line.runs[:1] if _begins_with_pairs(line, run)]
        behind = {run.checked[0].start for _, run in firsts if run.checked} == {1}
        for line, run in firsts if number is not None and len(group) >= _COUNTING and behind else ():
            text = line.clean[run.start + 2 :]
            run.start += 2 + len(text) - len(text.lstrip())
            run.data = run.data[1:]
            run.checked = [span._replace(start=span.start - 1, end=span.end - 1) for span in run.checked]


def _begins_with_pairs(line: LogLine, run: ByteRun) -> bool:
    return run.shape == "pairs" and len(run.data) > 1 and not line.clean[: run.start].strip()


def leave_out_short_offsets(lines: Sequence[LogLine]) -> None:
    """`00: 01 03 … 08: 76 87`: two digits that count the bytes of the rows above are none of them.

    They are offsets of all rows that begin at 00, if one goes on at the next.
    """
    dumps = _short_dumps(lines)
    right = all(run.checked and not inside for rows in dumps for _, run, inside in rows)  # without the digits
    for rows in dumps if right or any(len(rows) > 1 for rows in dumps) else ():
        for i, (line, run, inside) in enumerate(rows):
            run.data, run.offset, run.shape = run.data[inside:], f"{i:04x}", rows[0][1].shape
            run.sure = len(rows) > 1
            line.runs = line.runs[line.runs.index(run) :]
            line.continues = i > 0


def _short_dumps(lines: Sequence[LogLine]) -> list[list[tuple[LogLine, ByteRun, int]]]:
    """Rows whose two digits go on from row to row, of each the run, and whether the digits are its first byte."""
    dumps: list[list[tuple[LogLine, ByteRun, int]]] = []
    at = 0  # bytes of the newest; 0 behind other lines
    for line in lines:
        match = _SHORT_OFFSET.match(line.clean)
        run = next((run for run in line.runs if match is not None and run.end > match.end()), None)
        if match is None or run is None:
            at *= line.quiet
        elif match[1].lower() not in (f"{at:02x}", f"{at:02}"):
            at = 0
        else:
            inside = int(run.start < match.end())  # `08: 60` as one run
            dumps += [] if at else [[]]
            dumps[-1].append((line, run, inside))
            at += len(run.data) - inside
    return dumps
