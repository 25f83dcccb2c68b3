"""Which runs of several lines are bytes, decided together.

What a line alone does not tell, its neighbours may: a frame printed a byte a line or a field a line, an array over
several lines, the rest of a frame behind other output. And what tools say twice (a buffer and its JSON, `recv` and
`Processing`, a packet with and without its check value) counts once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, groupby, pairwise, takewhile
from typing import Final, NamedTuple

from .choosing import MOST_JUDGED, Checked, Experience, Judge, Run, label_in
from .hexshapes import Candidate, H, Level
from .loglines import LogLine

_SMALL: Final = 0x10
_TAIL: Final = 260  # bytes without a right check value that a later run may complete
_TAIL_RUNS: Final = 4
_TAIL_LINES: Final = 16
_COLUMN: Final = 4  # lines, or fields, that can hold a frame a byte each
_COLUMN_SHAPE: Final = "column"
_MOST_COLUMNS: Final = 4  # from either side of a line
_STEP: Final = 16  # rows at which a judge, shown the column from one on, looks for frames
_MOST_ROWS: Final = 600  # of one column
_TOKEN: Final = re.compile(
    rf"(?<![\w.])(?:(0[xX]|(?:[A-Z]+#)?16#|\$)({H}{{1,2}}(?!{H})|{H}{{4}})|(-?\d{{1,3}}|{H}{{1,2}}|(?:{H}{{2}}){{2,8}})[hH]?)"
    r"(?!\w|\.\d|=\s*\w)"
)
_FIELD: Final = re.compile(rf"(?<![\w.])(?:0[xX])?{H}{{2,16}}[hH]?(?!\w)")
_LONGEST_ROW: Final = 512  # characters
_NUMBER: Final = re.compile(rf"0[xX]{H}+|(?<![^\W_]){H}{{1,4}}(?![^\W_])|\d+")
_LEAST_COPY: Final = 3  # bytes: fewer are alike by chance
_ENTRY_LINES: Final = 8  # between two reports of the same bytes
_ENTRY_FINE_NS: Final = 60_000_000
_ENTRY_COARSE_NS: Final = 1_000_000_000


def settle(lines: Sequence[LogLine], judge: Judge, experience: Experience) -> None:
    """Decide for every run of these lines whether it is taken; the others say why not."""
    for line in lines:
        for run in line.runs:
            run.taken = _speaks_for_itself(run, line, experience)
    _beside(lines)
    _columns(lines, judge, experience)
    _blocks(lines, judge)
    _rows_of_dumps(lines)
    _tails(lines, judge, experience)
    _copies(lines, experience)


def _speaks_for_itself(run: Run, line: LogLine, experience: Experience) -> bool:
    if run.sure or run.checked:
        return True
    if run.halved and not experience.other:
        return False
    if run.level >= experience.threshold:
        return True
    if run.level is Level.LIKELY and run.mark and (len(run.data) > 1 or not run.heading):
        return True
    if experience.decimals and run.shape == "decimal" and _plainly_decimal(line.clean[run.start : run.end]):
        return True
    if not experience.trust(run.label, run.shape, direct=run.direct):
        return False
    return _is_all(run, line) if not run.label else len(run.data) > _LEAST_COPY or _ends(line, run)


def _plainly_decimal(text: str) -> bool:
    return any(len(word) == 3 for word in re.findall(r"\d+", text))


def only_bytes(lines: Sequence[LogLine]) -> bool:
    """Whether these lines hold nothing but runs of digits."""
    filled = [line for line in lines if line.clean.strip() or line.runs]
    return all(len(line.runs) == 1 and line.runs[0].level and _is_all(line.runs[0], line) for line in filled)


def _is_all(run: Run, line: LogLine) -> bool:
    return not any(char.isalnum() for char in line.clean[: run.start] + line.clean[run.end :])


def _beside(lines: Sequence[LogLine]) -> None:
    """A short row that is nothing but bytes is as good as the row of bytes next to it: the end of an array."""
    filled = [line for line in lines if line.clean.strip()]
    for near in (filled, filled[::-1]):
        for one, other in pairwise(near):
            if len(one.runs) == len(other.runs) == 1 and one.runs[0].taken and not other.runs[0].taken:
                run = other.runs[0]
                if run.level is Level.LIKELY and not run.halved and _is_all(run, other) and _is_all(one.runs[0], one):
                    run.taken = (
                        len(run.data) > 1 or not other.clean[run.start : run.end].isdigit() or run.data[0] < 0x10
                    )


# A byte, or a field, a line.


def _columns(lines: Sequence[LogLine], judge: Judge, experience: Experience) -> None:
    """Frames written a byte or a field a line, or field by field in one line, found by their check values."""
    group: list[LogLine] = []
    for line in [*lines, None]:
        if line is not None and line.clean.strip() == "" and not line.runs:
            continue
        if line is not None and not _holds_bytes(line) and _TOKEN.search(line.clean) is not None:
            if len(_FIELD.findall(line.clean)) >= _COLUMN:
                _fields_of(line, _tokens(line), judge)
            if not _holds_bytes(line):
                group.append(line)
                if len(group) < _MOST_ROWS:
                    continue
        if group:
            _column_of(group, judge, experience)
        group = []


def _holds_bytes(line: LogLine) -> bool:
    return any(run.taken and (len(run.data) > 2 or run.checked or run.sure) for run in line.runs)


class _Token(NamedTuple):
    """A number of one byte, or of several in hex; `signed` where a sign before it says that it is hex."""

    start: int
    end: int
    digits: str
    signed: bool

    @property
    def hexadecimal(self) -> bytes | None:
        """The bytes that it is in hex."""
        digits = self.digits
        if digits[0] == "-" or len(digits) == 3:
            return None
        return bytes.fromhex(digits if len(digits) % 2 == 0 else f"0{digits}")

    @property
    def decimal(self) -> bytes | None:
        """The byte that it is in decimal."""
        digits = self.digits
        if self.signed or not digits.lstrip("-").isdigit() or not -129 < int(digits) < 256:
            return None
        return bytes((int(digits) & 0xFF,))


def _tokens(line: LogLine) -> list[_Token]:
    if len(line.clean) > _LONGEST_ROW:
        return []
    return [
        _Token(match.start(), match.end(), match[2] or match[3], match[1] is not None)
        for match in _TOKEN.finditer(line.clean)
    ]


def _fields_of(line: LogLine, tokens: list[_Token], judge: Judge) -> None:
    """`ID=01 FC=03 ADDR=0000 LEN=000A CRC=C5CD`"""
    for some in (tokens, tokens[1:]):
        parts = [token.hexadecimal for token in some]
        if None in parts:
            continue
        data = b"".join(part for part in parts if part)
        if 3 < len(data) <= _TAIL and _exactly(data, judge):
            _take_tokens(line, some, data)
            return


def _exactly(data: bytes, judge: Judge) -> bool:
    """Whether frames with right check values are all of these bytes."""
    return sum(span.end - span.start for span in judge(data)) == len(data)


def _column_of(lines: list[LogLine], judge: Judge, experience: Experience) -> None:
    """One number of each line, always the same one, where those are frames."""
    for skeleton, same in groupby(lines, _skeleton):
        alike = list(same)
        if skeleton in experience.columns:
            _take_column(alike, *experience.columns[skeleton])
        elif (found := _one_column(alike, judge, alike=True)) is not None:
            experience.columns[skeleton] = found
    if not any(run.taken for line in lines for run in line.runs):
        found = _one_column(lines, judge, alike=False)
        signs = {skeleton for line in lines if not any(map(str.isalpha, skeleton := _skeleton(line)))}
        if found is not None:
            experience.columns.update(dict.fromkeys(signs, found))


def _skeleton(line: LogLine) -> str:
    """A line without its numbers."""
    return " ".join(_NUMBER.sub("", line.clean).split())


def _one_column(lines: list[LogLine], judge: Judge, *, alike: bool) -> tuple[int, str] | None:
    """Which number of each line is a byte of frames, and how it is read; the lines of those frames are taken.

    Of lines `alike` what stands between two frames is taken, too.
    """
    if len(lines) < _COLUMN:
        return None
    table = [_tokens(line) for line in lines]
    counts = {len(tokens) for tokens in table}
    fewest = min(max(counts), _MOST_COLUMNS)
    from_front = range(fewest) if len(counts) > 1 else range(max(counts) - fewest)  # not counted from the end before
    seen: set[tuple[bytes | None, ...]] = set()
    for i in (*range(-1, -1 - fewest, -1), *from_front):
        for reading in ("hexadecimal", "decimal"):
            parts = [getattr(tokens[i], reading) if -len(tokens) <= i < len(tokens) else None for tokens in table]
            if (same := tuple(parts)) in seen:
                continue
            seen.add(same)
            inside = _inside_frames(parts, judge)
            if not any(inside):
                continue
            first, last = inside.index(True), len(inside) - inside[::-1].index(True)
            for row, (line, tokens, part) in enumerate(zip(lines, table, parts, strict=True)):
                if part is not None and (inside[row] or (alike and first <= row < last)):
                    _take_tokens(line, [tokens[i]], part)
            return i, reading
    return None


def _inside_frames(parts: Sequence[bytes | None], judge: Judge) -> list[bool]:
    """Which of these parts make up frames that begin and end with parts."""
    inside = [False] * len(parts)
    row = 0
    while row < len(parts):
        some = list(takewhile(lambda part: part is not None, parts[row : row + _TAIL]))
        data = b"".join(part for part in some if part)
        if len(data) < _COLUMN or max(data) < _SMALL:  # as no check value is
            row += len(some) + 1 if len(some) < _TAIL else _STEP + 1
            continue
        starts = [0, *accumulate(len(part) for part in some if part is not None)]
        spans = [span for span in judge(data) if {span.start, span.end} <= {*starts}]
        for span in spans:
            for k in range(starts.index(span.start), starts.index(span.end)):
                inside[row + k] = True
        row += starts.index(spans[-1].end) if spans else min(len(some), _STEP) + 1
    return inside


def _take_column(lines: list[LogLine], i: int, reading: str) -> None:
    for line in lines:
        tokens = _tokens(line)
        token = tokens[i] if -len(tokens) <= i < len(tokens) else None
        if token is not None and (part := getattr(token, reading)) is not None:
            _take_tokens(line, [token], part)


def _take_tokens(line: LogLine, tokens: list[_Token], data: bytes) -> None:
    start, end = tokens[0].start, tokens[-1].end
    mark = next((run.mark for run in line.runs if run.mark), 0)
    label = label_in(line.clean[max(start - 56, 0) : start])
    run = Run(data, start, end, _COLUMN_SHAPE, Level.NUMBER, label, mark, taken=True)
    run.checked = (Checked(0, len(data)),)
    line.runs = [run]


# Arrays over several lines.


def _blocks(lines: Sequence[LogLine], judge: Judge) -> None:
    """Runs that fill lines one below the other, read in another way where that makes right what is not."""
    block: list[tuple[LogLine, Run]] = []
    for line in [*lines, None]:
        if line is not None and line.runs and block and _begins(line, line.runs[0]) and len(block) < _MOST_ROWS:
            block.append((line, line.runs[0]))
            if _ends(line, line.runs[-1]) and len(line.runs) == 1:
                continue
        if len(block) > 1:
            _reread(block, judge)
        block = [(line, line.runs[-1])] if line is not None and line.runs and _opens(line, line.runs[-1]) else []


def _begins(line: LogLine, run: Run) -> bool:
    return not any(char.isalnum() for char in line.clean[: run.start]) or run.offset is not None


def _opens(line: LogLine, run: Run) -> bool:
    return _ends(line, run) and (len(run.data) > 1 or _begins(line, run))


def _ends(line: LogLine, run: Run) -> bool:
    return run.offset is not None or not any(char.isalnum() for char in line.clean[run.end :])


def _reread(block: list[tuple[LogLine, Run]], judge: Judge) -> None:
    if any(run.checked for _, run in block):
        return
    readings = [_readings(run) for _, run in block]
    for shape in readings[0]:
        if not all(shape in reading for reading in readings[1:]):
            continue
        data = b"".join(reading[shape].data for reading in readings)
        if len(data) <= MOST_JUDGED and (checked := judge(data)):
            if 2 * sum(span.end - span.start for span in checked) < len(data):
                continue
            for (_, run), reading in zip(block, readings, strict=True):
                run.take(reading[shape])
                run.taken = True
            block[0][1].checked = checked
            return


def _rows_of_dumps(lines: Sequence[LogLine]) -> None:
    """The rows of a dump are read as its first one is; of 16-bit words the last may be half filled."""
    for one, other in pairwise(lines):
        if other.continues and one.runs and other.runs and one.runs[-1].taken:
            first, row = one.runs[-1], other.runs[0]
            if row.offset is not None and row.shape != first.shape and first.shape in (readings := _readings(row)):
                row.take(readings[first.shape])
            row.taken = row.taken or row.offset is not None
    for line in lines:
        for run in line.runs:
            if run.padded and run.shape.startswith("swapped"):
                run.data, run.padded = run.data[:-1], False


def _readings(run: Run) -> dict[str, Run | Candidate]:
    readings: dict[str, Run | Candidate] = {run.shape: run}
    for other in run.others:
        if abs(other.end - run.end) < 2:
            readings.setdefault(other.shape, other)
    return readings


# What completes a frame that other output interrupted.


def _tails(lines: Sequence[LogLine], judge: Judge, experience: Experience) -> None:
    open_runs: list[bytes] = []  # taken, but with no right check value yet
    since = 0
    for line in lines:
        if line.number - since > _TAIL_LINES:
            open_runs = []
        for run in line.runs:
            if not run.taken and open_runs and len(run.data) <= _TAIL and _completes(run, open_runs, judge):
                key = (run.label, run.shape)
                experience.right[key] = experience.right.get(key, 0) + 1
                open_runs = []
            elif run.taken:
                open_runs = [] if run.checked else [*open_runs[1 - _TAIL_RUNS :], run.data[-_TAIL:]]
                since = line.number


def _completes(run: Run, open_runs: Sequence[bytes], judge: Judge) -> bool:
    """Whether a frame begins in one of the open runs and ends with this one, which then is taken."""
    candidates: tuple[Run | Candidate, ...] = (run, *run.others)
    for reading in candidates:
        for i in range(len(open_runs)):
            joint = b"".join(open_runs[i:]) + reading.data
            begins = len(joint) - len(reading.data)
            if any(span.start < begins and span.end == len(joint) for span in judge(joint)):
                if isinstance(reading, Candidate):
                    run.take(reading)
                run.taken = True
                return True
    return False


# What is said twice.


@dataclass(slots=True)
class _Entry:
    """The bytes of one read, over one line or several."""

    data: bytes
    first: LogLine
    last: LogLine
    runs: list[Run]

    @property
    def checked(self) -> bool:
        return any(run.checked for run in self.runs)

    @property
    def template(self) -> tuple[str, str]:
        return self.runs[0].label or self.runs[0].heading, self.runs[0].shape

    @property
    def mark(self) -> int:
        return self.runs[0].mark

    @property
    def decoded(self) -> bytes:
        """The bytes that an ASCII-mode frame's characters stand for."""
        if self.data[:1] != b":":
            return b""
        try:
            return bytes.fromhex(self.data[1:].decode("ascii").strip())
        except ValueError:
            return b""


