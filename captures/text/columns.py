"""Frames written a byte or a field a line, or field by field in one, found by check values or by columns alone."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
from itertools import dropwhile, groupby, pairwise
from typing import Final

from ..checked import Checked
from .candidates import H, Writing, counts_up
from .choosing import label_in
from .judging import ByteJudge, frames_over, lenient
from .loglines import LogLine
from .runs import FLOORS, ByteRun, Experience, covered
from .tokens import JOINED, NumberToken, holds_numbers, nth, skeleton_in, skeleton_of, tokens_of
from .tools import names_a_way

COLUMN_SHAPE: Final = "column"
MOST_ROWS: Final = 600  # of one column, or of one array
_FRAME: Final = 260  # bytes
_LEAST: Final = 3  # bytes: fewer are no frame
_LEAST_DAMAGED: Final = 7  # of a frame field by field without a right check value
FEW: Final = 4  # bytes, up to which numbers beside one another may look like them
LEAST_COLUMN: Final = 4  # lines, or fields, that can hold a frame a byte each
_MOST_COLUMNS: Final = 4  # from either side of a line
_LEAST_CELLS: Final = 3  # of a row of a table
_FIELD: Final = re.compile(rf"(?<![\w.])(?:0[xX])?{H}{{2,512}}[hH]?(?!\w)")
_LETTERS: Final = re.compile("[g-zG-Z]")
_SAID_BEFORE: Final = re.compile(r"(?<![\w.])(?:0b(?P<bits>[01]{8})|(?P<decimal>\d{1,3}))\W{1,3}$")  # `Byte 27 (0X1b)`
FIELDS: Final = 3  # names that make a list of a frame's fields
_COUNTED: Final = "[0]= [1]= [2]="  # lines of bytes with their numbers, whatever their length
_OCTETS: Final = "b'' b'' b''"
_COLUMNS: Final = "columns"  # a search that has its patience


def settle_columns(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Frames written a byte or a field a line, or field by field in one line, found by their check values."""
    rows = (line for line in lines if line.clean.strip() and not _is_timed_word(line))
    for numbers, same in groupby(rows, _may_be_row):
        group = list(same) if numbers else []
        for line in group:
            _fields_of(line, judge, experience)
        group = list(dropwhile(holds_bytes, group))
        for first in range(0, len(group), MOST_ROWS):
            _column_of(group[first : first + MOST_ROWS], judge, experience)


def _may_be_row(line: LogLine) -> bool:
    """Whether a line has numbers, and is not known to be something else."""
    return not (line.is_known or is_right(line)) and holds_numbers(line)


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
    counted, octets = _counted(tokens), sum(token.octet for token in tokens)
    if not counted and max(len(_FIELD.findall(line.clean)), octets) < LEAST_COLUMN:
        return
    skeleton = _COUNTED if counted else _OCTETS if octets == len(tokens) else skeleton_of(line)
    readings = [*_fields_in(tokens, counted, line.clean)]
    least = _LEAST_DAMAGED if experience.damaged and not counted else _LEAST
    sized = ((i, data) for i, (_, data) in enumerate(readings) if least < len(data) <= _FRAME)
    right = next((i for i, data in sized if _are_frames(data, judge)), None)
    known = experience.fields.get(skeleton) if right is None else right
    if known is not None and _LEAST < len(readings[known][1]) <= _FRAME:
        experience.fields.setdefault(skeleton, known)
        take_tokens(line, *readings[known], checked=right is not None)


_Fields = tuple[Sequence[NumberToken], bytes]


def _fields_in(tokens: Sequence[NumberToken], counted: Sequence[NumberToken], text: str) -> Iterator[_Fields]:
    """The fields that numbers may be, and their bytes; the first may be the number of the line."""
    fields = counted or tokens
    if counted:
        yield counted, _joined_up([token.decimal for token in counted])
    plain = _without_names(fields, text)
    for some in (fields, _behind_number(fields, text), plain, _behind_number(plain, text)):
        yield some, _joined_up([token.hexadecimal for token in some])


def _behind_number(tokens: Sequence[NumberToken], text: str) -> Sequence[NumberToken]:
    """Those behind the number of a line, which is not as wide as the next, or stands apart from it otherwise."""
    gaps = {text[one.end : other.start] for one, other in pairwise(tokens[:3])}
    widths = {len(token.digits) for token in tokens[:2]}
    return tokens[len(gaps) + len(widths) > 2 :]


def _without_names(tokens: Sequence[NumberToken], text: str) -> Sequence[NumberToken]:
    """Those that are no names of fields.

    `9e fc 31 5d`: where no other name stands between them, none is: leaving bytes out until a CRC comes out right would
    find frames in noise.
    """
    if _LETTERS.search(text, tokens[0].end, tokens[-1].start) is None:
        return tokens
    return [token for token in tokens if not token.is_name]


