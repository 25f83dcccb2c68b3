"""Examples of what was found: of each rule the first two places that are not alike, with frame or noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from ...tables.batch import Batch, rows_of_findings
from ...tables.findings import Finding, Findings, describe
from ...tables.frame import Frame
from ...tables.schema import Kind
from .troublebins import TroubleBins

if TYPE_CHECKING:
    from ...core import Analysed


_EACH: Final = 2
_LOOKED: Final = 64  # places of a batch that are looked at for them
_NOISE: Final = 32  # bytes kept of a stretch of noise


@dataclass(frozen=True, slots=True)
class FindingExample:
    """One finding with the bytes that it is about.

    `frame` is None for noise, of which `noise` holds the bytes from the finding on, the first ones; `length` is how
    many there are.
    """

    finding: Finding
    frame: Frame | None
    noise: bytes
    length: int


class Examples:
    """The first findings of each rule that have a place."""

    def __init__(self) -> None:
        self._by_rule: dict[int, list[FindingExample]] = {}
        self._by_code: dict[str, list[FindingExample]] = {}

    def of(self, code: str) -> list[FindingExample]:
        """Those of one code; none where it speaks of the bus as a whole."""
        return self._by_code.get(code, [])

    def add(self, batch: Batch, findings: Findings) -> None:
        """Keep what is still missing."""
        for number in np.flatnonzero(np.bincount(findings.rule)).tolist():
            examples = self._by_rule.setdefault(number, [])
            missing = _EACH - len(examples)
            mine = np.flatnonzero((findings.rule == number) & (findings.start >= 0)) if missing > 0 else ()
            for place in mine[:_LOOKED]:
                example = _example(batch, findings[place : place + 1])
                if example is not None and _kind(example) not in map(_kind, examples):
                    examples.append(example)
                    self._by_code[example.finding.code] = examples
                if len(examples) == _EACH:
                    break


def _kind(example: FindingExample) -> tuple[float | None, ...]:
    """What tells examples apart: two of one unit, function and variant are alike."""
    figures = example.finding.numbers
    return tuple(figures.get(name) for name in ("unit", "function", "code", "pattern", "variant", "mistaken"))


def _example(batch: Batch, one: Findings) -> FindingExample | None:
    """The finding with the row that holds its first byte; None where this batch has no such row."""
    rows = batch.rows
    number = int(rows_of_findings(rows, one)[0])
    if number < 0:
        return None
    finding = describe(one, 0)
    if rows.kind[number] != Kind.NOISE:
        return FindingExample(finding, batch.frame(number), b"", finding.length)
    noise = batch.bytes_of(number)[finding.start - int(rows.start[number]) :]
    return FindingExample(finding, None, noise[:_NOISE], len(noise))


# What the page shows beyond the counts of a report, collected as batches come, in flat memory.


class Sights:
    """The bus over time, and examples of what was found."""

    def __init__(self) -> None:
        self.timeline = TroubleBins()
        self.examples = Examples()

    def feed(self, analysed: Analysed) -> None:
        """See one batch."""
        self.timeline.add(analysed.batch.rows, analysed.findings)
        self.examples.add(analysed.batch, analysed.findings)