def _entries(lines: Sequence[LogLine]) -> Iterator[_Entry]:
    held: _Entry | None = None
    for line in lines:
        for i, run in enumerate(run for run in line.runs if run.taken):
            same = (
                held is not None
                and run.shape == held.runs[-1].shape == _COLUMN_SHAPE
                and run.label == held.runs[-1].label
            )
            if held is not None and not i and (line.continues or same):
                held.data += run.data
                held.last = line
                held.runs.append(run)
                continue
            if held is not None:
                yield held
            held = _Entry(run.data, line, line, [run])
    if held is not None:
        yield held


def _copies(lines: Sequence[LogLine], experience: Experience) -> None:
    recent: list[_Entry] = []
    for entry in _entries(lines):
        for earlier in reversed(recent):
            if not _one_report(earlier, entry):
                continue
            drop = _copy_of_two(earlier, entry, experience)
            if drop is not None:
                other = earlier if drop is entry else entry
                for run in drop.runs:
                    run.taken = False
                    run.why = f"the same bytes as in line {other.first.number}"
                if drop is entry:
                    break
                recent.remove(earlier)
        else:
            recent.append(entry)
        del recent[:-4]


def _one_report(earlier: _Entry, entry: _Entry) -> bool:
    """Whether two runs can be of one log entry: near in the text and in time, of one direction."""
    if entry.first.number - earlier.last.number > _ENTRY_LINES:
        return False
    if earlier.mark and entry.mark and earlier.mark != entry.mark:
        return False
    first, second = earlier.last.t_ns, entry.first.t_ns
    if first is None or second is None:
        return True
    limit = _ENTRY_FINE_NS if earlier.last.fine and entry.first.fine else _ENTRY_COARSE_NS
    return abs(second - first) <= limit


