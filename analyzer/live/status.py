"""How the bus and the session are doing: in one line (load, frames a second, errors, what was dropped), and by unit.

The latter is what metrics and health say of transactions, in the words of the report.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from captures.line import LineSettings

from ..languages import counted, tr
from ..reports.summary import BY_STATUS
from ..tables.findings import Severity, rules
from ..tables.transactions import TransactionRows
from ..words import data_size, percent
from .session import SessionStep

_WINDOW_NS: Final = 2_000_000_000


def not_analysed(octets: int) -> str:
    """What is said while a session runs of bytes that the analysis could not keep up with; nothing of none."""
    return tr("NOT ANALYSED LIVE {bytes}", bytes=counted(octets, "byte", "bytes")) if octets else ""


def recording_words(octets: int, *, paused: bool, name: str = "") -> str:
    """How a recording does: `REC bus.mcap 5.2 kB`."""
    return " ".join(filter(None, (tr("RECORDING PAUSED" if paused else "REC"), name, data_size(octets))))


class LineStatus:
    """Counts steps. `errors` and `warnings` are findings, as every view counts them, `marked` bytes with an error of
    the UART's, `missed` bytes that were not analysed live."""

    def __init__(self, line: LineSettings) -> None:
        self.line = line
        self.bytes = self.frames = self.errors = self.warnings = self.marked = self.missed = 0
        self._severity = np.array([rule.severity for rule in rules()], np.uint8)  # by the number of the rule
        self._recent: deque[tuple[int, int, int]] = deque()  # time, bytes, frames; told from another thread: copy it
        self._first: int | None = None

    def feed(self, step: SessionStep) -> None:
        """Count it."""
        rows = step.batch.rows
        frames = int(np.count_nonzero(rows.kind))  # all but NOISE
        self.frames += frames
        if len(step.findings):
            severity = self._severity[step.findings.rule]
            self.errors += int(np.count_nonzero(severity == Severity.ERROR))
            self.warnings += int(np.count_nonzero(severity == Severity.WARNING))
        self.bytes += step.heard
        self.marked += step.marked
        self.missed += step.missed
        if not step.t_ns:
            return
        self._first = step.t_ns if self._first is None else self._first
        self._recent.append((step.t_ns, step.heard, frames))
        while self._recent[0][0] < step.t_ns - _WINDOW_NS:
            self._recent.popleft()

    @property
    def elapsed_ns(self) -> int:
        """From the first step to the newest."""
        return 0 if self._first is None or not self._recent else self._recent[-1][0] - self._first

    @property
    def frames_per_s(self) -> float:
        """Of the last two seconds."""
        return sum(frames for *_, frames in tuple(self._recent)) / self._span_s

    @property
    def load(self) -> float | None:
        """Share of the last two seconds in which the line was busy; None where its speed is not known."""
        character_ns = self.line.character_ns
        if character_ns is None:
            return None
        octets = sum(heard for _, heard, _ in tuple(self._recent))
        return min(1.0, octets * character_ns / 1e9 / self._span_s)

    def parts(self, more: str = "") -> list[str]:
        """What it says, what must not be missed first; `more` stands behind the time."""
        minutes, seconds = divmod(self.elapsed_ns // 1_000_000_000, 60)
        marked = tr("{bytes} with a parity or framing error", bytes=counted(self.marked, "byte", "bytes"))
        words = [
            f"{minutes // 60:d}:{minutes % 60:02d}:{seconds:02d}",
            more,
            not_analysed(self.missed),
            marked if self.marked else "",
            counted(self.errors, "error", "errors"),
            counted(self.warnings, "warning", "warnings") if self.warnings else "",
            "" if self.load is None else tr("load {share}", share=percent(self.load)),
            tr("{rate:.0f} frames/s", rate=self.frames_per_s),
            counted(self.frames, "frame", "frames"),
        ]
        return [part for part in words if part]

    def fitted(self, more: str, width: int) -> str:
        """The same on one line, of which what finds no room is left out whole: half a number says another one."""
        line, *others = self.parts(more)
        for part in others:
            if len(line) + 2 + len(part) > width:
                break
            line += f"  {part}"
        return line[:width]

    def __str__(self) -> str:
        return "  ".join(self.parts())

    @property
    def _span_s(self) -> float:
        return min(_WINDOW_NS, max(self.elapsed_ns, 500_000_000)) / 1e9


@dataclass(frozen=True, slots=True, eq=False)
class UnitTraffic:
    """What one unit's transactions of a step add: counts by the names of `reports.model.Counts`, exceptions by code,
    and response times in ns."""

    unit: int
    counts: Counter[str]
    exceptions: Counter[int] = field(default_factory=Counter)
    times_ns: tuple[int, ...] = ()


def by_unit(settled: TransactionRows) -> Iterator[UnitTraffic]:
    """Settled transactions, a unit at a time."""
    for unit in np.unique(settled.unit).tolist():
        mine = settled[settled.unit == unit]
        counts = Counter(requests=len(mine))
        for name in ("retry", "late"):
            counts[{"retry": "retries"}.get(name, name)] = int(np.count_nonzero(mine.column(name)))
        for status, name in BY_STATUS.items():
            counts[name] = int(np.count_nonzero(mine.status == status))
        raised = Counter(mine.exception[mine.exception > 0].tolist())
        times = mine.response_ns[mine.response_ns >= 0]
        yield UnitTraffic(unit, counts, raised, tuple(times.tolist()))
