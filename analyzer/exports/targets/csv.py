"""CSV for spreadsheets: a row a frame, the same columns in every file.

Bytes are written in pairs with spaces between, so that no spreadsheet takes them for a number; text that a device sent
and that a spreadsheet would run as a formula gets an apostrophe before it.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from analyzer.exports.encoding import explain_json
from analyzer.exports.output import Output
from analyzer.exports.sink import ExportOptions
from analyzer.frames import Batch, Frame, Kind

if TYPE_CHECKING:
    from analyzer.findings.model import Finding
    from captures import Block, Capture

COLUMNS: Final = (
    "kind",  # frame or noise
    "index",
    "port",
    "start",
    "length",
    "seconds",  # from the first row to the first start bit
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
    "response_time_ns",
    "confidence",
    "hex",
    "summary",
    "findings",
)
EXPLAINED: Final = (
    "bits_length",
    "bits_crc",
    "bits_silence",
    "bits_conversation",
    "margin",
    "runner_up",
    "runner_up_start",
    "runner_up_length",
)
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r", "\n")


class _Table:
    def __init__(self, out: Output, options: ExportOptions, timed: bool) -> None:
        self._out = out
        self._options = options
        self._timed = timed
        self._zero: int | None = None
        self._buffer = io.StringIO()
        columns = COLUMNS + (EXPLAINED if options.explain else ())
        self._rows = csv.DictWriter(self._buffer, columns, lineterminator="\n", restval="")
        self._rows.writeheader()
        self._flush()

    def block(self, block: Block) -> None:
        """Raw chunks are not in this format."""

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """A line a row."""
        if self._zero is None:
            self._zero = int(batch.rows["t_start"][first])
        for row, kind in enumerate(batch.rows["kind"][first:last].tolist(), first):
            if kind != Kind.NOISE:
                self._rows.writerow(self._place(batch, row) | self._frame(batch.frame(row)))
            elif self._options.noise:
                self._rows.writerow(self._place(batch, row))
        self._flush()

    def batch(self, batch: Batch) -> None:
        """Nothing here hangs on a whole batch."""

    def close(self) -> None:
        """Nothing is left: rows are written as they come."""

    def _place(self, batch: Batch, row: int) -> dict[str, Any]:
        values = batch.rows[row]
        cells: dict[str, Any] = {key: int(values[key]) for key in ("port", "start", "length")}
        if self._timed:
            cells["seconds"] = f"{(int(values['t_start']) - (self._zero or 0)) / 1e9:.6f}"
            cells["t_start_ns"] = int(values["t_start"])
            cells["t_end_ns"] = int(values["t_end"])
        noise = {"hex": batch.bytes_of(row).hex(" ").upper(), "findings": _words(batch.findings_of(row))}
        return cells | {"kind": "noise"} | noise

    def _frame(self, frame: Frame) -> dict[str, Any]:
        cells: dict[str, Any] = {
            "kind": "frame",
            "index": frame.index,
            "protocol": frame.protocol,
            "direction": frame.direction,
            "unit": frame.unit,
            "function": frame.function,
            "name": safe(frame.name),
            "exception": frame.exception,
            "crc_ok": str(frame.crc_ok).lower(),
            "request_start": frame.request_start,
            "response_time_ns": frame.response_time_ns,
            "confidence": f"{frame.confidence:.6f}",
            "hex": frame.adu.data.hex(" ").upper(),
            "summary": safe(frame.summary()),
            "findings": _words(frame.findings),
        }
        if self._options.explain and (why := explain_json(frame)) is not None:
            rival = why["runner_up"]
            cells |= dict(
                zip(
                    EXPLAINED,
                    (
                        *(why[key] for key in ("length", "crc", "silence", "conversation", "margin")),
                        *(rival[key] for key in ("kind", "start", "length")),
                    ),
                    strict=True,
                )
            )
        return cells

    def _flush(self) -> None:
        self._out.write(self._buffer.getvalue().encode())
        self._buffer.seek(0)
        self._buffer.truncate()


def _words(findings: Sequence[Finding]) -> str:
    """Findings in one cell."""
    return safe("; ".join(f"{finding.code}: {finding.text}" for finding in findings))


def safe(text: str) -> str:
    """Text that no spreadsheet runs as a formula."""
    return f"'{text}" if text.startswith(_FORMULA) else text


def open_sink(out: Output, capture: Capture, options: ExportOptions) -> _Table:
    """Rows onto `out`."""
    return _Table(out, options, capture.timed)
