"""Which runs of several lines are bytes, decided together.

What a line alone does not tell, its neighbours may: a frame printed a byte a line or a field a line, an array over
several lines, the rest of a frame behind other output. And what tools say twice (a buffer and its JSON, `recv` and
`Processing`, a packet with and without its check value) counts once.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from .candidates import CHECK_NAME, HexWindow, Writing, is_ruler, shows
from .choosing import MOST_JUDGED, ByteRun, Experience, covered, is_whole
from .columns import COLUMN_SHAPE, MOST_ROWS, settle_columns, settle_unchecked
from .copies import settle_behind_cuts, settle_copies, settle_single_bytes
from .judging import ByteJudge, unturned
from .loglines import LogLine
from .numbering import (
    leave_out_byte_numbers,
    leave_out_column_numbers,
    leave_out_counts,
    leave_out_line_numbers,
    leave_out_short_offsets,
    leave_out_sizes,
)
from .series import settle_series, settle_tails
from .weighing import is_counted, is_measured, leave_out_computed, leave_out_records, leave_out_unsupported

_ROWS: Final = (8, 16, 20, 32)  # bytes of a full row
_SHORT: Final = 3  # bytes: no more where text stands behind them
_HEADED: Final = 6  # bytes for which the header of a frame speaks
_CRC: Final = 2  # bytes
_WITH_SIGNS: Final = ("pairs:", "pairs/", "pairs.")
_MAC: Final = 6  # bytes
_CALLED_CRC, _TOKEN = (re.compile(pattern, re.IGNORECASE) for pattern in (rf"^\W*{CHECK_NAME}\W*$", r"\w+"))


def settle(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Decide for every run of these lines whether it is taken; the others say why not."""
    leave_out_short_offsets(lines)
    leave_out_byte_numbers(lines)
    for line in lines:
        for run in line.runs:
            run.taken = _speaks_for_itself(run, line, experience)
    leave_out_computed(lines)
    leave_out_records(lines)
    leave_out_line_numbers(lines)
    leave_out_counts(lines)
    leave_out_sizes(lines)
    _beside(lines)
    settle_single_bytes(lines)
    settle_series(lines, judge, experience)
    leave_out_column_numbers(lines)
    settle_columns(lines, unturned(judge), experience)
    _blocks(lines, judge, experience)
    _rows_of_dumps(lines, judge)
    if not experience.damaged:
        settle_tails(lines, judge, experience)
    settle_unchecked(lines, experience)
    _as_long_as_they_say(lines, judge, experience)
    _named_check_values(lines)
    settle_behind_cuts(lines)
    _ends_of_arrays(lines)
    _bytes_alone(lines)
    leave_out_unsupported(lines, judge, experience)
    settle_copies(lines, experience)


def _speaks_for_itself(run: ByteRun, line: LogLine, experience: Experience) -> bool:
    if run.sure or run.checked or is_counted(run, line):
        return True
    shown = line.clean[run.start : run.end]
    ruler = run.level is Writing.NUMBER and is_ruler(_TOKEN.findall(shown))
    half = run.halved and not experience.other
    if ruler or half or is_measured(run, line) or _is_hardware_address(run, experience):
        return False
    numbers = _are_numbers(run, shown)
    if run.level >= experience.threshold or (run.level is Writing.LIKELY and run.mark and not numbers):
        return True
    if experience.decimals and run.shape == "decimal" and _plainly_decimal(shown):
        return True
    return _is_tail(run, experience) or _is_trusted(run, line, experience, numbers=numbers)


def _is_tail(run: ByteRun, experience: Experience) -> bool:
    """Whether check values of frames above stand behind its words, which it then is read as."""
    readings = _readings(run).values() if run.label else ()
    tail = next((one for one in readings if (run.label, one.shape) in experience.tails), None)
    if tail is not None:
        run.take(tail)
    return tail is not None


def _is_trusted(run: ByteRun, line: LogLine, experience: Experience, *, numbers: bool) -> bool:
    """Whether others in its writing behind its words are right, and nothing around says that it is something else."""
    if not experience.trust(run.label, run.shape, direct=run.direct and not numbers):
        return False
    if run.label:
        return len(run.data) > _SHORT or _ends(line, run)
    word = line.clean[run.start : run.end].istitle() and not any(map(str.isdigit, line.clean))  # `Be Ad`
    return run.offset is not None or (_is_all(run, line) and not word)


