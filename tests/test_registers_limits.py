"""Values out of the limits of their map."""

from __future__ import annotations

import numpy as np
import pytest

from analyzer.registers.checking import limit_breaches
from analyzer.registers.readings import RegisterReadings
from dissectors.maps import RegisterMap
from dissectors.maps.model import MappedValue


@pytest.mark.parametrize(("maximum", "said"), [(200.0, "greatest value 200"), (500.0, None)])
def test_numbers_out_of_a_maps_limits(maximum: float, said: str | None) -> None:
    volts = (230 + np.arange(120) % 7).astype(">f4").view(">u2").reshape(-1, 2).astype(np.uint16)
    readings = RegisterReadings()
    readings.put(1, "input", 100, volts, np.arange(120) * 1_000_000_000)
    row = MappedValue("input", 100, "Voltage", "f32", length=2, unit="V", maximum=maximum)
    found = limit_breaches(readings, {1: RegisterMap("x", (row,))})
    assert [breach.unit for breach in found] == ([1] if said else [])
    assert not said or ("Voltage" in found[0].text and said in found[0].text)
