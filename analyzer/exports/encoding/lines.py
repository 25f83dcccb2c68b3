"""A batch's rows as JSON lines, and frames as JSON objects.

Lines are set thousands at once as pieces in one array, and joined: columns before the fields; behind them what the
frame speaks of, confidence and findings. Objects are for who asks frame by frame: in order, they are set as lines many
at once and read back. Who asks here and there, or once, gets each frame annotated by itself: None says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, Final

import numpy as np
import orjson

from dissectors.annotation import check_fields, function_field, header_fields
from dissectors.envelopes import Adu, rtu
from dissectors.fields import Field
from dissectors.length_rules import Role

from ...tables.batch import Batch, Frame, adu_of, response_time_json
from ...tables.columns import Pdus
from ...tables.schema import Direction, Kind, Protocol, Row, Rows
from .forms import BatchBytes, Forms, Group, Whole, kept
from .nested_fields import form_fields
from .sheet import Cursor, Ints, Sheet, Store, encoded, parted
from .spoken import Speaking

HEAD: Final = 15  # pieces before the fields
TAIL: Final = 2  # pieces at the line's end
_HEX: Final = b',"hex":"'
_OWN: Final = b',"taken_for_start":null,"unsure":false,"response_time_ns":'
_NO_CHECK: Final = 2  # in a key: beside 0 and 1, whether the check value is right


class Envelope:
    """The pieces of envelopes."""

    def __init__(self, store: Store, explain: bool) -> None:
        self._store = store
        self._explain = explain
        self._length = store.table(lambda length: b',"length":%d,"t_start_ns":' % length)
        self._unit = store.table(self._units)
        self._function = store.table(self._functions)
        self._confidence = store.table(self._confidences)
        self._end = store.table(lambda port: _end(_frame(port=port).to_json(fields=False)))

    def put_head(self, rows: Rows, row_numbers: Ints, source: BatchBytes, cursor: Cursor) -> None:
        """`HEAD` pieces of each of these rows of a batch, `"hex"` the last of them, its quote not closed."""
        cursor.put(b'{"index":')
        cursor.put_numbers(rows.index)
        cursor.put(b',"start":')
        cursor.put_numbers(rows.start)
        cursor.put(self._length.take_pieces(rows.length))
        cursor.put_numbers(rows.t_start_ns)
        cursor.put(b',"t_end_ns":')
        cursor.put_numbers(rows.t_end_ns)
        kind, protocol, unit = (rows.column(name).astype(np.int64) for name in ("kind", "protocol", "unit"))
        cursor.put(self._unit.take_pieces(kind << 10 | protocol << 8 | unit))
        function, exception, check = (rows.column(name).astype(np.int64) for name in ("function", "exception", "check"))
        check[protocol == Protocol.TCP] = _NO_CHECK
        cursor.put(self._function.take_pieces(function << 10 | exception << 2 | check))
        cursor.put_known(rows.request_start, b"null")
        self._put_response_times(source.pdus.batch, row_numbers, cursor)
        plain = protocol != Protocol.ASCII
        texts = np.empty(len(rows), np.int64)
        texts[plain] = source.hex(rows.at[plain], rows.length[plain], cursor.sheet)
        captured = ((source.pdus.batch.bytes_of(int(row)), Protocol.ASCII) for row in row_numbers[~plain])
        texts[~plain] = cursor.sheet.texts([adu_of(*each).data.hex().encode() for each in captured])
        cursor.put(texts)

    def _put_response_times(self, batch: Batch, row_numbers: Ints, cursor: Cursor) -> None:
        exact, low, high = (column[row_numbers] for column in batch.response_times)
        cursor.put(self._owners(batch.rows, row_numbers, cursor))
        cursor.put_known(exact, b"null")
        behind = np.full(len(exact), self._store.fixed(_HEX), np.int64)
        bounded = np.flatnonzero((exact < 0) & (low >= 0))
        if len(bounded):
            bounds = zip(low[bounded].tolist(), high[bounded].tolist(), strict=True)
            behind[bounded] = cursor.sheet.texts([_bounded(each) for each in bounds])
        cursor.put(behind)

    def _owners(self, rows: Rows, row_numbers: Ints, cursor: Cursor) -> Ints:
        """Whose answers the client takes these for, where that is another's, or nobody can tell whose they are."""
        texts = np.full(len(row_numbers), self._store.fixed(_OWN), np.int64)
        taken, unsure = rows.taken_for_start[row_numbers], rows.unsure[row_numbers]
        odd = np.flatnonzero((taken >= 0) | unsure)
        if len(odd):
            pairs = zip(taken[odd].tolist(), unsure[odd].tolist(), strict=True)
            texts[odd] = cursor.sheet.texts([_owner(*pair) for pair in pairs])
        return texts

    def put_tail(self, rows: Rows, row_numbers: Ints, batch: Batch, cursor: Cursor) -> None:
        """`TAIL` pieces of each row: the line's end is the last of them."""
        cursor.put(self._confidence.take_pieces(rows.confidence.view(np.uint32).astype(np.int64)))
        ends = self._end.take_pieces(rows.port.astype(np.int64))
        special = np.arange(len(rows)) if self._explain else np.flatnonzero(batch.finding_counts[row_numbers])
        if len(special):
            ends[special] = cursor.sheet.texts([self._special(batch, row) for row in row_numbers[special].tolist()])
        cursor.put(ends)

    def _special(self, batch: Batch, row: int) -> bytes:
        line: dict[str, Any] = {"findings": [finding.to_json() for finding in batch.findings_of(row)]}
        if port := int(batch.rows.port[row]):
            line["port"] = port
        if self._explain:
            line["explain"] = explain_json(batch.frame(row))
        return _end(line)

    @staticmethod
    def _units(key: int) -> bytes:
        line = _json(_frame(kind=key >> 10, protocol=key >> 8 & 3, unit=key & 0xFF))
        return line[line.index(b',"protocol":') : line.index(b',"function":')]

    @staticmethod
    def _functions(key: int) -> bytes:
        protocol = Protocol.TCP if key & _NO_CHECK else Protocol.RTU
        columns = {"exception": key >> 2 & 0xFF, "check": bool(key & 1), "protocol": protocol}
        line = _json(_frame(function=key >> 10, **columns))
        return line[line.index(b',"function":') : line.index(b'null,"taken_for_start":')]

    @staticmethod
    def _confidences(key: int) -> bytes:
        line = _json(_frame(confidence=float(np.uint32(key).view(np.float32))))
        return line[line.index(b',"confidence":') : -len(b"[]}")]


