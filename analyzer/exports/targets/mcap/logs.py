"""Log messages, `foxglove.Log`: findings, the causes of a capture's trouble, and the user's own bookmarks.

Words are made one by one, so of findings only so many of a kind are told.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import orjson

from captures.formats.mcap import packing
from captures.formats.mcap.log_messages import LOG_NAME, log_message, log_schema
from captures.formats.mcap.packing import HEAD, Packed, PackedPart, Tails
from captures.formats.mcap.protobuf import ENCODING
from captures.formats.mcap.records import METADATA
from captures.formats.mcap.writer import ArrayWriter
from captures.ragged import Ints

from ....causes.ledger import Ledger
from ....causes.model import Cause
from ....causes.reasoning import causes_of
from ....tables.batch import Batch, rows_of_findings
from ....tables.findings import Findings, Severity, evidence, rules
from ....usernotes import Notes, marked_rows
from .schemas import LEVELS

if TYPE_CHECKING:
    from captures import Capture

    from ....core import Analysed

MAX_OF_A_KIND: Final = 20_000  # further ones are counted on their frames, not told


class Log:
    """The findings' channel."""

    def __init__(self, channel: int) -> None:
        self._channel = channel
        self._counts: dict[int, int] = {}  # by rule
        self._end = 0  # ns, of the rows so far
        self.left_out = 0

    def messages(self, findings: Findings, batch: Batch) -> Packed:
        """What was found about the rows of a batch, or about the bus as a whole, which comes at the end."""
        findings = findings[self._room(findings)]
        times = findings.t_ns.copy()
        if len(batch):
            self._end = max(self._end, int(batch.rows.t_end_ns.max()))
            rows = rows_of_findings(batch.rows, findings)
            times[rows >= 0] = batch.rows.t_end_ns[rows[rows >= 0]]
        times[findings.start < 0] = self._end
        order = np.argsort(times, kind="stable")
        texts = _texts(findings[order], times[order].tolist())
        sizes = np.array([len(text) for text in texts], np.int64)
        tails = Tails(np.frombuffer(b"".join(texts), np.uint8), np.cumsum(sizes) - sizes, sizes)
        heads = packing.heads(np.zeros(1, [("record", HEAD)]), len(texts))
        return packing.packed(self._channel, times[order], [PackedPart(None, heads)], tails)

    def _room(self, findings: Findings) -> Ints:
        """Which of these are told."""
        fitting = np.ones(len(findings), np.bool_)
        for rule in np.unique(findings.rule).tolist():
            own = np.flatnonzero(findings.rule == rule)
            before = self._counts.get(rule, 0)
            fitting[own[max(MAX_OF_A_KIND - before, 0) :]] = False
            self._counts[rule] = before + len(own)
        self.left_out += int(np.count_nonzero(~fitting))
        return np.flatnonzero(fitting)


def _texts(findings: Findings, times: list[int]) -> list[bytes]:
    """Their messages; times are in ns."""
    declared = rules()
    texts = []
    for number, figures, t_ns in zip(findings.rule.tolist(), findings.numbers.tolist(), times, strict=True):
        rule = declared[number]
        text = rule.words(rule.text, evidence(rule, figures))
        texts.append(log_message(t_ns, LEVELS[rule.severity], text, rule.code))
    return texts


CAUSES: Final = f"{METADATA}/causes"  # name of the metadata record with what explains the findings


class Stories:
    """Batches as they come; topics `/bookmarks` and, at the end, `/causes`."""

    def __init__(self, writer: ArrayWriter, capture: Capture, *, whole: bool) -> None:
        """`whole`: nothing of the bus is left out by a filter; a part of it tells no story."""
        self._writer = writer
        self._ledger = Ledger(capture.line) if whole else None
        self._notes, self._marked = Notes.of_capture(capture.path), -1  # and their channel, once there is one

    def batch(self, analysed: Analysed) -> None:
        """The next rows."""
        rows = analysed.batch.rows
        for row, comment in marked_rows(self._notes, rows.port, rows.start).items():
            self._mark(int(rows.t_end_ns[row]), int(rows.index[row]), comment)
        if self._ledger is not None:
            self._ledger.feed(analysed.batch, analysed.transactions)

    def close(self) -> None:
        """The causes, best first: as messages at the end of the capture, and whole as JSON in a metadata record."""
        if self._ledger is None:
            return
        self._ledger.close()
        if causes := causes_of(self._ledger):
            self._tell(causes, self._ledger.end)

    def _tell(self, causes: Sequence[Cause], end_ns: int) -> None:
        channel = self._channel("/causes")
        for cause in causes:
            text = f"{cause.text} ({cause.confidence:.0%} sure; to be sure: {cause.deciding_test}; do: {cause.remedy})"
            message = log_message(end_ns, LEVELS[Severity[cause.severity.upper()]], text, cause.cause)
            self._writer.add_message(channel, end_ns, message, end_ns)
        lines = [orjson.dumps(cause.to_json()).decode() for cause in causes]
        names = [f"{rank:02d} {cause.cause}" for rank, cause in enumerate(causes, 1)]
        self._writer.add_metadata(CAUSES, dict(zip(names, lines, strict=True)))

    def _mark(self, t_ns: int, index: int, comment: str) -> None:
        if self._marked < 0:
            self._marked = self._channel("/bookmarks")
        message = log_message(
            t_ns, LEVELS[Severity.NOTE], comment or "bookmark", f"frame {index}" if index >= 0 else "noise"
        )
        self._writer.add_message(self._marked, t_ns, message, t_ns)

    def _channel(self, topic: str) -> int:
        schema = self._writer.register_schema(LOG_NAME, ENCODING, log_schema())
        return self._writer.register_channel(topic, ENCODING, schema)
