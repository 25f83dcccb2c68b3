"""Frames written a byte or a field a line, or field by field in one line, found by their check values."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate, groupby, pairwise, takewhile
from typing import Final, NamedTuple

from .candidates import H, Writing
from .choosing import ByteRun, Checked, Experience, Judge, label_in
from .loglines import LogLine
from .othershapes import unescape
from .rows import is_ruler

COLUMN_SHAPE: Final = "column"
JOINED: Final = "joined"  # how numbers of a column are read, besides as hex or decimal bytes
_BETWEEN: Final = (" ", "  ", ", ")  # bytes of one field
MOST_ROWS: Final = 600  # of one column, or of one array
_FRAME: Final = 260  # bytes
_LEAST: Final = 3  # bytes: fewer are no frame
_FEW: Final = 4  # bytes, up to which numbers beside one another may look like them
_COLUMN: Final = 4  # lines, or fields, that can hold a frame a byte each
_MOST_COLUMNS: Final = 4  # from either side of a line
_STEP: Final = 16  # rows at which a judge, shown the column from one on, looks for frames
_TOKEN: Final = re.compile(
    r"b(?P<quote>['\"])(?P<char>\\x[0-9a-f]{2}|\\?[^\\])(?P=quote)|"
    rf"(?<![\w.^])(?<!\(M-)(?!(?<=\s\().\))(?:(?P<sign>0[xX]|(?:[A-Z]+#)?16#|\$)(?P<signed>{H}{{1,2}}(?!{H})|(?:{H}{{2}}){{2,256}})|(?P<plain>-?\d{{1,3}}|{H}{{1,2}}|(?:{H}{{2}}){{2,256}})[hH]?)"
    r"(?!\w|\.\d|=\s*\w)"
)
_FIELD: Final = re.compile(rf"(?<![\w.])(?:0[xX])?{H}{{2,512}}[hH]?(?!\w)")
_LETTERS: Final = re.compile(r"[g-zG-Z]")
_FIELDS: Final = 3  # names that make a list of a frame's fields
_COUNTED: Final = "[0]= [1]= [2]="  # lines of bytes with their numbers, whatever their length
_OCTETS: Final = "b'' b'' b''"
_IN_DECIMAL: Final = -1
_PATIENCE: Final = 3000  # rows of numbers without a frame, after which none is looked for in the columns of a text
_LONGEST_ROW: Final = 2048  # characters
_REMEMBERED: Final = 512  # lines, as logs repeat themselves
_NUMBER: Final = re.compile(  # with the character that it is: 'k', (k), (^A), (M-1)
    rf"0[xX]{H}+|(?<![^\W_])(?:{H}{{1,4}}|(?=[A-Fa-f]*\d){H}+)[hH]?(?![^\W_])|\d+|'(?:\\x{H}{{2}}|\\?[^'])'|(?<=\s)\((?:M-\d{{0,3}})?\^?\S?\)"
)


def settle_columns(lines: Sequence[LogLine], judge: Judge, experience: Experience) -> None:
    """Frames written a byte or a field a line, or field by field in one line, found by their check values."""
    group: list[LogLine] = []
    for line in [*lines, None]:
        if line is not None and ((line.clean.strip() == "" and not line.runs) or _is_ruler(line)):
            continue
        if line is not None and not line.is_known and not _is_right(line) and _TOKEN.search(line.clean) is not None:
            named = not _holds_bytes(line) or _LETTERS.search(line.clean) is not None
            _fields_of(line, _tokens(line), judge, experience, named=named)
            if not _holds_bytes(line) or (group and named):
                group.append(line)
                if len(group) < MOST_ROWS:
                    continue
        if group:
            _column_of(group, judge, experience)
        group = []


def _is_ruler(line: LogLine) -> bool:
    tokens = _tokens(line)
    return is_ruler([token.digits for token in tokens]) and not any(token.signed for token in tokens)


def _is_right(line: LogLine) -> bool:
    return any(run.taken and (run.checked or run.sure) for run in line.runs)


def _holds_bytes(line: LogLine) -> bool:
    return any(run.taken and (len(run.data) > _FEW or run.checked or run.sure) for run in line.runs)


class _Token(NamedTuple):
    """A number of one byte, or of several in hex; `signed` where a sign before it says that it is hex.

    `octet`: Python's `b'k'`, which says what byte it is.
    """

    start: int
    end: int
    digits: str
    signed: bool
    octet: bytes | None = None

    @property
    def is_name(self) -> bool:
        """`FC`: what a function code is called."""
        return self.digits.upper() == "FC" and not self.signed

    @property
    def hexadecimal(self) -> bytes | None:
        """The bytes that it is in hex."""
        digits = self.digits
        if self.octet is not None:
            return self.octet
        if digits[0] == "-" or len(digits) == 3:
            return None
        return bytes.fromhex(digits if len(digits) % 2 == 0 else f"0{digits}")

    def value(self, reading: str) -> bytes | None:
        """The bytes that it is."""
        return self.decimal if reading == "decimal" else self.hexadecimal

    @property
    def decimal(self) -> bytes | None:
        """The byte that it is in decimal."""
        digits = self.digits
        if self.signed or not digits.lstrip("-").isdigit() or not -129 < int(digits) < 256:
            return None
        return bytes((int(digits) & 0xFF,))


def _tokens(line: LogLine, reading: str = "") -> Sequence[_Token]:
    """The numbers of a line; those of one field as one where they are read `JOINED`."""
    if len(line.clean) > _LONGEST_ROW:
        return ()
    return _joined_in(line.clean) if reading == JOINED else _tokens_in(line.clean)


@lru_cache(_REMEMBERED)
def _joined_in(text: str) -> tuple[_Token, ...]:
    """`Starting address: 00 6B`: bytes beside one another as one number."""
    joined: list[_Token] = []
    for token in _tokens_in(text):
        before = joined[-1] if joined else None
        if (
            before is not None
            and before.signed == token.signed
            and len(token.digits) == 2
            and len(before.digits) % 2 == 0
            and text[before.end : token.start] in _BETWEEN
            and token.hexadecimal is not None
        ):
            joined[-1] = before._replace(end=token.end, digits=before.digits + token.digits)
        else:
            joined.append(token)
    return tuple(joined)


@lru_cache(_REMEMBERED)
def _tokens_in(text: str) -> tuple[_Token, ...]:
    return tuple(
        _Token(
            match.start(),
            match.end(),
            match["signed"] or match["plain"] or "",
            match["sign"] is not None,
            None if match["char"] is None else unescape(match["char"]),
        )
        for match in _TOKEN.finditer(text)
    )


def _fields_of(line: LogLine, tokens: Sequence[_Token], judge: Judge, experience: Experience, *, named: bool) -> None:
    """`ID=01 FC=03 ADDR=0000 LEN=000A CRC=C5CD`, `ID 01 | FC 03 | 00 00 00 0A | CRC C5 CD`

    Only of fields that are `named` one may be a name. Lines like one that was a frame are read as it was.
    """
    counted = _counted(tokens)
    octets = sum(token.octet is not None for token in tokens)
    if counted is not None:
        tokens = counted
        values = [token.decimal for token in tokens]
        data = b"" if None in values else b"".join(filter(None, values))
        right = len(data) > _LEAST and _exactly(data, judge)
        if right or (data and experience.fields.get(_COUNTED) == _IN_DECIMAL):
            _take_tokens(line, tokens, data, checked=right)
            experience.fields.setdefault(_COUNTED, _IN_DECIMAL)
            return
    elif len(_FIELD.findall(line.clean)) < _COLUMN and octets < _COLUMN:
        return
    plain = [token for token in tokens if not token.is_name]
    ways = (tokens, tokens[1:], plain, plain[1:])
    readings = [_in_hex(some) for some in (ways if named else ways[:1])]
    skeleton = _COUNTED if counted is not None else _OCTETS if octets == len(tokens) else _skeleton(line)
    for i, (some, data) in enumerate(zip(ways, readings, strict=False)):
        if _LEAST < len(data) <= _FRAME and _exactly(data, judge):
            _take_tokens(line, some, data)
            experience.fields.setdefault(skeleton, i)
            return
    known = experience.fields.get(skeleton, len(ways))
    if 0 <= known < len(readings) and _LEAST < len(data := readings[known]) <= _FRAME:
        _take_tokens(line, ways[known], data, checked=False)


def _in_hex(tokens: Sequence[_Token]) -> bytes:
    """The bytes that these are in hex; none where one is no byte."""
    parts = [token.hexadecimal for token in tokens]
    return b"" if None in parts else b"".join(part for part in parts if part)


def _counted(tokens: Sequence[_Token]) -> Sequence[_Token] | None:
    """The values of `[0]=01 [1]=03`, `0:0x01 1:0x03`; None of other lines."""
    if len(tokens) < 2 * _COLUMN or len(tokens) % 2:
        return None
    for first in (0, 1):
        if [token.digits for token in tokens[::2]] == [str(i) for i in range(first, first + len(tokens) // 2)]:
            return tokens[1::2]
    return None


def _exactly(data: bytes, judge: Judge) -> bool:
    """Whether frames with right check values are all of these bytes."""
    return sum(span.end - span.start for span in judge(data)) == len(data)


def _column_of(lines: list[LogLine], judge: Judge, experience: Experience) -> None:
    """One number of each line, always the same one, where those are frames.

    Of lines that are alike first, whether one below the other or with others between; then of all.
    """
    adjacent = [list(same) for _, same in groupby(lines, _skeleton)]
    apart: dict[str, list[LogLine]] = {}
    for line in lines:
        apart.setdefault(_skeleton(line), []).append(line)
    tried = {tuple(map(id, alike)) for alike in adjacent}
    for alike in (*adjacent, *(some for some in apart.values() if tuple(map(id, some)) not in tried)):
        skeleton = _skeleton(alike[0])
        if skeleton in experience.columns:
            _take_column(alike, *experience.columns[skeleton])
        elif experience.in_vain > _PATIENCE:
            continue
        elif (found := _one_column(alike, judge, alike=True)) is not None:
            experience.columns[skeleton] = found
    if 2 * _taken(lines) < len(lines) and experience.in_vain <= _PATIENCE:
        found = _one_column(lines, judge, alike=False)
        signs = {skeleton for line in lines if not any(map(str.isalpha, skeleton := _skeleton(line)))}
        if found is not None:
            experience.numbers.update(dict.fromkeys(signs, found))
            inside = {_skeleton(line) for line in lines if _taken([line])}
            experience.named.update(dict.fromkeys(inside - signs - set(experience.columns), found))
    _take_known(lines, experience)
    if _taken(lines):
        experience.in_vain = 0
    elif experience.in_vain <= _PATIENCE:
        experience.in_vain += len(lines)


def _take_known(lines: Sequence[LogLine], experience: Experience) -> None:
    """Lines like those of frames are read as those were, though their check value is wrong.

    Where most fields of a frame are known by their names, so are those between. A name that comes again begins a frame.
    """
    names = [_skeleton(line) for line in lines]
    known = [experience.numbers.get(name) or experience.named.get(name) for name in names]
    fields = {name for name, way in zip(names, known, strict=True) if way is not None and any(map(str.isalpha, name))}
    ways = {way for way in known if way is not None}
    if len(ways) == 1 and len(fields) >= _FIELDS and 2 * sum(way is not None for way in known) > len(lines):
        known = [*ways] * len(lines)
    named: set[str] = set()
    for i, (line, name, way) in enumerate(zip(lines, names, known, strict=True)):
        if way is None or _taken([line]) or _holds_bytes(line):
            continue
        _take_column([line], *way)
        line.continues = i > 0 and name in fields - named and _taken([lines[i - 1]]) > 0
        named = named | {name} if line.continues else {name}


def _taken(lines: Sequence[LogLine]) -> int:
    """How many of these lines are bytes of a column."""
    return sum(any(run.taken and run.shape == COLUMN_SHAPE for run in line.runs) for line in lines)


def _skeleton(line: LogLine) -> str:
    """A line without its numbers and the characters that they are."""
    return _skeleton_of(line.clean)


@lru_cache(_REMEMBERED)
def _skeleton_of(text: str) -> str:
    return " ".join(_NUMBER.sub("", text).split())


def _one_column(lines: list[LogLine], judge: Judge, *, alike: bool) -> tuple[int, str] | None:
    """Which number of each line is a byte of frames, and how it is read; the lines of those frames are taken.

    Of lines `alike` what stands between two frames is taken, too.
    """
    if len(lines) < _COLUMN:
        return None
    tried: list[list[bytes | None]] = []  # of lines with as many numbers each, every column comes twice
    best: tuple[int, int, str, list[int]] | None = None  # that of the most lines
    for reading in ("hexadecimal", "decimal", JOINED):
        table = [() if reading != JOINED and _holds_bytes(line) else _tokens(line, reading) for line in lines]
        fewest = min(max(map(len, table)), _MOST_COLUMNS)
        for i in (*range(-1, -1 - fewest, -1), *range(fewest)):
            parts = [tokens[i].value(reading) if -len(tokens) <= i < len(tokens) else None for tokens in table]
            if parts in tried:
                continue
            tried.append(parts)
            inside = _inside_frames(parts, judge)
            rows = len(inside) - inside.count(0)
            if rows and (best is None or rows > best[0]):
                best = rows, i, reading, inside
    if best is None:
        return None
    _, i, reading, inside = best
    rows_inside = [row for row, frame in enumerate(inside) if frame]
    first, last = rows_inside[0], rows_inside[-1] + 1
    above: tuple[int, LogLine] = (0, lines[0])
    for frame, line in zip(inside[first:last], lines[first:last], strict=True):
        tokens = _tokens(line, reading)
        part = tokens[i].value(reading) if -len(tokens) <= i < len(tokens) else None
        if part is not None and (alike or frame):
            _take_tokens(line, [tokens[i]], part)
            line.continues = frame > 0 and above[0] == frame and above[1].t_ns == line.t_ns
            above = frame, line
    return i, reading


def _inside_frames(parts: Sequence[bytes | None], judge: Judge) -> list[int]:
    """Which of these parts make up frames that begin and end with parts: the frame's number from 1 on, or 0."""
    inside = [0] * len(parts)
    frames = 0
    row = 0
    while row < len(parts):
        some = list(takewhile(lambda part: part is not None, parts[row : row + _FRAME]))
        starts = [0, *accumulate(len(part) for part in some if part is not None)]
        spans = [span for span in judge(b"".join(part for part in some if part)) if {span.start, span.end} <= {*starts}]
        for span in spans:
            frames += 1
            for k in range(starts.index(span.start), starts.index(span.end)):
                inside[row + k] = frames
        row += starts.index(spans[-1].end) if spans else min(len(some), _STEP) + 1
    return inside


