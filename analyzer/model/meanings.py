"""What registers mean: the user's own word, else a map's, else what their values tell, else a plain number."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, cast

import numpy as np
from numpy.typing import NDArray

from dissectors.values import Order, readings

from ..languages import tr
from ..registers.hypotheses import numbers

if TYPE_CHECKING:
    from dissectors.maps.model import RegisterMap

    from ..registers.values import RegisterValue
    from .bus import Bus

Spot = tuple[int, int, int]  # unit, area (an AreaCode less 1), address
AREA_WORDS: Final = ("coil", "discrete", "input", "holding")
_BIT_AREAS: Final = 2
_SHOWN_AS: Final = {"enum": "u", "time": "u", "bcd": "u", "text": "text", "bits": "bits", "bool": "u"}
_READ: Final = 1 << 20  # rows that types are told from


@dataclass(frozen=True, slots=True)
class Meaning:
    """How `words` registers from one on are read: `kind` and `order` as `dissectors.values.Reading` has them.

    `source` is who says so: yours, map, told (from the values), or plain. The number is raw * `scale` + `offset`.
    """

    kind: str = "u16"
    order: str | None = None
    words: int = 1
    source: str = "plain"
    name: str = ""
    measure: str = ""
    scale: float = 1.0
    offset: float = 0.0
    why: str = ""

    @property
    def type(self) -> str:
        """`f32 CDAB`."""
        return f"{self.kind} {self.order}" if self.order and self.words > 1 else self.kind

    @property
    def is_number(self) -> bool:
        """Whether it can be plotted."""
        return self.kind not in ("text", "bits")

    def numbers(self, registers: NDArray[np.uint16]) -> NDArray[np.float64]:
        """Readings, one a line, as the numbers that they are."""
        order = cast(Order, self.order or "ABCD")
        raw = numbers(registers, order, is_float=self.kind[0] == "f", signed=self.kind[0] == "s")
        return raw * self.scale + self.offset

    def text(self, values: Sequence[int], *, bit: bool = False) -> str:
        """A reading in words; a dash where a register of it was not seen."""
        if bit:
            return tr("on" if values[0] else "off")
        if len(values) < self.words:
            return "-"
        if self.source == "map" and self.is_number and self.kind != "hex":
            number = float(self.numbers(np.array(values[: self.words], np.uint16)))
            return f"{number:.7g}{' ' + self.measure if self.measure else ''}" if math.isfinite(number) else str(number)
        reading = next(
            (r for r in readings(values[: self.words]) if r.kind == self.kind and r.order == self.order), None
        )
        return "-" if reading is None else reading.text


PLAIN: Final = Meaning()
CHOICES: Final = (
    *(Meaning(kind, None, 1, "yours") for kind in ("u16", "s16", "hex", "bits")),
    Meaning("text", None, 2, "yours"),
    *(Meaning(kind, order, 2, "yours") for kind in ("f32", "u32", "s32") for order in ("ABCD", "CDAB", "BADC", "DCBA")),
    *(Meaning(kind, order, 4, "yours") for kind in ("f64", "u64", "s64") for order in ("ABCD", "CDAB", "BADC", "DCBA")),
)  # fmt: skip


def chosen(type_words: str) -> Meaning | None:
    """The user's word as it is kept: `f32 CDAB`."""
    return next((meaning for meaning in CHOICES if meaning.type == type_words), None)


def told(
    bus: Bus,
    charts_of: Callable[[Iterable[int]], Mapping[int, RegisterMap]],
    stop: Callable[[], bool] = bool,
    types: Mapping[Spot, str] | None = None,
) -> dict[Spot, Meaning]:
    """What maps and the values themselves say, by place; of a long capture its first million rows. Takes a while.
    `types` are the user's own words: they teach what is told of the rest."""
    from ..registers.drafting import with_own_words
    from ..registers.inference import infer
    from ..registers.readings import RegisterReadings

    registers = RegisterReadings()
    for _, batch in bus.batches(0, min(bus.count, _READ)):
        if stop():
            return {}
        registers.feed(batch)
    charts = with_own_words(charts_of({block.unit for block in registers}), own_words(types or {}))
    return dict(_meanings(infer(registers, charts=charts)))


def own_words(types: Mapping[Spot, str]) -> dict[tuple[int, str, int], str]:
    """The user's words as notes keep them, by unit, area's name and address."""
    return {(unit, AREA_WORDS[area], address): words for (unit, area, address), words in types.items()}


def _meanings(values: Iterable[RegisterValue]) -> Iterable[tuple[Spot, Meaning]]:
    for value in values:
        spot = value.unit, AREA_WORDS.index(value.area), value.address
        mapped = value.name is not None
        kind = value.type
        if spot[1] < _BIT_AREAS:
            kind = "u16"
        elif kind.rstrip("0123456789") in _SHOWN_AS:
            shown = _SHOWN_AS[kind.rstrip("0123456789")]
            kind = shown if shown != "u" else f"u{16 * value.words}"
        words = value.words
        if kind == "bits" or (kind == "text" and words not in (1, 2, 4)):
            words = 1 if kind == "bits" else 2
        if words not in (1, 2, 4):
            kind, words = "u16", 1
        yield (
            spot,
            Meaning(
                kind,
                (value.order or "ABCD") if words > 1 and kind != "text" else None,
                words,
                "map" if mapped else "told",
                value.name or "",
                value.unit_of_measure or "",
                value.scale if value.scale is not None else 1.0,
                why=f"{value.confidence:.0%} sure: {value.why}",
            ),
        )
