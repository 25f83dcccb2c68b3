"""Field cases as the analysis heard them, kept on disk from run to run.

To make a capture bit by bit and to find its frames takes nearly all the time of a score; what becomes of the frames is
what a change of the causes changes. So the rows of each case are kept, under a name made of the sources that they hang
on: other sources, another name.
"""

from __future__ import annotations

import hashlib
import pickle
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import captures
from analyzer.causes.ledger import Ledger, ledger_of
from analyzer.core import analyse
from analyzer.simulation.field.bench import Expected
from analyzer.simulation.field.cases.registry import FieldCase
from captures.chunks import Capture
from captures.line import LineSettings

_ROOT = Path(captures.__file__).parent.parent
_SOURCES = (
    "captures",
    "dissectors",
    "analyzer/deframing",
    "analyzer/simulation",
    "analyzer/tables",
    "analyzer/core.py",
)
_CASES = "analyzer/simulation/field/cases"  # of these only the one that a case stands in
HELD_OUT = 1000  # seeds from here on are looked at when all is fitted


@dataclass(frozen=True)
class HeardCase:
    """One capture of a case: its rows with their transactions, and what is so."""

    name: str
    tap: str
    seed: int
    line: LineSettings
    expected: Expected
    lost: int
    parts: list[tuple[Any, Any]]

    def ledger(self, most: int | None = None) -> Ledger:
        """What the causes see of it, or of its first so many rows: a capture that was broken off."""
        return ledger_of(self.parts if most is None else self._first(most), self.line)

    def _first(self, most: int) -> Iterator[tuple[Any, Any]]:
        for batch, transactions in self.parts:
            rows = batch.rows[:most]
            if len(rows):
                yield replace(batch, rows=rows), transactions[transactions.request <= rows.index[-1]]
            most -= len(rows)


@cache
def _version(module: str) -> str:
    every = (file for name in _SOURCES for file in sorted((_ROOT / name).rglob("*.py")) or [_ROOT / name])
    files = [file for file in every if file.parent != _ROOT / _CASES or file.stem == module.rpartition(".")[2]]
    own = Path(str(sys.modules[module].__file__)).resolve()
    files += [own] if own not in files else []  # of a benchmark's case
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]


def _folder() -> Path:
    folder = Path(tempfile.gettempdir()) / "rtuscope-cases"
    folder.mkdir(exist_ok=True)
    return folder


def heard(case: FieldCase, tap: str, seed: int) -> HeardCase:
    """The capture of one seed, from disk where it was made before from the same sources."""
    kept = _folder() / f"{case.name}-{tap}-{seed}-{_version(case.play.__module__)}.pickle"
    if kept.exists():
        before: HeardCase = pickle.loads(kept.read_bytes())
        return before
    made = case.capture(tap, seed)
    capture = Capture.of(made.line, made.chunks, timed=made.line.tap != "untimed")
    parts = [(part.batch, part.transactions) for part in analyse(capture)]
    found = HeardCase(case.name, tap, seed, capture.line, made.expected, len(made.lost()), parts)
    kept.write_bytes(pickle.dumps(found, pickle.HIGHEST_PROTOCOL))
    return found