def _frame(**columns: Any) -> Frame:
    """A frame of which only some columns matter."""
    plain = dict.fromkeys(Row.__slots__, 0) | {
        "request": -1,
        "request_start": -1,
        "response_ns": -1,
        "taken_for_start": -1,
        "unsure": False,
        "kind": Kind.REQUEST,
    }
    return Frame(Row(**plain | columns), b"")


def _json(frame: Frame) -> bytes:
    return orjson.dumps(frame.to_json(fields=False))


def _owner(taken_for_start: int, unsure: bool) -> bytes:
    """The same of an answer that is displaced, or may be."""
    taken = b"null" if taken_for_start < 0 else b"%d" % taken_for_start
    return b',"taken_for_start":%s,"unsure":%s,"response_time_ns":' % (taken, b"true" if unsure else b"false")


def _bounded(bounds_ns: tuple[int, int]) -> bytes:
    """From behind a response time that is not exact on."""
    line = orjson.dumps(response_time_json(bounds_ns))
    return line[line.index(b",") : -1] + _HEX


def _end(line: dict[str, Any]) -> bytes:
    """A line from the findings on."""
    tail = {key: line[key] for key in ("findings", "port", "explain") if key in line}
    return orjson.dumps(tail, option=orjson.OPT_APPEND_NEWLINE)[len(b'{"findings":') :]


def noise_json(batch: Batch, row: int) -> dict[str, Any]:
    """A stretch of noise as a mapping."""
    values = batch.rows.row(row)
    line = {
        "kind": "noise",
        "start": values.start,
        "length": values.length,
        "t_start_ns": values.t_start_ns,
        "t_end_ns": values.t_end_ns,
        "hex": batch.bytes_of(row).hex(),
    }
    if values.port:
        line["port"] = values.port
    if findings := batch.findings_of(row):
        line["findings"] = [finding.to_json() for finding in findings]
    return line


