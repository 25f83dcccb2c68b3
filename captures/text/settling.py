"""Which runs of several lines are bytes, decided together.

What a line alone does not tell, its neighbours may: a frame printed a byte a line or a field a line, an array over
several lines, the rest of a frame behind other output. And what tools say twice (a buffer and its JSON, `recv` and
`Processing`, a packet with and without its check value) counts once.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from ..checked import Checked
from .candidates import HexWindow, shows
from .choosing import MOST_JUDGED
from .columns import COLUMN_SHAPE, MOST_ROWS, settle_columns, settle_unchecked
from .copies import leave_out_buffers, settle_copies
from .judging import ByteJudge, unturned
from .loglines import LogLine
from .numbering import leave_out_line_numbers, leave_out_short_offsets
from .runs import ByteRun, Experience, covered, is_whole
from .series import settle_series, settle_tails
from .weighing import leave_out_unsupported, propose, single_byte

_ROWS: Final = (8, 16, 20, 32)  # bytes of a full row


def settle(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Decide for every run of these lines whether it is taken; the others say why not."""
    leave_out_short_offsets(lines)
    leave_out_line_numbers(lines)
    leave_out_buffers(lines, experience)
    propose(lines, judge, experience)
    settle_series(lines, judge, experience)
    settle_columns(lines, unturned(judge), experience)
    _blocks(lines, judge, experience)
    _rows_of_dumps(lines, judge)
    if not experience.damaged:
        settle_tails(lines, judge, experience)
    settle_unchecked(lines, experience)
    _ends_of_arrays(lines)
    _bytes_alone(lines)
    leave_out_unsupported(lines, judge, experience)
    settle_copies(lines, experience)


def only_bytes(lines: Sequence[LogLine]) -> bool:
    """Whether these lines hold nothing but runs of digits."""
    filled = [line for line in lines if line.clean.strip() or line.runs]
    return all(len(line.runs) == 1 and line.runs[0].level and line.is_all(line.runs[0]) for line in filled)


# Arrays over several lines.


def _blocks(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Runs that fill lines one below the other, read in another way where that makes right what is not."""
    block: list[tuple[LogLine, ByteRun]] = []
    for line in lines:
        if block and line.runs and _goes_on(line) and len(block) < MOST_ROWS:
            block.append((line, line.runs[0]))
            if len(line.runs) == 1 and line.ends_with(line.runs[0]):
                continue
        _reread(block, judge, experience)
        block = [(line, line.runs[-1])] if line.runs and _opens(line, line.runs[-1]) else []
    _reread(block, judge, experience)


def _goes_on(line: LogLine) -> bool:
    """Whether a line begins with bytes, and is not the first row of a dump."""
    run = line.runs[0]
    return line.begins_with(run) and (run.offset is None or run.offset.strip("0") != "")


def _opens(line: LogLine, run: ByteRun) -> bool:
    return line.ends_with(run) and (len(run.data) > 1 or line.begins_with(run))


def _reread(block: list[tuple[LogLine, ByteRun]], judge: ByteJudge, experience: Experience) -> None:
    """Rows that are right together in one shape are read in it, and so are those like them.

    Where some are right alone, the rest of a frame may stand in those beside them.
    """
    right = [run for _, run in block if run.checked]
    alone = sum(covered(run.checked) for run in right)
    if len(block) < 2 or (right and all(map(is_whole, right))):
        return
    readings = [run.readings() for _, run in block]
    for shape in readings[0]:
        rows = [reading[shape] for reading in readings if shape in reading]
        data = b"".join(row.data for row in rows)
        checked = judge(data) if len(rows) == len(block) and len(data) <= MOST_JUDGED else ()
        if covered(checked) > alone and 2 * covered(checked) >= len(data):
            _accept(block, rows, checked, experience)
            return


def _accept(
    block: list[tuple[LogLine, ByteRun]],
    readings: Sequence[ByteRun | HexWindow],
    checked: Sequence[Checked],
    experience: Experience,
) -> None:
    """Read runs so, as far as they are of frames; words behind the array may begin with a number."""
    at = 0
    for (line, run), reading in zip(block, readings, strict=True):
        if at < checked[-1].end:
            run.accept(reading)
            line.continues = line.continues or any(span.start < at < span.end for span in checked)
            at += len(run.data)
            experience.confirm(run)
    experience.builds.update(run.build for _, run in block)
    block[0][1].checked = checked


def _rows_of_dumps(lines: Sequence[LogLine], judge: ByteJudge) -> None:
    """The rows of a dump are read as its first one is; of 16-bit words the last may be half filled.

    What check values say of all rows together outweighs what the first row alone may look like.
    """
    dump: list[ByteRun] = []
    for line in lines:
        row = line.runs[0] if dump and line.continues and line.runs else None  # of the dump above
        if row is not None and row.offset is not None:
            row.accept(row.readings().get(dump[0].shape, row))
        for run in line.runs:
            if run.padded:
                run.data, run.padded = run.data[:-1], False
        if row is not None and row.taken:
            dump.append(row)
            continue
        _check_dump(dump, judge)
        dump = [run for run in line.runs[-1:] if run.taken]
    _check_dump(dump, judge)


def _check_dump(rows: Sequence[ByteRun], judge: ByteJudge) -> None:
    data = b"".join(run.data for run in rows)
    if len(rows) > 1 and (checked := judge(data[:MOST_JUDGED])):
        rows[0].checked = checked


def _ends_of_arrays(lines: Sequence[LogLine]) -> None:
    """The rest of an array behind a comma, or of a dump below a full row, which is too short to speak for itself."""
    for one, below in pairwise(lines):
        if not one.runs or not below.runs or below.number - one.number > 1:
            continue
        above, run = one.runs[-1], below.runs[0]
        if run.taken or not above.taken or above.checked or not below.begins_with(run):
            continue
        behind = below.clean[run.end :].strip(" \t|")
        row = len(above.data) in _ROWS and above.start == run.start and (not behind or shows(run.data, behind))
        if row or one.clean[above.end :].strip() == ",":
            run.accept(run)
            below.continues = True


def _bytes_alone(lines: Sequence[LogLine]) -> None:
    """Bytes that come a line each, one below the other and alike, are one read."""
    for one, below in pairwise(lines):
        alike = single_byte(below)
        if alike is not None and alike == single_byte(one) and below.number == one.number + 1:
            below.continues = below.continues or below.runs[0].shape != COLUMN_SHAPE
