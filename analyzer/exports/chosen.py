"""The columns of a frame, the one list of their names, and outputs that hold only those that were chosen (`--fields`).

Every format has each column under the same name. Lines are made whole, which is fast, and what was not chosen is left
out of them.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Protocol

import orjson

from ..meant import meant
from .sink import ExportError

FRAME_COLUMNS: Final = (
    "kind",  # frame or noise
    "index",
    "port",
    "start",
    "length",
    "seconds",  # from the first row of all, written or not, to the first start bit
    "t_start_ns",
    "t_end_ns",
    "protocol",
    "direction",
    "unit",
    "function",
    "name",
    "exception",
    "crc_ok",
    "request_start",
    "response_time_ns",  # where the tap's clock carries it; else see low and high
    "confidence",
    "hex",
    "summary",
    "findings",
    "time",  # wall clock of the first start bit, ISO 8601 in UTC; empty where the capture has no dates
    "address",  # zero-based; of a response, what it answers
    "quantity",
    "values",  # registers or bits
    "response_time_low_ns",  # between what it lies, both the same where it is exact
    "response_time_high_ns",
    "taken_for_start",  # the request that the client takes an answer for, where it is of another
    "unsure",  # whether it is unclear which request it answers
)
_OTHER_NAMES: Final = {  # of Wireshark, and of fields of the filter whose columns have names of their own
    "frame.number": "index",
    "frame.time": "time",
    "frame.time_relative": "seconds",
    "finding": "findings",
    "value": "values",
    "text": "summary",
    "response_time": "response_time_ns",
    "register": "address",
    "bit": "address",
    "hex": "bytes",  # of Parquet, as the next
    "time": "t_start_ns",
    "bytes": "hex",
}


class ByteSink(Protocol):
    def write(self, data: bytes | memoryview, /) -> int: ...


def chosen_names(wanted: Iterable[str], known: Sequence[str]) -> tuple[str, ...]:
    """The columns of a table that are meant, by their names, the filter's or Wireshark's; all where none is named.
    Raises ExportError."""
    return tuple(_chosen(name.strip(), known) for name in wanted) or tuple(known)


def _chosen(name: str, known: Sequence[str]) -> str:
    from ..filters.fields import by_name

    plain = name.casefold().replace("-", "_")
    names = (plain, getattr(by_name().get(plain), "name", ""))
    for each in (*names, *(_OTHER_NAMES.get(name, "") for name in names)):
        if each in known:
            return each
    if near := meant(name, known):
        raise ExportError(f"--fields: no column {name!r}: did you mean {near}?")
    raise ExportError(f"--fields: no column {name!r}: choose from {', '.join(known)}")


class ChosenKeys:
    """Lines of JSON objects of frames, narrowed to some keys, in their order; keys that an object lacks are worked out
    or null."""

    def __init__(self, out: ByteSink, fields: Sequence[str]) -> None:
        self._out, self._narrow = out, FrameChoice(fields)
        self._rest = b""

    def begins(self, t_ns: int) -> None:
        """From when the seconds count."""
        self._narrow.begins(t_ns)

    def write(self, data: bytes | memoryview) -> int:
        """Whole lines are written."""
        *lines, self._rest = (self._rest + bytes(data)).split(b"\n")
        self._out.write(b"".join(orjson.dumps(self._narrow.of(orjson.loads(line))) + b"\n" for line in lines))
        return len(data)


class FrameChoice:
    """Objects of frames to some of their columns."""

    def __init__(self, fields: Sequence[str]) -> None:
        self.names = chosen_names(fields, (*FRAME_COLUMNS, "fields"))
        self._zero_ns: int | None = None

    def begins(self, t_ns: int) -> None:
        """When the first row of all begins; what is told first holds, without it the first line counts."""
        self._zero_ns = t_ns if self._zero_ns is None else self._zero_ns

    def of(self, line: Mapping[str, Any]) -> dict[str, Any]:
        """The chosen keys of a line."""
        begun = line["t_start_ns"]
        self.begins(begun)
        exact = line.get("response_time_ns")
        implied = {
            "kind": "frame",
            "port": 0,
            "seconds": (begun - (self._zero_ns or 0)) / 1e9,
            "response_time_low_ns": exact,
            "response_time_high_ns": exact,
        }
        return {name: line.get(name, implied.get(name)) for name in self.names}


class ChosenCells:
    """Lines of cells between commas, written with another character between them, and with those chosen alone. The
    first line is the names."""

    _which: list[int] | None

    def __init__(self, out: ByteSink, delimiter: str, fields: Sequence[str]) -> None:
        self._out, self._delimiter, self._fields = out, delimiter, fields
        self._rest = b""
        self._which = None

    def write(self, data: bytes | memoryview) -> int:
        """Whole lines are written; text with line ends in it stands in no cell of these."""
        lines, _, self._rest = (self._rest + bytes(data)).rpartition(b"\n")
        if lines:
            text = io.StringIO()
            rows = list(csv.reader(lines.decode().split("\n")))
            if self._which is None:
                known = rows[0]
                self._which = [known.index(name) for name in chosen_names(self._fields, known)]
            which = self._which
            picked = ([row[at] for at in which] for row in rows)
            csv.writer(text, delimiter=self._delimiter, lineterminator="\n").writerows(picked)
            self._out.write(text.getvalue().encode())
        return len(data)
