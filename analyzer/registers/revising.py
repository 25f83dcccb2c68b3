"""What the registers of a bus mean while it is heard: types are told once there is evidence, and revised as it grows.

    registers = RevisedRegisters(charts, words)
    for batch in batches:
        for revision in registers.feed(batch):
            print(revision.text)
    registers.charts                # maps of units by which values are named and read

Types are asked for anew when there are half as many readings again, so that it costs little however long one listens.
The answer is that of the same readings in a file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from dissectors.maps.files import UnitMaps
from dissectors.maps.model import RegisterMap

from ..tables.batch import Batch
from .drafting import Place, drafted_map, with_own_words
from .inference import infer
from .readings import RegisterReadings, is_due
from .values import RegisterValue

_LEAST: Final = 12  # readings of a value
_SURE: Final = 0.6


@dataclass(frozen=True, slots=True)
class Revision:
    """A value that is told for the first time (`before` None), or read otherwise than before."""

    before: RegisterValue | None
    value: RegisterValue

    @property
    def text(self) -> str:
        """`unit 1 input 100-101 is f32 ABCD, was u32 ABCD (98%: ...)`."""
        was = f", was {typed(self.before)}" if self.before is not None else ""
        role = f", {self.value.role}" if self.value.role else ""
        return f"{placed(self.value)} is {typed(self.value)}{role}{was} ({self.value.confidence:.0%}: {self.value.why})"

    def to_json(self) -> dict[str, Any]:
        """A line of kind `register` that holds the value as `rtuscope registers --json` writes it."""
        return {"kind": "register", "register": self.value.to_json()}


class RevisedRegisters:
    """The values of a live bus. `values` are those of the last time that they were asked for."""

    def __init__(
        self, charts: Mapping[int, RegisterMap] | None = None, words: Mapping[Place, str] | None = None
    ) -> None:
        self._declared = charts or {}
        self._words = dict(words or {})
        self._readings = RegisterReadings()
        self._revised_at = 0
        self._reported: dict[Place, RegisterValue] = {}
        self.values: list[RegisterValue] = []
        self.charts = UnitMaps()

    def feed(self, batch: Batch) -> list[Revision]:
        """Take in a batch; what is told for the first time or otherwise now, mostly nothing."""
        self._readings.feed(batch)
        return self.revise() if is_due(self._revised_at, self._readings.frames) else []

    def say(self, place: Place, type_words: str) -> list[Revision]:
        """The user's own word (empty: taken back), which overrules; what else it changes."""
        if type_words:
            self._words[place] = type_words
        else:
            self._words.pop(place, None)
        return self.revise()

    def revise(self) -> list[Revision]:
        """Ask anew, and say what changed."""
        self._revised_at = self._readings.frames
        units = sorted({block.unit for block in self._readings})
        declared = self._declared.of(units) if isinstance(self._declared, UnitMaps) else self._declared
        settled = with_own_words(declared, self._words)
        self.values = infer(self._readings, charts=settled)
        fresh = [value for value in self.values if _is_sure(value)]
        self.charts = UnitMaps({**{unit: _readable(fresh, unit) for unit in units if unit not in declared}, **declared})
        revisions = [Revision(self._reported.get(value.key), value) for value in fresh]
        revisions = [one for one in revisions if one.before is None or typed(one.before) != typed(one.value)]
        self._reported = {value.key: value for value in fresh}
        return revisions


def typed(value: RegisterValue) -> str:
    """`f32 CDAB`."""
    return f"{value.type} {value.order}" if value.order else value.type


def placed(value: RegisterValue) -> str:
    """`unit 1 input 100-101`."""
    last = f"-{value.address + value.words - 1}" if value.words > 1 else ""
    return f"unit {value.unit} {value.area} {value.address}{last}"


def _is_sure(value: RegisterValue) -> bool:
    """Whether enough is known of a value: that it moved, and how it is read; or somebody said so."""
    if value.area in ("coil", "discrete") or value.confidence < _SURE:
        return False
    said = value.scale is not None  # by a map, or the user
    return said or (value.readings >= _LEAST and (value.changes > 0 or value.kind == "text"))


def _readable(values: Sequence[RegisterValue], unit: int) -> RegisterMap:
    return drafted_map([value for value in values if value.unit == unit], f"unit {unit}", "told live")
