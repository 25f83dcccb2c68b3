"""Findings as log messages, `foxglove.Log` in JSON: words are made one by one, so only so many of a kind are told."""

from __future__ import annotations

from typing import Final

import numpy as np
import orjson

from analyzer.exports.targets.mcap.schemas import LEVELS
from analyzer.findings.model import evidence
from analyzer.findings.registry import rules
from analyzer.frames import Batch, Kind, Rows
from captures.formats.mcap import packing
from captures.formats.mcap.packing import HEAD, Packed, Part, Tails
from captures.ragged import Ints

MAX_OF_A_KIND: Final = 20_000  # further ones are counted on their frames, not told


class Log:
    """The findings' channel."""

    def __init__(self, channel: int) -> None:
        self._channel = channel
        self._told: dict[int, int] = {}  # by rule
        self._end = 0  # ns, of the rows so far
        self.left_out = 0

    def messages(self, findings: Rows, batch: Batch) -> Packed:
        """What was found about the rows of a batch, or about the bus as a whole, which comes at the end."""
        findings = findings.take(self._room(findings))
        times = findings["t"].copy()
        if len(batch):
            self._end = max(self._end, int(batch.rows["t_end"].max()))
            framed = findings["index"] >= 0
            times[framed] = batch.rows["t_end"][rows_of(findings[framed], batch)]
        times[findings["start"] < 0] = self._end
        order = np.argsort(times, kind="stable")
        texts = _texts(findings[order], times[order].tolist())
        sizes = np.array([len(text) for text in texts], np.int64)
        tails = Tails(np.frombuffer(b"".join(texts), np.uint8), np.cumsum(sizes) - sizes, sizes)
        heads = packing.heads(np.zeros(1, [("record", HEAD)]), len(texts))
        return packing.packed(self._channel, times[order], [Part(None, heads)], tails)

    def _room(self, findings: Rows) -> Ints:
        """Which of these are told."""
        kept = np.ones(len(findings), np.bool_)
        for rule in np.unique(findings["rule"]).tolist():
            here = np.flatnonzero(findings["rule"] == rule)
            before = self._told.get(rule, 0)
            kept[here[max(MAX_OF_A_KIND - before, 0) :]] = False
            self._told[rule] = before + len(here)
        self.left_out += int(np.count_nonzero(~kept))
        return np.flatnonzero(kept)


def rows_of(findings: Rows, batch: Batch) -> Ints:
    """The row of the frame that each stands on."""
    frames = np.flatnonzero(batch.rows["kind"] != Kind.NOISE)
    found: Ints = np.append(frames, len(batch) - 1)[np.searchsorted(batch.rows["index"][frames], findings["index"])]
    return found


def on_frames(findings: Rows | None, batch: Batch) -> Ints | None:
    """How many findings stand on each row that is a frame; None where there are none."""
    if findings is None or not len(batch):
        return None
    framed = findings.take(np.flatnonzero(findings["index"] >= 0))
    return np.bincount(rows_of(framed, batch), minlength=len(batch)) if len(framed) else None


def _texts(findings: Rows, times: list[int]) -> list[bytes]:
    """Their messages in JSON; times are in ns."""
    known = rules()
    texts = []
    for number, figures, t_ns in zip(findings["rule"].tolist(), findings["numbers"].tolist(), times, strict=True):
        rule = known[number]
        seconds, nanoseconds = divmod(max(t_ns, 0), 1_000_000_000)
        message = {
            "timestamp": {"sec": seconds, "nsec": nanoseconds},
            "level": LEVELS[rule.severity],
            "message": rule.words(rule.text, evidence(rule, figures)),
            "name": rule.code,
            "file": "",
            "line": 0,
        }
        texts.append(orjson.dumps(message))
    return texts