def explain_json(frame: Frame) -> dict[str, Any] | None:
    """Why the frame's boundaries stand where they do, in bits, and what would stand there instead."""
    evidence = frame.evidence
    if evidence is None:
        return None
    weights: dict[str, Any] = {
        key: round(float(evidence.column(key)[0]), 2) for key in ("length", "crc", "silence", "conversation", "margin")
    }
    kind = Kind(int(evidence.rival_kind[0]))
    if evidence.rival_start[0] < 0 or kind == Kind.NOISE:
        weights["runner_up"] = {"start": None, "length": None, "kind": "noise"}
    else:
        start, length = int(evidence.rival_start[0]), int(evidence.rival_length[0])
        weights["runner_up"] = {"start": start, "length": length, "kind": Direction(kind).name}
    return weights


_VALUE: Final = b'%d,"raw":"%02x%02x","text":"'  # `middle` of a check value, whose low byte comes first
_CHECK: Final = 2  # bytes of it
_AROUND: Final = 4  # pieces around a form's: unit and function before, the check value's two behind


class FrameJsonLines:
    """Frames as lines of JSON, with `noise` the stretches between them too; `explain` as `explain_json` has it."""

    def __init__(self, *, explain: bool = False, noise: bool = False) -> None:
        self._noise = noise
        self._store = Store()
        self._envelope = Envelope(self._store, explain)
        self._speaking = Speaking(self._store)
        self._forms = Forms(partial(form_fields, self._store))
        self._field_texts = Whole(lambda frame: encoded([field.to_json() for field in frame.fields()]))
        self._unit = self._store.table(
            lambda unit: b'","fields":[' + encoded(header_fields(rtu(bytes([unit])))[0].to_json())
        )
        self._function = self._store.table(_function)
        self._check_offset = self._store.table(lambda at: b"," + parted(_check(at, 0))[0])
        self._ok = _VALUE + (b"".join(parted(_check(0, 0))[2:]) + b"]").replace(b"%", b"%%")
        self._check_value = self._store.table_of_many(self._right)
        self._pdus: Pdus | None = None

    def text(self, batch: Batch, first: int, last: int) -> Iterator[memoryview]:
        """The lines of rows `first` to `last` (excluded), in parts; take them before asking for more."""
        self._store.settle()
        if self._pdus is None or self._pdus.batch is not batch:
            self._pdus = Pdus(batch)
        row_numbers, rows = kept(batch, first, last, noise=self._noise)
        silent = rows.kind == Kind.NOISE
        frames = np.flatnonzero(~silent)
        spoken = rows if len(frames) == len(rows) else rows[frames]
        source = BatchBytes.of(self._pdus, spoken)
        groups = self._forms.groups(rows, row_numbers, source)
        speech = self._speaking.of(rows, row_numbers, source)
        sizes = np.where(silent, 1, HEAD + 1 + TAIL) + speech.sizes
        for group in groups:
            sizes[group.lines] += _AROUND + group.sizes() - 1
        sheet = Sheet(self._store, sizes)
        sheet.at(np.flatnonzero(silent)).put_texts([_noise(batch, row) for row in row_numbers[silent].tolist()])
        self._envelope.put_head(spoken, row_numbers[frames], source, sheet.at(frames))
        self._envelope.put_tail(spoken, row_numbers[frames], batch, sheet.before_end(frames, TAIL))
        self._speaking.put(speech, TAIL, rows, row_numbers, source, sheet)
        self._put_fields(groups, speech.sizes, rows, row_numbers, source, sheet)
        return sheet.parts()

    def _put_fields(
        self, groups: list[Group], behind: Ints, rows: Rows, row_numbers: Ints, source: BatchBytes, sheet: Sheet
    ) -> None:
        """All fields: those of the groups by pieces, the others' frame by frame; `behind`: pieces before the tail."""
        for group in groups:
            group.put(source, sheet.at(group.lines, HEAD + 2))
        formed = np.concatenate([np.zeros(0, np.int64), *(group.lines for group in groups)])
        self._put_around(rows, formed, behind, source, sheet)
        unformed = rows.kind != Kind.NOISE
        unformed[formed] = False
        frames = (source.pdus.batch.frame(row) for row in row_numbers[unformed].tolist())
        texts = [b'","fields":' + self._field_texts.text(frame) for frame in frames]
        sheet.at(np.flatnonzero(unformed), HEAD).put_texts(texts)

    def _put_around(self, rows: Rows, formed: Ints, behind: Ints, source: BatchBytes, sheet: Sheet) -> None:
        """Unit and function, and the check value, of RTU frames."""
        begins, lengths = rows.at[formed], rows.length[formed]
        head, tail = sheet.at(formed, HEAD), sheet.before_end(formed, TAIL + 2 + behind[formed])
        head.put(self._unit.take_pieces(source.octets(begins)))
        kind = rows.kind[formed].astype(np.int64)
        head.put(self._function.take_pieces(kind << 8 | source.octets(begins + 1)))
        at = lengths - _CHECK
        tail.put(self._check_offset.take_pieces(at))
        at += begins
        checks = self._check_value.take_pieces(source.octets(at) | source.octets(at + 1) << 8)
        wrong = np.flatnonzero(~rows.check[formed])
        if len(wrong):
            spans = zip(begins[wrong].tolist(), lengths[wrong].tolist(), strict=True)
            frames = (source.pdus.data[begin : begin + length].tobytes() for begin, length in spans)
            checks[wrong] = sheet.texts([_rest(check_fields(rtu(frame), len(frame) - _CHECK)[0]) for frame in frames])
        tail.put(checks)

    def _right(self, checks: list[int]) -> list[bytes]:
        text = self._ok
        return [text % (crc, crc & 0xFF, crc >> 8) for crc in checks]


