"""Values out of a map's limits: plain records of evidence; whether it is a cause is judged elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dissectors.maps.model import RegisterMap

from .checking import check_map
from .readings import RegisterReadings


@dataclass(frozen=True, slots=True)
class LimitBreach:
    """A mapped value that was seen beyond its least or greatest value, in words."""

    unit: int
    text: str


def limit_breaches(readings: RegisterReadings, charts: Mapping[int, RegisterMap]) -> list[LimitBreach]:
    """The values that their maps do not allow, by unit and address."""
    return [
        LimitBreach(remark.unit, f"{remark.name}: {remark.text}")
        for remark in sorted(check_map(readings, charts), key=lambda one: (one.unit, one.area, one.address))
        if remark.kind == "contradiction" and ("least value" in remark.text or "greatest value" in remark.text)
    ]
