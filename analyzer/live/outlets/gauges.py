"""What registers held when they were answered last, as gauges of OpenMetrics: `modbus_value`, by the register maps.

A value that its poll no longer brings goes stale and is served no more, so that nobody takes it for what is.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

from dissectors.maps.model import RegisterMap

from ..lines import FrameCache, confirmed_readings
from .freshness import Freshness

if TYPE_CHECKING:
    from dissectors.maps.model import MappedReading

    from ...tables.batch import Batch

_LABELS: Final = ("unit", "area", "address", "name", "unit_of_measure")


class ValueGauges:
    """A collector of prometheus_client; `clock` is steady, in seconds."""

    def __init__(self, charts: Mapping[int, RegisterMap], clock: Callable[[], float] = time.monotonic) -> None:
        self._readings: FrameCache[list[MappedReading]] = FrameCache(lambda frame: confirmed_readings(frame, charts))
        self._charts, self._clock = charts, clock
        self._values: dict[tuple[str, ...], tuple[float, Freshness]] = {}  # by labels

    def feed(self, batch: Batch) -> None:
        """Take what the answers of a batch hold."""
        now_s = self._clock()
        for frame in batch.frames() if self._charts else ():
            for reading in self._readings.of(frame):
                row, value = reading.row, reading.value
                if isinstance(value, int | float) and math.isfinite(value):
                    labels = (str(frame.unit), row.area, str(row.address), row.name, row.unit)
                    _, fresh = self._values.get(labels) or (0.0, Freshness())
                    fresh.heard(now_s)
                    self._values[labels] = float(value), fresh

    def collect(self) -> Iterator[Any]:
        """The values that are not stale; called as somebody scrapes, in a thread of its own."""
        from prometheus_client.core import GaugeMetricFamily

        now_s, words = self._clock(), "Values of mapped registers, as the newest answers have them"
        family = GaugeMetricFamily("modbus_value", words, labels=_LABELS)
        for labels, (value, fresh) in list(self._values.items()):
            fresh.goes_stale(now_s)
            if not fresh.stale:
                family.add_metric(labels, value)
        yield family
