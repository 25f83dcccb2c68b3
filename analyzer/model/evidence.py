"""Why a row's boundaries stand where they do, kept in 15 bytes a row."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Kind
from .table import NO_EVIDENCE, RowTable

if TYPE_CHECKING:
    from ..tables.batch import Batch

_STEPS: Final = 8  # of a bit
_MOST: Final = np.iinfo(np.int16).max
_WEIGHTS: Final = ("length", "crc", "silence", "conversation", "margin")


class RowEvidence(NamedTuple):
    """Bits for this reading of the bytes (log2 of a likelihood ratio), `margin` over the best one without the row.

    The runner-up is what would stand here instead: noise where `rival_kind` says so, else `rival_length` bytes from
    `rival_start` on, an offset in the port's stream.
    """

    length: float
    crc: float
    silence: float
    conversation: float
    margin: float
    rival_kind: Kind
    rival_start: int
    rival_length: int


def evidence_columns(batch: Batch) -> dict[str, NDArray[Any]]:
    """A batch's evidence as columns of the table."""
    n, why = len(batch), batch.evidence
    if why is None:
        none: dict[str, NDArray[Any]] = {f"why_{name}": np.full(n, NO_EVIDENCE, np.int16) for name in _WEIGHTS}
        return {**none, "rival_start": np.zeros(n, np.int16), "rival_length": np.zeros(n, np.uint16),
                "rival_kind": np.zeros(n, np.uint8)}  # fmt: skip
    columns: dict[str, NDArray[Any]] = {}
    for name in _WEIGHTS:
        eighths = np.nan_to_num(why.column(name).astype(np.float64) * _STEPS, posinf=_MOST, neginf=-_MOST)
        columns[f"why_{name}"] = np.clip(np.round(eighths), -_MOST, _MOST).astype(np.int16)
    framed = (why.rival_start >= 0) & (why.rival_kind != Kind.NOISE)
    ahead = np.where(framed, why.rival_start - batch.rows.start, 0)
    near = framed & (np.abs(ahead) <= _MOST)
    columns["rival_start"] = np.where(near, ahead, 0).astype(np.int16)
    columns["rival_length"] = np.where(near, np.clip(why.rival_length, 0, (1 << 16) - 1), 0).astype(np.uint16)
    columns["rival_kind"] = np.where(near, why.rival_kind, Kind.NOISE).astype(np.uint8)
    return columns


def evidence_of(table: RowTable, row: int) -> RowEvidence | None:
    """A row's evidence; None where none was kept."""
    if table.value("why_margin", row) == NO_EVIDENCE:
        return None
    length, crc, silence, conversation, margin = (table.value(f"why_{name}", row) / _STEPS for name in _WEIGHTS)
    start = table.value("start", row) + table.value("rival_start", row)
    kind, size = Kind(table.value("rival_kind", row)), table.value("rival_length", row)
    return RowEvidence(length, crc, silence, conversation, margin, kind, start, size)