def _are_numbers(run: ByteRun, shown: str) -> bool:
    """Whether it is what people write in decimals, too short for a frame: `40001 -> 1234`, `values read: 16 25 30`."""
    if run.shape == "words":
        return shown.isdigit()
    tokens = _TOKEN.findall(shown)
    return 1 < len(tokens) <= _SHORT and all(token.isdigit() and token[0] != "0" for token in tokens)


def _is_hardware_address(run: ByteRun, experience: Experience) -> bool:
    """Whether six bytes are written as addresses of networks are, where frames are written otherwise."""
    address = run.shape in ("pairs:", "pairs-") and len(run.data) == _MAC
    return address and bool(experience.shapes) and run.shape not in experience.shapes


def _plainly_decimal(text: str) -> bool:
    return any(len(number) == 3 for number in _TOKEN.findall(text)) and text.count(".") != 3


def only_bytes(lines: Sequence[LogLine]) -> bool:
    """Whether these lines hold nothing but runs of digits."""
    filled = [line for line in lines if line.clean.strip() or line.runs]
    return all(len(line.runs) == 1 and line.runs[0].level and _is_all(line.runs[0], line) for line in filled)


def _is_all(run: ByteRun, line: LogLine) -> bool:
    return not any(map(str.isalnum, line.clean[: run.start] + line.clean[run.end :]))


def _beside(lines: Sequence[LogLine]) -> None:
    """A short row that is nothing but bytes is as good as the row of bytes next to it: the end of an array."""
    filled = [line for line in lines if line.clean.strip()]
    for near in (filled, filled[::-1]):
        for one, neighbour in pairwise(near):
            if len(one.runs) == len(neighbour.runs) == 1 and one.runs[0].taken and not neighbour.runs[0].taken:
                run = neighbour.runs[0]
                other = run.shape in _WITH_SIGNS and run.shape != one.runs[0].shape  # `10:15`, `11/25`
                if run.level is Writing.LIKELY and not other and _is_all(run, neighbour):
                    run.taken = len(run.data) > 1


# Arrays over several lines.


