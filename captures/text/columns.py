"""Frames written a byte or a field a line, or field by field in one, found by check values or by columns alone."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from itertools import groupby, pairwise
from typing import Final

from ..checked import Checked
from .candidates import H, Writing, counts_up
from .choosing import ByteRun, Experience, covered, label_in
from .judging import ByteJudge, lenient
from .loglines import LogLine
from .seams import frames_over
from .tokens import JOINED, NumberToken, cell_of, holds_numbers, skeleton_of, tokens_of
from .tools import names_a_way

COLUMN_SHAPE: Final = "column"
MOST_ROWS: Final = 600  # of one column, or of one array
_FRAME: Final = 260  # bytes
_LEAST: Final = 3  # bytes: fewer are no frame
_LEAST_DAMAGED: Final = 7  # of a frame field by field without a right check value
FEW: Final = 4  # bytes, up to which numbers beside one another may look like them
LEAST_COLUMN: Final = 4  # lines, or fields, that can hold a frame a byte each
_MOST_COLUMNS: Final = 4  # from either side of a line
_FIELD: Final = re.compile(rf"(?<![\w.])(?:0[xX])?{H}{{2,512}}[hH]?(?!\w)")
_LETTERS: Final = re.compile(r"[g-zG-Z]")
FIELDS: Final = 3  # names that make a list of a frame's fields
_COUNTED: Final = "[0]= [1]= [2]="  # lines of bytes with their numbers, whatever their length
_OCTETS: Final = "b'' b'' b''"
_PATIENCE: Final = 3000  # rows of numbers without a frame, after which none is looked for in the columns of a text


def settle_columns(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Frames written a byte or a field a line, or field by field in one line, found by their check values."""
    group: list[LogLine] = []
    for line in lines:
        if not line.clean.strip() or _is_timed_word(line):
            continue
        wanted = not line.is_known and not is_right(line) and holds_numbers(line)
        if wanted:
            _fields_of(line, judge, experience)
        if wanted and (group or not holds_bytes(line)):
            group.append(line)
        if group and (not wanted or len(group) == MOST_ROWS):
            _column_of(group, judge, experience)
            group = []
    if group:
        _column_of(group, judge, experience)


def _is_timed_word(line: LogLine) -> bool:
    """`0,12.40,Start bit`: of a row for each event of a byte, one that does not show it."""
    return line.t_ns is not None and not line.runs and not holds_numbers(line)


def is_right(line: LogLine) -> bool:
    """Whether bytes of a line are beyond doubt."""
    return any(run.taken and (run.checked or run.sure or run.joined) for run in line.runs)


def holds_bytes(line: LogLine) -> bool:
    """Whether a line holds more bytes than numbers beside one another may look like."""
    return any(run.taken and (len(run.data) > FEW or run.checked) for run in line.runs)


def _fields_of(line: LogLine, judge: ByteJudge, experience: Experience) -> None:
    """`ID=01 FC=03 ADDR=0000 LEN=000A CRC=C5CD`, `ID 01 | FC 03 | 00 00 00 0A | CRC C5 CD`

    Only of fields with names one may be a name. Lines like one that was a frame are read as it was.
    """
    tokens = tokens_of(line)
    counted = _counted(tokens)
    octets = sum(token.octet is not None for token in tokens)
    if counted is None and max(len(_FIELD.findall(line.clean)), octets) < LEAST_COLUMN:
        return
    tokens = tokens if counted is None else counted
    skeleton = _COUNTED if counted is not None else _OCTETS if octets == len(tokens) else skeleton_of(line)
    ways = [tokens]
    if not holds_bytes(line) or _LETTERS.search(line.clean) is not None:
        plain = _without_names(tokens, line.clean)
        ways += tokens[1:], plain, plain[1:]
    readings = [(some, _joined_up([token.hexadecimal for token in some])) for some in ways]
    if counted is not None:
        readings.insert(0, (counted, _joined_up([token.decimal for token in counted])))
    least = _LEAST_DAMAGED if experience.damaged and counted is None else _LEAST
    for i, (some, data) in enumerate(readings):
        if least < len(data) <= _FRAME and not counts_up(data) and _exactly(data, judge):
            take_tokens(line, some, data)
            experience.fields.setdefault(skeleton, i)
            return
    known = experience.fields.get(skeleton, len(readings))
    if known < len(readings) and _LEAST < len(readings[known][1]) <= _FRAME:
        take_tokens(line, *readings[known], checked=False)


