"""What stands beside bytes in their lines: numbers of lines, bytes behind others that are left out, offsets."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise
from typing import Final

from .candidates import LEFT_OUT
from .choosing import MOST_JUDGED, ByteRun
from .judging import ByteJudge
from .loglines import LogLine

_NUMBER: Final = re.compile(r"\s*(\d{1,6})(?=[\s:.)|])")
_LIKE_A_BYTE: Final = re.compile(r"\s*0\d\s")
_COUNTING: Final = 2  # lines
_WORD_BEHIND: Final = re.compile(r"\s*[^\W\d]")
_LEAST_ROWS: Final = 4  # of one byte each that can be a frame


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
    if any(_LIKE_A_BYTE.match(line.clean) and not line.runs[0].checked for line in counting if line.runs):
        return
    starts = {id(line.runs[0]): line for line in counting if line.runs}
    for run in pairs:
        text = starts[id(run)].clean[run.start + 2 :]
        run.start += 2 + len(text) - len(text.lstrip())
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


def settle_single_bytes(lines: Sequence[LogLine]) -> None:
    """`RX: 03`, `RX: 56`: bytes that come a line each; where most are plainly bytes, so is what looks decimal."""
    for key, same in groupby(lines, _single_byte):
        runs = [line.runs[0] for line in same] if key is not None else []
        if len(runs) >= _LEAST_ROWS and 2 * sum(run.taken for run in runs) >= len(runs):
            for run in runs:
                run.taken = run.taken or run.why is None


def _single_byte(line: LogLine) -> tuple[str, str, int, int | None] | None:
    """How a line shows the only byte that it ends with; None of other lines."""
    if len(line.runs) != 1 or len((run := line.runs[0]).data) != 1 or not run.mark or run.shape != "pairs":
        return None
    behind = line.clean[run.end :]
    return None if any(map(str.isalnum, behind)) else (run.label, run.shape, run.mark, line.t_ns)


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