def _blocks(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Runs that fill lines one below the other, read in another way where that makes right what is not."""
    block: list[tuple[LogLine, ByteRun]] = []
    for line in (line for line in lines if block or line.runs):
        if block and line.runs and _goes_on(line) and len(block) < MOST_ROWS:
            block.append((line, line.runs[0]))
            if len(line.runs) == 1 and _ends(line, line.runs[0]):
                continue
        _reread(block, judge, experience)
        block = [(line, line.runs[-1])] if line.runs and _opens(line, line.runs[-1]) else []
    _reread(block, judge, experience)


def _begins(line: LogLine, run: ByteRun) -> bool:
    return run.offset is not None or not any(map(str.isalnum, line.clean[: run.start]))


def _goes_on(line: LogLine) -> bool:
    """Whether a line begins with bytes, and is not the first row of a dump."""
    run = line.runs[0]
    return _begins(line, run) and (run.offset is None or run.offset.strip("0") != "")


def _opens(line: LogLine, run: ByteRun) -> bool:
    return _ends(line, run) and (len(run.data) > 1 or _begins(line, run))


def _ends(line: LogLine, run: ByteRun) -> bool:
    return run.offset is not None or not any(map(str.isalnum, line.clean[run.end :]))


def _reread(block: list[tuple[LogLine, ByteRun]], judge: ByteJudge, experience: Experience) -> None:
    """Rows that are right together in one shape are read in it, and so are those like them.

    Where some are right alone, the rest of a frame may stand in those beside them.
    """
    alone = sum(covered(run.checked) for _, run in block)
    if len(block) < 2 or (alone and all(is_whole(run) for _, run in block if run.checked)):
        return
    readings = [_readings(run) for _, run in block]
    for shape in readings[0]:
        if not all(shape in reading for reading in readings):
            continue
        data = b"".join(reading[shape].data for reading in readings)
        checked = judge(data) if len(data) <= MOST_JUDGED else ()
        if covered(checked) <= alone or 2 * covered(checked) < len(data):
            continue
        at = 0
        for (line, run), reading in zip(block, readings, strict=True):
            if at >= checked[-1].end:
                break  # words behind the array that begin with a number
            run.take(reading[shape])
            run.taken = True
            line.continues = line.continues or any(span.start < at < span.end for span in checked)
            at += len(run.data)
            experience.confirm(run)
        experience.builds.update(run.build for _, run in block)
        block[0][1].checked = checked
        return


def _rows_of_dumps(lines: Sequence[LogLine], judge: ByteJudge) -> None:
    """The rows of a dump are read as its first one is; of 16-bit words the last may be half filled.

    What check values say of all rows together outweighs what the first row alone may look like.
    """
    dump: list[ByteRun] = []
    for line in lines:
        row = line.runs[0] if line.runs else None
        goes_on = line.continues and row is not None and bool(dump)
        if goes_on and row is not None and row.offset is not None:
            row.take(_readings(row).get(dump[0].shape, row))
            row.taken = True
        for run in line.runs:
            if run.padded:
                run.data, run.padded = run.data[:-1], False
        if goes_on and row is not None and row.taken:
            dump.append(row)
            continue
        _check_dump(dump, judge)
        dump = [line.runs[-1]] if row is not None and line.runs[-1].taken else []
    _check_dump(dump, judge)


def _check_dump(rows: Sequence[ByteRun], judge: ByteJudge) -> None:
    data = b"".join(run.data for run in rows)
    if len(rows) > 1 and (checked := judge(data[:MOST_JUDGED])):
        rows[0].checked = checked


def _readings(run: ByteRun) -> dict[str, ByteRun | HexWindow]:
    """A run in each of its shapes."""
    readings: dict[str, ByteRun | HexWindow] = {run.shape: run}
    for candidate in run.others:
        if abs(candidate.end - run.end) < 2:
            readings.setdefault(candidate.shape, candidate)
    return readings


def _ends_of_arrays(lines: Sequence[LogLine]) -> None:
    """The rest of an array behind a comma, or of a dump below a full row, which is too short to speak for itself."""
    for one, below in pairwise(lines):
        if not one.runs or not below.runs or not one.runs[-1].taken or below.runs[0].taken:
            continue
        above, run = one.runs[-1], below.runs[0]
        if below.number - one.number > 1 or above.checked or not _begins(below, run):
            continue
        behind = below.clean[run.end :].strip(" \t|")
        row = len(above.data) in _ROWS and above.start == run.start and (not behind or shows(run.data, behind))
        if row or one.clean[above.end :].strip() == ",":
            run.taken, below.continues = True, True


def _bytes_alone(lines: Sequence[LogLine]) -> None:
    """Bytes that come a line each, one below the other and alike, are one read."""
    for one, below in pairwise(lines):
        runs = [*one.runs, *below.runs]
        if len(one.runs) != 1 or [len(run.data) for run in runs] != [1, 1] or not runs[1].taken:
            continue
        near = (below.number, below.t_ns) == (one.number + 1, one.t_ns)
        alike = len({(run.label, run.shape, run.mark) for run in runs}) == 1
        below.continues = below.continues or (near and alike and runs[0].shape != COLUMN_SHAPE)


def _as_long_as_they_say(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """A frame with a wrong check value, or without one, in a writing in which others of the text are right."""
    for line in lines:
        for run in line.runs:
            if run.taken or run.why or run.halved or line.quiet or len(run.data) < _HEADED:
                continue
            if run.level is Writing.NUMBER and run.shape == "pairs":
                continue  # a list of numbers
            readings: tuple[ByteRun | HexWindow, ...] = (run, *run.others)
            for reading in (reading for reading in readings if reading.shape in experience.shapes):
                if covered(judge(reading.data, damaged=True)) == len(reading.data):
                    run.take(reading)
                    run.taken = True
                    break


def _named_check_values(lines: Sequence[LogLine]) -> None:
    """Two bytes called `CRC` right behind others are theirs, right or not."""
    for line in lines:
        for before, run in pairwise(line.runs):
            behind = before.taken and not (before.checked or run.taken or run.why) and len(run.data) == _CRC
            if behind and _CALLED_CRC.search(line.clean[before.end : run.start]):
                run.taken = True