def _rest(check: Field) -> bytes:
    """A check value's field behind its place, and the end of the fields."""
    return b"".join(parted(check)[1:]) + b"]"


def _function(key: int) -> bytes:
    role = Role.REQUEST if key >> 8 == Kind.REQUEST else Role.RESPONSE
    return b"," + encoded(function_field(bytes([0, key & 0xFF]), 1, role).to_json())


def _check(at: int, crc: int) -> Field:
    """The field of a right CRC."""
    data = bytes(at) + crc.to_bytes(_CHECK, "little")
    return check_fields(Adu("rtu", data, 0, b"", True, crc, crc, 0, len(data)), at)[0]


def _noise(batch: Batch, row: int) -> bytes:
    return orjson.dumps(noise_json(batch, row), option=orjson.OPT_APPEND_NEWLINE)


_IN_ORDER: Final = 4  # frames asked for in order, after which the next ones are made ready
_STEP: Final = 8  # rows from one to the next that still are in order
_FEWEST, _MOST = 16, 1024  # rows made ready at once


class FramesAhead:
    """The JSON objects of frames, batch after batch."""

    def __init__(self) -> None:
        self._lines = FrameJsonLines()
        self._batch: Batch | None = None
        self._ready: dict[int, bytes] = {}  # by row
        self._before = 0  # the row asked for last
        self._in_order = 0
        self._more = _FEWEST

    def of(self, batch: Batch, row: int) -> dict[str, Any] | None:
        """That of a row that is a frame; None where it is not worth while to make more than this one."""
        if batch is not self._batch:
            self._batch, self._ready, self._before, self._in_order = batch, {}, -1, self._in_order and _IN_ORDER
        follows = 0 <= row - self._before <= _STEP
        self._before = row
        line = self._ready.get(row)
        if line is None:
            self._in_order = self._in_order + 1 if follows else 0
            if self._in_order <= _IN_ORDER:
                self._more = _FEWEST
                return None
            line = self._line_of(batch, row, min(row + self._more, len(batch)))
            self._more = min(2 * self._more, _MOST)
        decoded: dict[str, Any] = orjson.loads(line)
        return decoded

    def _line_of(self, batch: Batch, first: int, last: int) -> bytes:
        """The line of row `first`; those up to `last` (excluded) are ready."""
        text = b"".join(self._lines.text(batch, first, last))
        rows = first + np.flatnonzero(batch.rows.kind[first:last] != Kind.NOISE)
        self._ready = dict(zip(rows.tolist(), text.splitlines(), strict=True))
        return self._ready[first]