def _joined_up(parts: Sequence[bytes]) -> bytes:
    """Parts as one; none where one is no byte."""
    return b"".join(parts) if all(parts) else b""


def _counted(tokens: Sequence[NumberToken]) -> Sequence[NumberToken]:
    """The values of `[0]=01 [1]=03`, `0:0x01 1:0x03`; none of other lines."""
    numbers = [token.digits for token in tokens[::2]]
    counts = any(numbers == [*map(str, range(first, first + len(numbers)))] for first in (0, 1))
    return tokens[1::2] if counts and len(tokens) == 2 * len(numbers) >= 2 * LEAST_COLUMN else ()


def _are_frames(data: bytes, judge: ByteJudge) -> bool:
    """Whether frames with right check values are all of these bytes, which do not count up."""
    return not counts_up(data) and covered(judge(data)) == len(data)


def _column_of(lines: list[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """One number of each line, always the same one, where those are frames: of lines that are alike, then of all."""
    kinds: dict[str, list[LogLine]] = {}
    for line in lines:
        kinds.setdefault(skeleton_of(line), []).append(line)
    for skeleton, alike in kinds.items():
        _column_of_kind(skeleton, alike, judge, experience)
    searched = experience.damaged or experience.patience.ends(_COLUMNS)
    if 2 * sum(map(is_of_column, lines)) < len(lines) and not searched:
        found = _one_column(lines, judge, alike=False)
        if found is not None:
            bare = {skeleton for skeleton in kinds if not any(map(str.isalpha, skeleton))}
            inside = {skeleton_of(line) for line in lines if is_of_column(line)}
            experience.columns |= dict.fromkeys((bare | inside) - {*experience.columns}, found)
    _take_known(lines, experience)
    experience.patience.spend(_COLUMNS, len(lines), found=any(map(is_of_column, lines)))


def _column_of_kind(skeleton: str, alike: list[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """The same of lines that are alike, if those before say nothing else."""
    known = experience.columns
    ways = [known[skeleton]] if skeleton in known else []
    if not ways and experience.patience.ends(_COLUMNS):
        return
    if (found := _one_column(alike, judge, ways, alike=True, damaged=experience.damaged)) is not None:
        known[skeleton] = found
    elif not ways and known:  # as long as a header says, in a column of others
        _one_column(alike, lenient(judge), {*known.values()}, alike=True, damaged=True)


def _take_known(lines: Sequence[LogLine], experience: Experience) -> None:
    """Lines like those of frames are read as those were, though their check value is wrong."""
    names = [skeleton_of(line) for line in lines]
    fields = {name for name in names if name in experience.columns and any(map(str.isalpha, name))}
    above: LogLine | None = None
    for line, name in zip(lines, names, strict=True):
        way = experience.columns.get(name) or _way_of_emptier(line, experience)
        if is_of_column(line):
            above = None
            experience.shown[len(_cells_of(line.clean))] = line.clean, experience.columns.get(name)
        elif holds_bytes(line) and len(fields) > 1:
            above = None
        elif way is not None and (part := (cell := nth(tokens_of(line, way[1]), way[0])).value(way[1])):
            take_tokens(line, [cell], part)
            line.continues = above is not None and _is_right_below(above, line)
            above = line


def _way_of_emptier(line: LogLine, experience: Experience) -> tuple[int, str] | None:
    """The way of rows that leave a cell empty in which this one has a word, as of an error."""
    cells = _cells_of(line.clean)
    other, way = experience.shown.get(len(cells), ("", None))
    return way if len(cells) >= _LEAST_CELLS and all(map(_is_fuller, cells, _cells_of(other))) else None


def _cells_of(row: str) -> list[str]:
    return row.replace(";", ",").replace("|", ",").split(",")


def _is_fuller(cell: str, other: str) -> bool:
    return not other.strip() or skeleton_in(cell) == skeleton_in(other)


def _is_right_below(above: LogLine, line: LogLine) -> bool:
    """Whether a line goes on with a frame: the next one, at the same time, of nobody else."""
    marks = {one.runs[-1].mark for one in (above, line)} - {0}
    return (above.number + 1, above.t_ns) == (line.number, line.t_ns) and len(marks) < 2


def is_of_column(line: LogLine) -> bool:
    """Whether a line is a byte of a column."""
    return any(run.taken and run.shape == COLUMN_SHAPE for run in line.runs)


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
    if len(lines) < LEAST_COLUMN:
        return None
    tried: list[list[bytes]] = []  # of lines with as many numbers each, every column comes twice
    found: list[tuple[tuple[int, bool], tuple[int, str], list[int]]] = []  # of how many lines, below one another
    shown = [*map(holds_bytes, lines)]
    for way, cells in _ways(lines, ways):
        whole = way[1] != JOINED
        parts = [b"" if whole and other else cell.value(way[1]) for cell, other in zip(cells, shown, strict=True)]
        if parts in tried or (damaged and _is_numbering(parts)):
            continue
        tried.append(parts)
        inside = _inside_frames(parts, judge)
        rows = len(inside) - inside.count(0)
        starts = {cell.start for cell, frame in zip(cells, inside, strict=True) if frame}
        if rows > damaged * (len(lines) - 1):
            found.append(((rows, len(starts) == 1), way, inside))
    if not found:
        return None
    _, way, inside = max(found, key=lambda one: one[0])
    _take_inside(lines, *way, inside, alike=alike)
    return way


def _take_inside(lines: list[LogLine], i: int, reading: str, inside: Sequence[int], *, alike: bool) -> None:
    rows = [row for row, frame in enumerate(inside) if frame]
    above: tuple[int, LogLine] = (0, lines[0])
    for row in range(rows[0], rows[-1] + 1):
        line, frame = lines[row], inside[row]
        cell = nth(tokens_of(line, reading), i)
        if (alike or frame) and (part := cell.value(reading)):
            take_tokens(line, [cell], part)
            line.continues = row > rows[0] and above[0] == frame and above[1].t_ns == line.t_ns
            above = frame, line


def _ways(
    lines: Sequence[LogLine], known: Collection[tuple[int, str]]
) -> Iterator[tuple[tuple[int, str], list[NumberToken]]]:
    """Which number of each line may be a byte, from either end, how it may be read, and those numbers."""
    table: Sequence[Sequence[NumberToken]] = [tokens_of(line) for line in lines]
    bits = any(token.is_bits for tokens in table[:LEAST_COLUMN] for token in tokens)
    for reading in ("hexadecimal", "decimal", *(("binary",) * bits), JOINED):
        if reading == JOINED:
            table = [tokens_of(line, JOINED) for line in lines]
        fewest = min(max(map(len, table)), _MOST_COLUMNS)
        for i in (*range(-1, -1 - fewest, -1), *range(fewest)):
            if not known or (i, reading) in known:
                yield (i, reading), [nth(tokens, i) for tokens in table]


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


def take_tokens(line: LogLine, tokens: Sequence[NumberToken], data: bytes, *, checked: bool = True) -> None:
    """Numbers of a line as bytes of a column."""
    start, end = tokens[0].start, tokens[-1].end
    mark = next((run.mark for run in line.runs if run.mark), 0)
    label = label_in(line.clean[max(start - 56, 0) : start])
    run = ByteRun(data, start, end, COLUMN_SHAPE, Writing.NUMBER, label, mark, taken=True)
    run.checked = (Checked(0, len(data)),) if checked else ()
    line.runs, line.problem = [run], None


def settle_unchecked(lines: Sequence[LogLine], experience: Experience) -> None:
    """A byte or a field a line without a check value behind them.

    Lines of nothing but one or two hex digits; and, where a text holds nothing that is plainer, bytes beside what each
    means: `0x01 -> unit`. Numbers that only rise count something, and are none.
    """
    for is_of_message, column_of in ((_in_two_bases, _column_in_hex), (holds_numbers, _column_of_bytes)):
        for fits, same in groupby(lines, partial(_is_loose, is_of_message=is_of_message)):
            group = list(same)
            column = column_of(group, experience) if fits and len(group) >= LEAST_COLUMN else ()
            for line, token in zip(group, column, strict=False):
                take_tokens(line, [token], token.hexadecimal, checked=False)
                line.continues = line is not group[0]


def _column_in_hex(lines: Sequence[LogLine], _: Experience) -> Sequence[NumberToken]:
    """The last numbers of lines that say each byte in two bases."""
    return [tokens_of(line)[-1] for line in lines]


def _column_of_bytes(lines: Sequence[LogLine], experience: Experience) -> Sequence[NumberToken]:
    """The first or the last numbers of lines that have nothing else, or that say what each means."""
    table = [tokens_of(line, JOINED) for line in lines]
    bare = all(tokens[0].digits == line.clean.strip() for line, tokens in zip(lines, table, strict=True))
    if not bare and (experience.floor != FLOORS[-1] or len({skeleton_of(line) for line in lines}) < FIELDS):
        return ()
    columns = [[tokens[i] for tokens in table] for i in (0, -1)]
    return next((one for one in columns if _are_written_as_bytes(one, bare=bare) and not _counts_on(one)), ())


def _is_loose(line: LogLine, is_of_message: Callable[[LogLine], bool]) -> bool:
    """Whether a line that shows no bytes yet may say one of a message."""
    return not (is_right(line) or holds_bytes(line)) and is_of_message(line)


def _in_two_bases(line: LogLine) -> bool:
    """`received Byte 27 (0X1b)`: a byte of a message in decimal, or bit by bit, and in hex."""
    last = nth(tokens_of(line), -1)
    said = _SAID_BEFORE.search(line.clean[: last.start]) if last.signed else None
    if said is None or not names_a_way(skeleton_of(line)):
        return False
    return int(last.digits, 16) == (int(said["bits"], 2) if said["bits"] else int(said["decimal"]))


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
