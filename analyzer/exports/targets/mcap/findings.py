"""Findings as log messages, `foxglove.Log`: words are made one by one, so only so many of a kind are told."""

from __future__ import annotations

from typing import Final

import numpy as np

from captures.formats.mcap import packing
from captures.formats.mcap.log_messages import log_message
from captures.formats.mcap.packing import HEAD, Packed, PackedPart, Tails
from captures.ragged import Ints

from ....tables.batch import Batch, rows_of_findings
from ....tables.findings import Findings, evidence, rules
from .schemas import LEVELS

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