def _copy_of_two(earlier: _Entry, entry: _Entry, experience: Experience) -> _Entry | None:
    """The one of two that only repeats bytes of the other; None where both are of their own."""
    same_line = earlier.last is entry.first
    if (earlier.template == entry.template and not same_line) or min(len(earlier.data), len(entry.data)) < _LEAST_COPY:
        return None
    if earlier.template[1] == entry.template[1] == _COLUMN_SHAPE:
        return None
    pair = (*earlier.template, *entry.template)
    if entry.data in (earlier.data, earlier.decoded):
        marked = earlier.mark == entry.mark != 0
        timed = earlier.last.t_ns is not None and entry.first.t_ns is not None
        if not (same_line or marked or timed) and entry.runs[0].heading:
            return None  # only the words above them differ: somebody shows the same frame again
        if earlier.checked and not any(span.repeats for run in earlier.runs for span in run.checked):
            experience.reports.add(pair)
            return entry
        reported = earlier.runs[0].shape != entry.runs[0].shape if same_line else marked or pair in experience.reports
        return entry if reported else None
    if same_line and len(entry.data) == len(earlier.data):  # a string and its hex, in another encoding
        strings = [one for one in (earlier, entry) if one.runs[0].shape == "\\x"]
        same = sum(a == b for a, b in zip(earlier.data, entry.data, strict=True))
        if len(strings) == 1 and 2 * same >= len(entry.data) and not strings[0].checked:
            return strings[0]
    bytewise = earlier.template[1] == _COLUMN_SHAPE
    if (bytewise or not entry.checked) and (entry.data in earlier.data or entry.data in earlier.decoded):
        if earlier.checked:
            experience.reports.add(pair)
        return entry if pair in experience.reports else None
    if not earlier.checked and entry.checked and earlier.data in entry.data:
        return earlier
    return None
