"""One message of raw chunks: a block as bytes and back. The fields are told in `captures.formats.mcap`."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray

from captures.chunks import TIME_LIMIT, Block, columns
from captures.formats.mcap.protobuf import Field, Message, Type, delimited, fields_in

MESSAGE: Final = Message(
    "rtuscope.Chunks",
    (
        Field("t_ns", Type.SFIXED64),
        Field("after_ns", Type.SFIXED64, repeated=True),
        Field("sizes", Type.FIXED32, repeated=True),
        Field("data", Type.BYTES),
        Field("port", Type.BYTES),
        Field("mark", Type.BYTES),
        Field("errors", Type.FIXED32, repeated=True),
    ),
)
_NUMBER: Final = MESSAGE.numbers
_COLUMNS: Final = {_NUMBER["after_ns"]: "<i8", _NUMBER["sizes"]: "<u4", _NUMBER["errors"]: "<u4"}
_BYTES: Final = {_NUMBER["data"], _NUMBER["port"], _NUMBER["mark"]}
_SIGN: Final = 1 << 63
_TIME: Final = bytes((_NUMBER["t_ns"] << 3 | 1,))


def encoded(block: Block, cuts: Sequence[int]) -> Iterator[bytes]:
    """A message for the chunks from each cut to the next; cuts ascend from 0 to the number of chunks.

    Columns are made for the whole block and only cut for a message, as there are thousands of those.
    """
    firsts = np.asarray(cuts[:-1], np.intp)
    starts = block.t_ns[firsts]
    counts = np.diff(np.asarray(cuts))
    after = memoryview((block.t_ns - np.repeat(starts, counts)).astype("<i8", copy=False).tobytes())
    sizes = memoryview(np.diff(block.offsets).astype("<u4").tobytes())
    data = memoryview(block.data.tobytes())
    places = block.offsets[np.asarray(cuts, np.intp)]
    wrong = np.searchsorted(block.errors, places).tolist()
    bounds = (places - block.offsets[0]).tolist()
    marked = [
        (name, np.logical_or.reduceat(column != 0, firsts).tolist(), memoryview(column.tobytes()))
        for name, column in (("port", block.port), ("mark", block.mark))
        if column.any()
    ]
    for i, (first, last) in enumerate(pairwise(cuts)):
        parts = [
            _TIME,
            int(starts[i]).to_bytes(8, "little", signed=True),
            delimited(_NUMBER["after_ns"], after[8 * first : 8 * last]),
            delimited(_NUMBER["sizes"], sizes[4 * first : 4 * last]),
            delimited(_NUMBER["data"], data[bounds[i] : bounds[i + 1]]),
        ]
        parts += [delimited(_NUMBER[name], column[first:last]) for name, there, column in marked if there[i]]
        if wrong[i] < wrong[i + 1]:
            errors = block.errors[wrong[i] : wrong[i + 1]] - places[i]
            parts.append(delimited(_NUMBER["errors"], errors.astype("<u4").tobytes()))
        yield b"".join(parts)


def decoded(payload: bytes | memoryview, encoding: str, timed: bool) -> Block:
    """The chunks of a message; ValueError where it is not one that this module writes, or wrote."""
    found = _from_json(payload) if encoding == "json" else _from_protobuf(payload)
    start, after, sizes, data = found["t_ns"], found["after_ns"], found["sizes"], found["data"]
    extras = {key: found[key] for key in ("port", "mark") if key in found}
    errors = found.get("errors", np.zeros(0, np.int64))
    if sizes.ndim != 1 or any(column.shape != sizes.shape for column in (after, *extras.values())):
        raise ValueError("its columns do not fit together")
    if (len(sizes) and int(sizes.min()) <= 0) or int(sizes.sum(dtype=np.int64)) != len(data):
        raise ValueError("its columns do not fit together")
    if len(errors) and (errors.ndim != 1 or errors.min() < 0 or errors.max() >= len(data)):
        raise ValueError("error positions outside its data")
    if len(sizes) and not -TIME_LIMIT < start + int(after.min()) <= start + int(after.max()) < TIME_LIMIT:
        raise ValueError("times out of range")
    if "mark" in extras and extras["mark"].max(initial=0) > 2:
        raise ValueError("an unknown direction mark")
    if len(errors):
        extras["errors"] = np.unique(errors)
    t_ns = after + start if len(sizes) else after
    return columns(data, sizes, t_ns, timed=timed, extras=extras)


def _from_protobuf(payload: bytes | memoryview) -> Mapping[str, Any]:
    found: dict[str, Any] = {"t_ns": 0, "after_ns": _packed(b"", "<i8"), "sizes": _packed(b"", "<u4"), "data": b""}
    for number, value in fields_in(payload):
        name = _NAMES.get(number)
        if name is None:
            continue
        if isinstance(value, int):
            if name != "t_ns":
                raise ValueError(f"{name} is a number")
            found[name] = value - (value >= _SIGN) * 2 * _SIGN
        elif name == "data":
            found[name] = value
        elif number in _COLUMNS:
            found[name] = _packed(value, _COLUMNS[number])
        elif number in _BYTES:
            found[name] = np.frombuffer(value, np.uint8)
        else:
            raise ValueError(f"{name} is no number")
    return found


def _packed(value: bytes | memoryview, dtype: str) -> NDArray[Any]:
    return np.frombuffer(value, dtype)


def _from_json(payload: bytes | memoryview) -> Mapping[str, Any]:
    message = orjson.loads(payload)
    try:
        found: dict[str, Any] = {
            "t_ns": int(np.int64(int(message["t_ns"]))),
            "after_ns": np.array(message["after_ns"], dtype=np.int64),
            "sizes": np.array(message["sizes"], dtype=np.int64),
            "data": base64.b64decode(message["data"], validate=True),
        }
        for key in ("port", "mark"):
            if key in message:
                found[key] = np.array(message[key], dtype=np.uint8)
        found["errors"] = np.array(message.get("errors", []), dtype=np.int64)
    except (TypeError, KeyError, IndexError, OverflowError, binascii.Error) as error:
        raise ValueError(f"not as its schema says: {one_line(error)}") from error
    return found


def one_line(error: Exception) -> str:
    """What went wrong, on one line of at most 120 characters."""
    return (" ".join(str(error).split()) or type(error).__name__)[:120]


_NAMES: Final = {number: name for name, number in _NUMBER.items()}
