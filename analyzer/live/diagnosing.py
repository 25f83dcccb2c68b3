"""Transactions and findings of rows while they come: at once where something looks wrong, else twice a second.

Rules look at columns, which costs the same for one frame as for a hundred. So frames that are as they should be wait a
moment for their diagnosis, and the first one that is not brings theirs along.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from analyzer import records
from analyzer.deframing.options import Options
from analyzer.findings.model import NOTHING, Findings
from analyzer.frames import Batch, Kind, Rows
from analyzer.judging import Judging
from analyzer.recorded import deaf_times
from analyzer.transactions import TRANSACTION
from captures.line import LineSettings
from captures.recording.notes import Note

_WAIT_NS: Final = 500_000_000
_ROWS: Final = 256  # waiting at most
_NOTES: Final = 64  # remembered, the newest
_REQUEST: Final = int(Kind.REQUEST)
_NONE: Final[tuple[Rows, Findings]] = np.zeros(0, TRANSACTION), NOTHING


class Diagnosing:
    """Batches in, settled transactions and findings out; both may speak of batches before."""

    def __init__(self, line: LineSettings, options: Options) -> None:
        self._judging = Judging(line, options)
        self._held: list[Batch] = []
        self._rows = 0
        self._since = 0
        self._asking = False  # the last frame was a request
        self._notes: deque[Note] = deque(maxlen=_NOTES)

    def note(self, note: Note) -> None:
        """Something happened to a port: no answer is missed that came while nothing was heard."""
        self._notes.append(note)
        self._judging.deaf = deaf_times(self._notes)

    def feed(self, batch: Batch, now_ns: int) -> tuple[Rows, Findings]:
        """What is to be said by now, with these rows (which may be none)."""
        if len(batch):
            self._since = self._since if self._held else now_ns
            self._held.append(batch)
            self._rows += len(batch)
        if not self._held or (
            self._rows < _ROWS and now_ns < self._since + _WAIT_NS and not (len(batch) and self._odd(batch))
        ):
            return _NONE
        return self._say()

    def close(self) -> tuple[Rows, Findings]:
        """No more comes: the rest, and what concerns the bus as a whole."""
        settled, findings = self._say() if self._held else _NONE
        last, found = self._judging.close()
        return records.joined((settled, last)), records.joined((findings, found))

    def _say(self) -> tuple[Rows, Findings]:
        batch = joined(self._held)
        self._held, self._rows = [], 0
        return self._judging.feed(batch)

    def _odd(self, batch: Batch) -> bool:
        """Whether any of these rows is not what a healthy bus says."""
        rows = batch.rows
        requests = rows["kind"] == _REQUEST
        asking = requests & (rows["unit"] > 0)
        again = (requests[0] and self._asking) or (requests[1:] & asking[:-1]).any()
        self._asking = bool(asking[-1])
        unasked = ~requests & (rows["request"] < 0)
        bad = unasked.any() or not rows["check"].all() or rows["exception"].any() or rows["errors"].any()
        return bool(again or bad)


def joined(batches: list[Batch]) -> Batch:
    """Batches as one, at least one."""
    if len(batches) == 1:
        return batches[0]
    rows = records.joined([batch.rows for batch in batches])
    sizes = np.cumsum([0, *(len(batch.data) for batch in batches)])
    rows["at"] += np.repeat(sizes[:-1], [len(batch) for batch in batches])
    earlier = {index: adu for batch in batches for index, adu in batch.earlier.items()}
    return Batch(rows, np.concatenate([batch.data for batch in batches]), earlier)
