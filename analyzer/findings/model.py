"""A finding: what was seen and measured, how grave it is, what probably causes it and what to do.

Findings travel as rows of `FINDING`, a few numbers each, and become words (`Finding`) only where somebody reads them.
Observation is not root cause: `text` says what was seen, `cause` what it likely comes from.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import isfinite
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .registry import Rule

NUMBERS: Final = 8  # figures of evidence that a finding carries at most
FINDING: Final = np.dtype(
    [
        ("rule", np.int16),  # position of its code in `registry.codes()`
        ("index", np.int64),  # number of the frame; -1 for noise and for what concerns the bus as a whole
        ("start", np.int64),  # offset of the bytes meant in their port's stream; -1 for the bus as a whole
        ("length", np.int64),  # bytes
        ("port", np.uint8),
        ("t", np.int64),  # ns, start of those bytes
        ("numbers", np.float64, (NUMBERS,)),  # evidence, named by the rule; NaN where unknown
    ]
)
Findings = NDArray[np.void]
NOTHING: Final[Findings] = np.zeros(0, FINDING)


class Severity(IntEnum):
    """How grave a finding is."""

    NOTE = 1
    WARNING = 2
    ERROR = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding in words.

    `numbers` is the evidence by name (the name's end is its unit: `_ms`, `_bytes`), unknown ones left out; `clause` is
    what of the specification it rests on, or empty. `index` is None where no frame is meant, `start` and `length` are
    -1 and 0 where the whole bus is.
    """

    code: str
    severity: Severity
    text: str
    cause: str
    remedy: str
    clause: str
    numbers: Mapping[str, float]
    index: int | None
    start: int
    length: int
    port: int
    t_ns: int

    def to_json(self) -> dict[str, Any]:
        """The object that stands in a frame's JSON line."""
        line: dict[str, Any] = {"code": self.code, "severity": self.severity.name.lower(), "text": self.text}
        for key in ("cause", "remedy", "clause"):
            if value := getattr(self, key):
                line[key] = value
        if self.numbers:
            line["numbers"] = {key: int(n) if n == int(n) else round(n, 6) for key, n in self.numbers.items()}
        return line


def evidence(rule: Rule, numbers: Iterable[float]) -> dict[str, float]:
    """The numbers of a row of `FINDING` by the names that its rule gives them, unknown ones left out."""
    return {name: number for name, number in zip(rule.numbers, numbers, strict=False) if isfinite(number)}


def describe(row: np.void) -> Finding:
    """A row of `FINDING` in words."""
    from .registry import rules

    rule = rules()[row["rule"]]
    index = int(row["index"])
    numbers = evidence(rule, row["numbers"].tolist())
    return Finding(
        code=rule.code,
        severity=rule.severity,
        text=rule.words(rule.text, numbers),
        cause=rule.words(rule.cause, numbers),
        remedy=rule.words(rule.remedy, numbers),
        clause=rule.clause,
        numbers=numbers,
        index=None if index < 0 else index,
        start=int(row["start"]),
        length=int(row["length"]),
        port=int(row["port"]),
        t_ns=int(row["t"]),
    )
