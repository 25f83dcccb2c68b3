"""A cause: the one thing that is wrong, with its evidence in numbers, what it costs, how to be sure and what to do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from ..html_text import html_page, html_table

if TYPE_CHECKING:
    from .registry import Symptom


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
    explains: frozenset[tuple[Symptom, int | None]] = frozenset()  # for `links`: which findings point here
    numbers: Mapping[str, Any] = field(default_factory=dict, compare=False)  # that its words are filled with

    def _repr_html_(self) -> str:
        """For notebooks."""
        lines = [
            ("share", self.share),
            ("likely", f"{self.confidence:.0%}" + (f", else {self.runner_up}" if self.runner_up else "")),
            ("lost answers", self.lost_answers),
            ("to be sure", self.deciding_test),
            ("remedy", self.remedy),
            ("frames", ", ".join(map(str, self.frames))),
        ]
        told = [line for line in lines if line[1] not in (None, "")]
        return html_page(f"{self.severity}: {self.cause}: {self.text}", html_table((), told))

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        plain = {**asdict(self), "units": list(self.units), "frames": list(self.frames)}
        del plain["explains"], plain["numbers"]
        return plain
