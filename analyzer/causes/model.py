"""A cause: the one thing that is wrong, with its evidence in numbers, what it costs, how to be sure and what to do."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Cause:
    """One cause that explains many findings.

    `units` the most concerned first; `blame`: unit, master, line or tap; `share` says of how many; `since_ns` and
    `until_ns` None without times, `period_s` None where it does not recur; `confidence` 0 to 1; `runner_up` the id of
    the next best explanation, or None; `lost_answers` and `lost_ms` None where nobody knows; `frames`: indices of a
    few requests or frames that show it; `bits`: how much likelier the capture is with it than without; `explains`:
    codes of findings with the unit each stands on (None: the bus), which follow from it.
    """

    cause: str
    severity: str
    units: tuple[int, ...]
    blame: str
    text: str
    share: str
    since_ns: int | None
    until_ns: int | None
    period_s: float | None
    confidence: float
    runner_up: str | None
    deciding_test: str
    remedy: str
    lost_answers: int | None
    lost_ms: float | None
    frames: tuple[int, ...]
    bits: float
    explains: frozenset[tuple[str, int | None]] = frozenset()

    def is_behind(self, code: str, unit: int | None) -> bool:
        """Whether findings of a code on a unit follow from it; `unit` None: on no unit in particular."""
        return (code, unit) in self.explains or (unit is None and any(code == each for each, _ in self.explains))

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        codes = sorted({code for code, _ in self.explains})
        return {**asdict(self), "units": list(self.units), "frames": list(self.frames), "explains": codes}