def _without_names(tokens: Sequence[NumberToken], text: str) -> Sequence[NumberToken]:
    """Those that are no names of fields.

    `9e fc 31 5d`: where no other name stands between them, none is: leaving bytes out until a CRC comes out right would
    find frames in noise.
    """
    if not tokens or _LETTERS.search(text, tokens[0].end, tokens[-1].start) is None:
        return tokens
    return [token for token in tokens if not token.is_name]


def _joined_up(parts: Sequence[bytes]) -> bytes:
    """Parts as one; none where one is no byte."""
    return b"".join(parts) if all(parts) else b""


def _counted(tokens: Sequence[NumberToken]) -> Sequence[NumberToken] | None:
    """The values of `[0]=01 [1]=03`, `0:0x01 1:0x03`; None of other lines."""
    numbers = [token.digits for token in tokens[::2]]
    counts = any(numbers == [*map(str, range(first, first + len(numbers)))] for first in (0, 1))
    return tokens[1::2] if counts and len(tokens) == 2 * len(numbers) >= 2 * LEAST_COLUMN else None


def _exactly(data: bytes, judge: ByteJudge) -> bool:
    """Whether frames with right check values are all of these bytes."""
    return covered(judge(data)) == len(data)


def _column_of(lines: list[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """One number of each line, always the same one, where those are frames.

    Of lines that are alike first, whether one below the other or with others between; then of all.
    """
    apart: dict[str, list[LogLine]] = {}
    for line in lines:
        apart.setdefault(skeleton_of(line), []).append(line)
    adjacent = [list(same) for _, same in groupby(lines, skeleton_of)]
    tried = {tuple(map(id, alike)) for alike in adjacent}
    for alike in (*adjacent, *(some for some in apart.values() if tuple(map(id, some)) not in tried)):
        skeleton = skeleton_of(alike[0])
        if skeleton in experience.columns:
            _take_column(alike, *experience.columns[skeleton])
        elif experience.in_vain > _PATIENCE:
            continue
        elif (found := _one_column(alike, judge, alike=True, damaged=experience.damaged)) is not None:
            experience.columns[skeleton] = found
        elif ways := set(experience.columns.values()):
            _one_column(alike, lenient(judge), ways, alike=True, damaged=True)
    if 2 * bytes_of_columns(lines) < len(lines) and experience.in_vain <= _PATIENCE and not experience.damaged:
        found = _one_column(lines, judge, alike=False)
        signs = {skeleton for skeleton in apart if not any(map(str.isalpha, skeleton))}
        if found is not None:
            experience.numbers.update(dict.fromkeys(signs, found))
            inside = {skeleton_of(line) for line in lines if bytes_of_columns([line])}
            experience.named.update(dict.fromkeys(inside - signs - set(experience.columns), found))
    _take_known(lines, experience)
    experience.in_vain = 0 if bytes_of_columns(lines) else experience.in_vain + len(lines)


def _take_known(lines: Sequence[LogLine], experience: Experience) -> None:
    """Lines like those of frames are read as those were, though their check value is wrong.

    Where most fields of a frame are known by their names, so are those between. A name that comes again begins a frame.
    """
    names = [skeleton_of(line) for line in lines]
    known = [experience.numbers.get(name) or experience.named.get(name) for name in names]
    fields = {name for name, way in zip(names, known, strict=True) if way is not None and any(map(str.isalpha, name))}
    ways = {way for way in known if way is not None}
    if len(ways) == 1 and len(fields) >= FIELDS:
        inside = [i for i, way in enumerate(known) if way is not None]
        known[inside[0] : inside[-1] + 1] = [*ways] * (inside[-1] + 1 - inside[0])
    named: set[str] = set()
    for i, (line, name, way) in enumerate(zip(lines, names, known, strict=True)):
        if way is None or bytes_of_columns([line]) or holds_bytes(line):
            continue
        _take_column([line], *way)
        line.continues = i > 0 and name in fields - named and bytes_of_columns([lines[i - 1]]) > 0
        named = named | {name} if line.continues else {name}


def bytes_of_columns(lines: Sequence[LogLine]) -> int:
    """How many of these lines are bytes of a column."""
    return sum(any(run.taken and run.shape == COLUMN_SHAPE for run in line.runs) for line in lines)


def _one_column(
    lines: list[LogLine],
    judge: ByteJudge,
    ways: Collection[tuple[int, str]] = (),
    *,
    alike: bool,
    damaged: bool = False,
) -> tuple[int, str] | None:
    """Which number of each line is a byte of frames, and how it is read; the lines of those frames are taken.

    Of lines `alike` what stands between two frames is taken, too. `ways` are all that it may be, where there are any.
    `damaged`: no check value is right, so that every line must be of a frame, and none a number of the lines.
    """
    tried: list[list[bytes]] = []  # of lines with as many numbers each, every column comes twice
    best: tuple[tuple[int, bool], int, str, list[int]] | None = None  # that of the most lines, best one below the other
    for i, reading, cells in _ways(lines) if len(lines) >= LEAST_COLUMN else ():
        parts = [
            b"" if cell is None or (reading != JOINED and holds_bytes(line)) else cell.value(reading)
            for line, cell in zip(lines, cells, strict=True)
        ]
        if (ways and (i, reading) not in ways) or parts in tried or (damaged and _is_numbering(parts)):
            continue
        tried.append(parts)
        inside = _inside_frames(parts, judge)
        rows = len(inside) - inside.count(0)
        starts = {cell.start for cell, frame in zip(cells, inside, strict=True) if cell is not None and frame}
        if rows > damaged * (len(lines) - 1) and (best is None or (rows, len(starts) == 1) > best[0]):
            best = (rows, len(starts) == 1), i, reading, inside
    if best is None:
        return None
    _, i, reading, inside = best
    _take_inside(lines, i, reading, inside, alike=alike)
    return i, reading


def _take_inside(lines: list[LogLine], i: int, reading: str, inside: Sequence[int], *, alike: bool) -> None:
    rows = [row for row, frame in enumerate(inside) if frame]
    above: tuple[int, LogLine] = (0, lines[0])
    for row in range(rows[0], rows[-1] + 1):
        line, frame = lines[row], inside[row]
        cell = cell_of(line, i, reading)
        if cell is not None and cell.value(reading) and (alike or frame):
            take_tokens(line, [cell], cell.value(reading))
            line.continues = frame > 0 and above[0] == frame and above[1].t_ns == line.t_ns
            above = frame, line


def _ways(lines: Sequence[LogLine]) -> Iterator[tuple[int, str, list[NumberToken | None]]]:
    """Which number of each line may be a byte, from either end, how it may be read, and those numbers."""
    bits = any(token.is_bits for line in lines[:LEAST_COLUMN] for token in tokens_of(line))
    for reading in ("hexadecimal", "decimal", *(("binary",) * bits), JOINED):
        table = [tokens_of(line, reading) for line in lines]
        fewest = min(max(map(len, table)), _MOST_COLUMNS)
        for i in (*range(-1, -1 - fewest, -1), *range(fewest)):
            yield i, reading, [tokens[i] if -len(tokens) <= i < len(tokens) else None for tokens in table]


def _is_numbering(parts: Sequence[bytes]) -> bool:
    """Whether these are mostly the numbers of lines, or of bytes."""
    values = [int.from_bytes(part, "big") for part in parts]
    return 2 * sum(later - earlier == 1 for earlier, later in pairwise(values)) > len(values)


def _inside_frames(parts: Sequence[bytes], judge: ByteJudge) -> list[int]:
    """Which of these parts make up frames that begin and end with parts: the frame's number from 1 on, or 0."""
    inside = [0] * len(parts)
    for number, (_, first, end) in enumerate(frames_over(parts, judge), 1):
        inside[first:end] = [number] * (end - first)
    return inside


def _take_column(lines: list[LogLine], i: int, reading: str) -> None:
    above: LogLine | None = None
    for line in lines:
        cell = cell_of(line, i, reading)
        if cell is not None and (part := cell.value(reading)):
            take_tokens(line, [cell], part)
            near = above is not None and (above.number + 1, above.t_ns) == (line.number, line.t_ns)
            line.continues = above is not None and near and above.runs[-1].mark == line.runs[-1].mark
            above = line


def take_tokens(line: LogLine, tokens: Sequence[NumberToken], data: bytes, *, checked: bool = True) -> None:
    """Numbers of a line as bytes of a column."""
    start, end = tokens[0].start, tokens[-1].end
    mark = next((run.mark for run in line.runs if run.mark), 0)
    label = label_in(line.clean[max(start - 56, 0) : start])
    run = ByteRun(data, start, end, COLUMN_SHAPE, Writing.NUMBER, label, mark, taken=True)
    run.checked = (Checked(0, len(data)),) if checked else ()
    line.runs, line.problem = [run], None


_SAID_BEFORE: Final = re.compile(r"(?<![\w.])(?:0b(?P<bits>[01]{8})|(?P<decimal>\d{1,3}))\W{1,3}$")


def settle_unchecked(lines: Sequence[LogLine], experience: Experience) -> None:
    """A byte or a field a line without a check value behind them.

    Lines of nothing but one or two hex digits; and, where a text holds nothing that is plainer, bytes beside what each
    means: `0x01 -> unit`. Numbers that only rise count something, and are none.
    """
    for twice, same in groupby(lines, _in_two_bases):
        group = list(same)
        if twice and len(group) >= LEAST_COLUMN and not any(map(holds_bytes, group)):
            _take_unchecked(group, [tokens_of(line)[-1] for line in group])
    for loose, same in groupby(
        lines, lambda line: holds_numbers(line) and not is_right(line) and not holds_bytes(line)
    ):
        group = list(same)
        table = [tokens_of(line, JOINED) for line in group]
        if not loose or len(group) < LEAST_COLUMN or not all(table):
            continue
        bare = all(tokens[0].digits == line.clean.strip() for line, tokens in zip(group, table, strict=True))
        named = _are_numbered(table) or len({skeleton_of(line) for line in group}) >= FIELDS
        if not bare and not (experience.meanings and named):
            continue
        columns = [[tokens[i] for tokens in table] for i in (0, -1)]
        column = next((one for one in columns if _are_written_as_bytes(one, bare=bare) and not _counts_on(one)), None)
        if column is not None:
            _take_unchecked(group, column)


def _is_loose(line: LogLine) -> bool:
    return holds_numbers(line) and not is_right(line) and not holds_bytes(line)


def _take_unchecked(lines: Sequence[LogLine], column: Sequence[NumberToken]) -> None:
    for line, token in zip(lines, column, strict=True):
        take_tokens(line, [token], token.hexadecimal, checked=False)
        line.continues = line is not lines[0]


def _in_two_bases(line: LogLine) -> bool:
    """`received Byte 27 (0X1b)`: a byte of a message in decimal, or bit by bit, and in hex."""
    tokens = tokens_of(line)
    said = _SAID_BEFORE.search(line.clean[: tokens[-1].start]) if tokens else None
    if said is None or not tokens[-1].signed or not names_a_way(skeleton_of(line)):
        return False
    return int(tokens[-1].digits, 16) == (int(said["bits"], 2) if said["bits"] else int(said["decimal"]))


def _are_numbered(table: Sequence[Sequence[NumberToken]]) -> bool:
    """Whether lines begin with their numbers, from 0 or 1 on."""
    numbers = [tokens[0].digits for tokens in table if len(tokens) > 1]
    return any(numbers == [*map(str, range(first, first + len(table)))] for first in (0, 1))


def _are_written_as_bytes(column: Sequence[NumberToken], *, bare: bool) -> bool:
    if not all(token.hexadecimal for token in column):
        return False
    if bare:
        return max(len(token.digits) for token in column) < 3 and any(map(_plainly_hex, column))
    signed = sum(token.signed for token in column)
    return signed == len(column) or (not signed and 2 * sum(map(_plainly_hex, column)) >= len(column))


def _plainly_hex(token: NumberToken) -> bool:
    return len(token.digits) > 1 and (token.digits[0] == "0" or not token.digits.isdigit())


def _counts_on(column: Sequence[NumberToken]) -> bool:
    values = [int.from_bytes(token.hexadecimal, "big") for token in column]
    return min(later - earlier for earlier, later in pairwise(values)) >= 0