def _take_column(lines: list[LogLine], i: int, reading: str) -> None:
    for line in lines:
        tokens = _tokens(line, reading)
        token = tokens[i] if -len(tokens) <= i < len(tokens) else None
        if token is not None and (part := token.value(reading)) is not None:
            _take_tokens(line, [token], part)


def _take_tokens(line: LogLine, tokens: Sequence[_Token], data: bytes, *, checked: bool = True) -> None:
    start, end = tokens[0].start, tokens[-1].end
    mark = next((run.mark for run in line.runs if run.mark), 0)
    label = label_in(line.clean[max(start - 56, 0) : start])
    run = ByteRun(data, start, end, COLUMN_SHAPE, Writing.NUMBER, label, mark, taken=True)
    run.checked = (Checked(0, len(data)),) if checked else ()
    line.runs, line.problem = [run], None


def settle_unchecked(lines: Sequence[LogLine], experience: Experience) -> None:
    """A byte or a field a line without a check value behind them.

    Lines of nothing but one or two hex digits; and, where a text holds nothing that is plainer, bytes beside what each
    means: `0x01 -> unit`. Numbers that only rise or fall count something, and are none.
    """
    for _, same in groupby(lines, lambda line: bool(_tokens(line)) and not _is_right(line) and not _holds_bytes(line)):
        group = list(same)
        table = [_tokens(line, JOINED) for line in group]
        if len(group) < _COLUMN or not all(table):
            continue
        bare = all(tokens[0].digits == line.clean.strip() for line, tokens in zip(group, table, strict=True))
        named = _are_numbered(table) or len({_skeleton(line) for line in group}) >= _FIELDS
        if not bare and not (experience.meanings and named):
            continue
        for i in (0, -1):
            column = [tokens[i] for tokens in table]
            parts = [token.hexadecimal for token in column]
            if None not in parts and _are_written_as_bytes(column, bare=bare) and not _counts_on(parts):
                for line, token, part in zip(group, column, parts, strict=True):
                    _take_tokens(line, [token], part or b"", checked=False)
                    line.continues = line is not group[0] and line.t_ns == group[0].t_ns
                break


def _are_numbered(table: Sequence[Sequence[_Token]]) -> bool:
    """Whether lines begin with their numbers, from 0 or 1 on."""
    numbers = [tokens[0].digits for tokens in table if len(tokens) > 1]
    return any(numbers == [*map(str, range(first, first + len(table)))] for first in (0, 1))


def _are_written_as_bytes(column: Sequence[_Token], *, bare: bool) -> bool:
    if any(token.is_name or len(token.digits) > 2 * _FEW for token in column):
        return False
    if bare:
        return all(len(token.digits) < 3 for token in column) and any(_plainly_hex(token) for token in column)
    if all(token.signed for token in column):
        return True
    wide = all(len(token.digits) % 2 == 0 and not token.signed for token in column)
    return wide and 2 * sum(_plainly_hex(token) for token in column) >= len(column)


def _plainly_hex(token: _Token) -> bool:
    return len(token.digits) > 1 and (token.digits[0] == "0" or not token.digits.isdigit())


def _counts_on(parts: Sequence[bytes | None]) -> bool:
    values = [int.from_bytes(part or b"", "big") for part in parts]
    steps = [later - earlier for earlier, later in pairwise(values)]
    return min(steps) >= 0 or max(steps) <= 0
