"""What stands around the fields in a frame's JSON line: columns before them, confidence and findings behind them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import orjson

from ...tables.batch import Batch
from ...tables.frame import Frame, adu_of
from ...tables.schema import Direction, Kind, Protocol, Row, Rows
from .forms import BatchBytes
from .pieces import Ints, Store
from .sheet import Cursor

HEAD: Final = 15  # pieces before the fields
TAIL: Final = 2  # pieces behind them
_NO_CHECK: Final = 2  # in a key: beside 0 and 1, whether the check value is right


class Envelope:
    """The pieces of envelopes."""

    def __init__(self, store: Store, explain: bool) -> None:
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
        cursor.put(self._length.take(rows.length))
        cursor.put_numbers(rows.t_start_ns)
        cursor.put(b',"t_end_ns":')
        cursor.put_numbers(rows.t_end_ns)
        kind, protocol, unit = (rows.column(name).astype(np.int64) for name in ("kind", "protocol", "unit"))
        cursor.put(self._unit.take(kind << 10 | protocol << 8 | unit))
        function, exception, check = (rows.column(name).astype(np.int64) for name in ("function", "exception", "check"))
        check[protocol == Protocol.TCP] = _NO_CHECK
        cursor.put(self._function.take(function << 10 | exception << 2 | check))
        cursor.put_known(rows.request_start, b"null")
        cursor.put(b',"response_time_ns":')
        cursor.put_known(np.where(rows.request_start >= 0, rows.response_ns, -1), b"null")
        cursor.put(b',"hex":"')
        plain = protocol != Protocol.ASCII
        texts = np.empty(len(rows), np.int64)
        texts[plain] = source.hex(rows.at[plain], rows.length[plain], cursor.sheet)
        captured = ((source.pdus.batch.bytes_of(int(row)), Protocol.ASCII) for row in row_numbers[~plain])
        texts[~plain] = cursor.sheet.texts([adu_of(*each).data.hex().encode() for each in captured])
        cursor.put(texts)

    def put_tail(self, rows: Rows, row_numbers: Ints, batch: Batch, cursor: Cursor) -> None:
        """`TAIL` pieces of each row: the line's end is the last of them."""
        cursor.put(self._confidence.take(rows.confidence.view(np.uint32).astype(np.int64)))
        ends = self._end.take(rows.port.astype(np.int64))
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
        return line[line.index(b',"function":') : line.index(b'null,"response_time_ns":')]

    @staticmethod
    def _confidences(key: int) -> bytes:
        line = _json(_frame(confidence=float(np.uint32(key).view(np.float32))))
        return line[line.index(b',"confidence":') : line.index(b"[]")]


def _frame(**columns: Any) -> Frame:
    """A frame of which only some columns matter."""
    plain = dict.fromkeys(Row.__slots__, 0) | {
        "request": -1,
        "request_start": -1,
        "response_ns": -1,
        "kind": Kind.REQUEST,
    }
    return Frame(Row(**plain | columns), b"")


def _json(frame: Frame) -> bytes:
    return orjson.dumps(frame.to_json(fields=False))


def _end(line: dict[str, Any]) -> bytes:
    """A line from the findings on."""
    tail = {key: line[key] for key in ("findings", "port", "explain") if key in line}
    return orjson.dumps(tail, option=orjson.OPT_APPEND_NEWLINE)[len(b'{"findings":') :]


# Frames annotated whole, one by one, and what is kept of that.
#
# Polls repeat: the same request, and often the same answer, comes again and again, so the fields of frames
# seen are kept as text.


_MOST_CACHED: Final = 16 << 20  # bytes of text


class Whole:
    """What `make` says of a frame by its bytes (and its request's) alone, kept."""

    def __init__(self, make: Callable[[Frame], bytes]) -> None:
        self._make = make
        self._texts: dict[tuple[bytes, bytes | None, int, int], bytes] = {}
        self._size = 0

    def text(self, frame: Frame) -> bytes:
        """The frame's text."""
        key = (frame.captured, frame.request_bytes, frame.row.kind, frame.row.protocol)
        rendered = self._texts.get(key)
        if rendered is None:
            rendered = self._make(frame)
            self._size += len(rendered)
            if self._size > _MOST_CACHED:
                self._texts.clear()
                self._size = len(rendered)
            self._texts[key] = rendered
        return rendered


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
