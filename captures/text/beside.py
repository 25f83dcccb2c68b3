"""What stands beside bytes in their lines: numbers of lines, bytes behind others that are left out, offsets."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

from .candidates import LEFT_OUT
from .choosing import MOST_JUDGED, ByteRun
from .judging import ByteJudge
from .loglines import LogLine

_NUMBER: Final = re.compile(r"\s*(\d{1,6})(?=[\s:.)|])")
_WORD_BEHIND: Final = re.compile(r"\s*[^\W\d]")
_LEAST_ROWS: Final = 4  # of one byte each that can be a frame


def leave_out_line_numbers(lines: Sequence[LogLine]) -> None:
    """`98 01 03 … 99 01 03 …`: what counts on from line to line before frames is none of their bytes."""
    filled = [line for line in lines if line.clean.strip()]
    numbers = [None if (match := _NUMBER.match(line.clean)) is None else int(match[1]) for line in filled]
    for i, (line, number) in enumerate(zip(filled, numbers, strict=True)):
        run = line.runs[0] if line.runs else None
        if number is None or run is None or not run.checked or run.checked[0].start != 1 or run.shape != "pairs":
            continue
        near = (numbers[i - 1] if i else None, numbers[i + 1] if i + 1 < len(numbers) else None)
        if line.clean[: run.start].strip() == "" and near in (
            (number - 1, number + 1),
            (None, number + 1),
            (number - 1, None),
        ):
            run.start += len(line.clean[run.start :]) - len(line.clean[run.start + 2 :].lstrip())
            run.data = run.data[1:]
            run.checked = [span._replace(start=span.start - 1, end=span.end - 1) for span in run.checked]


def leave_out_counts(lines: Sequence[LogLine]) -> None:
    """`[12] F7 0F …`: how many bytes stand behind, in a cell of its own, is none of them."""
    for line in lines:
        for before, run in pairwise(line.runs):
            shown = line.clean[before.start : before.end]
            apart = line.clean[before.end : run.start]
            if shown.isdigit() and len(before.data) == 1 and int(shown) == len(run.data) and not apart.isspace():
                before.taken = before.taken and apart.strip("])}>:;,|= \t") != ""


def settle_behind_cuts(lines: Sequence[LogLine]) -> None:
    """`01 03 14 00 … C4 20`: bytes written as those before, behind a sign that some between are left out."""
    for line in lines:
        for before, run in pairwise(line.runs):
            if not (before.taken and before.cut) or run.taken or run.why or run.shape != before.shape:
                continue
            several = len(run.data) > 1 or not _WORD_BEHIND.match(line.clean, run.end)  # `... 14 more bytes`
            run.taken = several and line.clean[before.end : run.start].strip(" \t,") in LEFT_OUT


def settle_narrow_dumps(lines: Sequence[LogLine], judge: ByteJudge) -> None:
    """`00000007: 36   6`: a dump of a byte a row, whose rows look like numbered values, where frames tile its bytes."""
    for rows in _narrow_dumps(lines):
        data = b"".join(run.data for run in rows)
        checked = judge(data[:MOST_JUDGED])
        if 2 * sum(span.end - span.start for span in checked) > len(data[:MOST_JUDGED]):
            for run in rows:
                run.taken = run.sure = True
            rows[0].checked = checked


def _narrow_dumps(lines: Sequence[LogLine]) -> Iterator[list[ByteRun]]:
    rows: list[ByteRun] = []
    for line in [*lines, None]:
        run = line.runs[0] if line is not None and line.runs else None
        narrow = run is not None and run.offset is not None and len(run.data) == 1
        if line is not None and run is not None and narrow and line.continues and rows:
            rows.append(run)
            continue
        if len(rows) >= _LEAST_ROWS:
            yield rows
        rows = [run] if run is not None and narrow else []
