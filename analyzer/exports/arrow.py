"""The rows of batches as Arrow tables, column by column: one builder for Parquet, `to_arrow`, `to_polars`, `to_pandas`.

A row is a frame, or a stretch of noise where those are asked for. Columns are named as the keys of a JSON line are, and
null where a line has null; what `tables.columns` decodes stands beside them. Times are timestamps in UTC, durations are
integers of nanoseconds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache, lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dissectors.functions import function_name
from dissectors.lengths import revision
from dissectors.values import AREAS

from ..extras import needs
from ..tables.batch import Batch, adu_of
from ..tables.columns import Decoded, decode
from ..tables.findings import codes
from ..tables.schema import Direction, Kind, Protocol, Rows

try:
    import pyarrow as pa
except ImportError as error:
    raise ImportError(needs("a table", "pyarrow", "columns"), name="pyarrow") from error

_NAMES: Final = 128  # function codes
_BITS: Final = ("length", "crc", "silence", "conversation")  # evidence, in bits


@lru_cache(maxsize=1)
def _function_names(revision: int) -> tuple[str, ...]:  # noqa: ARG001 - who declares a function names it
    return tuple(map(function_name, range(_NAMES)))


@cache
def _word_column(words: tuple[str, ...]) -> Any:
    return _ragged(pa.string(), [word.encode() for word in words])


def _dictionary() -> Any:
    return pa.dictionary(pa.int8(), pa.string())


_TIME: Final = pa.timestamp("ns", "UTC")
SCHEMA: Final = pa.schema(
    [
        ("kind", _dictionary()),  # frame or noise
        ("index", pa.int64()),
        ("port", pa.uint8()),
        ("start", pa.int64()),
        ("length", pa.int32()),
        ("t_start_ns", _TIME),
        ("t_end_ns", _TIME),
        ("protocol", _dictionary()),
        ("direction", _dictionary()),
        ("unit", pa.uint8()),
        ("function", pa.uint8()),
        ("name", _dictionary()),
        ("exception", pa.uint8()),
        ("crc_ok", pa.bool_()),
        ("request_start", pa.int64()),
        ("taken_for_start", pa.int64()),  # the request that the client takes an answer for, where it is of another
        ("unsure", pa.bool_()),  # whether it is unclear which request it answers
        ("response_time_ns", pa.int64()),  # where the tap's clock carries it; else it lies between the next two
        ("response_time_low_ns", pa.int64()),
        ("response_time_high_ns", pa.int64()),
        ("confidence", pa.float32()),
        ("bytes", pa.binary()),
        ("area", _dictionary()),  # 0x, 1x, 3x or 4x
        ("address", pa.int32()),  # physical; of a response, what it answers
        ("quantity", pa.int32()),
        ("value_address", pa.int32()),
        ("values", pa.list_(pa.uint16())),
        ("findings", pa.list_(pa.dictionary(pa.int16(), pa.string()))),  # codes
    ]
)
EXPLAINED: Final = pa.schema(
    [
        *((f"bits_{name}", pa.float32()) for name in _BITS),
        ("margin", pa.float32()),
        ("runner_up", _dictionary()),
        ("runner_up_start", pa.int64()),
        ("runner_up_length", pa.int64()),
    ]
)


def schema(*, explain: bool = False) -> Any:
    """The Arrow schema of a table; `explain` adds why each boundary stands where it does."""
    return pa.schema([*SCHEMA, *EXPLAINED]) if explain else SCHEMA


def record_batch(batch: Batch, *, noise: bool = False, explain: bool = False) -> Any:
    """A batch as an Arrow RecordBatch, without `noise` of its frames alone."""
    rows = batch.rows
    frames = rows.kind != Kind.NOISE
    columns = _positions(rows, frames) | _envelope(rows, frames) | _response_times(batch) | _contents(decode(batch))
    columns["bytes"] = _frame_bytes(batch)
    columns["findings"] = _finding_codes(batch)
    if explain:
        columns |= _evidence(batch, frames)
    wanted = schema(explain=explain)
    complete = pa.record_batch([columns[field.name] for field in wanted], schema=wanted)
    return complete if noise or frames.all() else complete.filter(_array(frames))


def table(batches: Iterable[Batch], *, noise: bool = False, explain: bool = False) -> Any:
    """All batches as one Arrow Table, in memory."""
    parts = [record_batch(batch, noise=noise, explain=explain) for batch in batches]
    return pa.Table.from_batches(parts, schema(explain=explain))


def _positions(rows: Rows, frames: NDArray[np.bool_]) -> dict[str, Any]:
    return {
        "kind": _coded(frames.astype(np.int8), ("noise", "frame")),
        "index": _array(rows.index, ~frames),
        "port": _array(rows.port),
        "start": _array(rows.start),
        "length": _array(rows.length.astype(np.int32)),
        "t_start_ns": _array(rows.t_start_ns, kind=_TIME),
        "t_end_ns": _array(rows.t_end_ns, kind=_TIME),
    }


def _envelope(rows: Rows, frames: NDArray[np.bool_]) -> dict[str, Any]:
    noise = ~frames
    direction = rows.kind - np.uint8(Kind.REQUEST)
    return {
        "protocol": _coded(rows.protocol, (protocol.name.lower() for protocol in Protocol), noise),
        "direction": _coded(direction, (direction.name for direction in Direction), noise),
        "unit": _array(rows.unit, noise),
        "function": _array(rows.function, noise),
        "name": _coded(rows.function, _function_names(revision()), noise),
        "exception": _array(rows.exception, rows.exception == 0),
        "crc_ok": _array(rows.check, noise | (rows.protocol == Protocol.TCP)),
        "request_start": _array(rows.request_start, rows.request_start < 0),
        "taken_for_start": _array(rows.taken_for_start, rows.taken_for_start < 0),
        "unsure": _array(rows.unsure, noise),
        "confidence": _array(rows.confidence, noise),
    }


def _response_times(batch: Batch) -> dict[str, Any]:
    exact, low, high = batch.response_times
    return {
        "response_time_ns": _array(exact, exact < 0),
        "response_time_low_ns": _array(low, low < 0),
        "response_time_high_ns": _array(high, high < 0),
    }


def _contents(decoded: Decoded) -> dict[str, Any]:
    area = decoded.area.astype(np.int8) - np.int8(1)
    return {
        "area": _coded(area, AREAS, area < 0),
        "address": _array(decoded.address, decoded.address < 0),
        "quantity": _array(decoded.quantity, decoded.quantity < 0),
        "value_address": _array(decoded.value_address, decoded.value_address < 0),
        "values": pa.ListArray.from_arrays(_array(decoded.offsets.astype(np.int32)), _array(decoded.values)),
    }


def _frame_bytes(batch: Batch) -> Any:
    """The bytes of each row; of ASCII frames what their digits stand for."""
    rows = batch.rows
    ends = np.cumsum(rows.length)
    begins = ends - rows.length
    data = batch.data
    if rows.protocol.any():
        protocols = rows.protocol.tolist()
        captured = [batch.bytes_of(row) for row in range(len(rows))]
        noise = (rows.kind == Kind.NOISE).tolist()
        return _ragged(
            pa.binary(),
            [c if silent else adu_of(c, p).data for c, p, silent in zip(captured, protocols, noise, strict=True)],
        )
    if not np.array_equal(begins, rows.at):  # not one after the other: ports in turn
        within = np.arange(int(ends[-1])) - np.repeat(begins, rows.length)
        data = data.take(np.repeat(rows.at, rows.length) + within)
    offsets = np.concatenate(([0], ends)).astype(np.int32)
    return pa.Array.from_buffers(pa.binary(), len(rows), [None, pa.py_buffer(offsets), pa.py_buffer(data)])


def _finding_codes(batch: Batch) -> Any:
    """The codes of what was found about each row."""
    findings = batch.findings
    names: tuple[str, ...] = ()
    counts = np.zeros(len(batch), np.int64)
    rules = np.zeros(0, np.int16)
    if findings is not None and len(findings) and len(batch):
        names = codes()
        rows = batch.finding_rows
        rules = findings.rule[np.argsort(rows, kind="stable")][np.count_nonzero(rows < 0) :]
        counts = batch.finding_counts
    offsets = np.concatenate(([0], np.cumsum(counts))).astype(np.int32)
    values = pa.DictionaryArray.from_arrays(_array(rules), _word_column(names))
    return pa.ListArray.from_arrays(_array(offsets), values)


def _evidence(batch: Batch, frames: NDArray[np.bool_]) -> dict[str, Any]:
    evidence = batch.evidence
    if evidence is None:
        return {field.name: pa.nulls(len(batch), field.type) for field in EXPLAINED}
    noise = (evidence.rival_start < 0) | (evidence.rival_kind == Kind.NOISE)
    columns = {f"bits_{name}": _array(evidence.column(name), ~frames) for name in _BITS}
    columns["margin"] = _array(evidence.margin, ~frames)
    kind = np.where(noise, 0, evidence.rival_kind)
    columns["runner_up"] = _coded(kind, (kind.name.lower() for kind in Kind), ~frames)
    columns["runner_up_start"] = _array(evidence.rival_start, ~frames | noise)
    columns["runner_up_length"] = _array(evidence.rival_length, ~frames | noise)
    return columns


def _array(values: NDArray[Any], null: NDArray[np.bool_] | None = None, kind: Any = None) -> Any:
    """An array of these values, null where `null` is: made of buffers, as `pyarrow.array` imports pandas to look."""
    kind = kind or pa.from_numpy_dtype(values.dtype)
    data = np.packbits(values, bitorder="little") if values.dtype == np.bool_ else np.ascontiguousarray(values)
    valid = None if null is None else pa.py_buffer(np.packbits(~null, bitorder="little"))
    return pa.Array.from_buffers(kind, len(values), [valid, pa.py_buffer(data)])


def _ragged(kind: Any, values: Sequence[bytes]) -> Any:
    """Texts or bytes."""
    offsets = np.cumsum([0, *map(len, values)], dtype=np.int32)
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(offsets), pa.py_buffer(b"".join(values))])


def _coded(numbers: NDArray[Any], words: Iterable[str], null: NDArray[np.bool_] | None = None) -> Any:
    codes = np.ascontiguousarray(numbers).astype(np.int8)
    if null is not None:
        codes[null] = 0
    return pa.DictionaryArray.from_arrays(_array(codes, null), _word_column(tuple(words)))
