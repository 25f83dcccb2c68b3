"""A batch's rows as JSON lines, and frames as JSON objects.

Lines are set thousands at once as pieces in one array, and joined. Objects are for who asks frame by frame: in order,
they are set as lines many at once and read back. Who asks here and there, or once, gets each frame annotated by itself:
None says so.
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

from ...tables.batch import Batch
from ...tables.columns import Pdus
from ...tables.schema import Kind, Rows
from .blocks import fields
from .envelope import HEAD, TAIL, Envelope, Whole, noise_json
from .forms import BatchBytes, Forms, Group, kept
from .pieces import Ints, Store, encoded, parted
from .sheet import Sheet

_VALUE: Final = b'%d,"raw":"%02x%02x","text":"'  # `middle` of a check value, whose low byte comes first
_CHECK: Final = 2  # bytes of it
_AROUND: Final = 4  # pieces around a form's: unit and function before, the check value's two behind


class FrameJsonLines:
    """Frames as lines of JSON, with `noise` the stretches between them too; `explain` as `explain_json` has it."""

    def __init__(self, *, explain: bool = False, noise: bool = False) -> None:
        self._noise = noise
        self._store = Store()
        self._envelope = Envelope(self._store, explain)
        self._forms = Forms(partial(fields, self._store))
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
        sizes = np.where(silent, 1, HEAD + 1 + TAIL)
        source = BatchBytes.of(self._pdus, spoken)
        groups = self._forms.groups(rows, row_numbers, source)
        for group in groups:
            sizes[group.lines] = HEAD + _AROUND + group.sizes() + TAIL
        sheet = Sheet(self._store, sizes)
        sheet.at(np.flatnonzero(silent)).put_texts([_noise(batch, row) for row in row_numbers[silent].tolist()])
        self._envelope.put_head(spoken, row_numbers[frames], source, sheet.at(frames))
        self._envelope.put_tail(spoken, row_numbers[frames], batch, sheet.before_end(frames, TAIL))
        self._put_fields(groups, rows, row_numbers, source, sheet)
        return sheet.parts()

    def _put_fields(self, groups: list[Group], rows: Rows, row_numbers: Ints, source: BatchBytes, sheet: Sheet) -> None:
        """All fields: those of the groups by pieces, the others' frame by frame."""
        for group in groups:
            group.put(source, sheet.at(group.lines, HEAD + 2))
        formed = np.concatenate([np.zeros(0, np.int64), *(group.lines for group in groups)])
        self._put_around(rows, formed, source, sheet)
        unformed = rows.kind != Kind.NOISE
        unformed[formed] = False
        frames = (source.pdus.batch.frame(row) for row in row_numbers[unformed].tolist())
        texts = [b'","fields":' + self._field_texts.text(frame) for frame in frames]
        sheet.at(np.flatnonzero(unformed), HEAD).put_texts(texts)

    def _put_around(self, rows: Rows, formed: Ints, source: BatchBytes, sheet: Sheet) -> None:
        """Unit and function, and the check value, of RTU frames."""
        begins, lengths = rows.at[formed], rows.length[formed]
        head, tail = sheet.at(formed, HEAD), sheet.before_end(formed, TAIL + 2)
        head.put(self._unit.take(source.octets(begins)))
        kind = rows.kind[formed].astype(np.int64)
        head.put(self._function.take(kind << 8 | source.octets(begins + 1)))
        at = lengths - _CHECK
        tail.put(self._check_offset.take(at))
        at += begins
        checks = self._check_value.take(source.octets(at) | source.octets(at + 1) << 8)
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
