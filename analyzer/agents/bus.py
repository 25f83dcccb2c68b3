"""A capture as the tools ask for it: read through once, and its facts kept while the file stays the same."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from ..analysis import Analysis
from ..analysis import open as open_capture
from ..errors import under_base
from ..registers.inference import infer
from ..registers.readings import RegisterReadings
from ..registers.recognition import UnitTexts, recognised
from ..reports import summarize
from ..reports.hashes import file_sha256
from ..tables.columns import AreaCode, decode
from ..tables.schema import Kind
from ..tables.values import confirmed_values

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps

    from ..core import Analysed
    from ..registers.recognition import Recognised
    from ..registers.roles import RegisterValue
    from ..reports import Report
    from ..tables.batch import Batch

_KEPT: Final = 4  # captures whose facts are kept
AREAS: Final = {
    "coil": AreaCode.COILS,
    "discrete": AreaCode.DISCRETE_INPUTS,
    "input": AreaCode.INPUT_REGISTERS,
    "holding": AreaCode.HOLDING_REGISTERS,
}
Span = tuple[int, int]


@dataclass(slots=True)
class _Seen:
    """First and last frame of something."""

    first: int
    last: int

    @property
    def frames(self) -> tuple[int, ...]:
        return (self.first, self.last)


class CaptureFacts:
    """What one pass over a capture tells: the report, readings of registers, and which frames show what."""

    def __init__(self, path: Path) -> None:
        """Raises RtuscopeError where it is no usable capture."""
        self.sha256 = file_sha256(path)
        self.analysis = open_capture(path)
        self.readings, self.texts = RegisterReadings(), UnitTexts()
        self.whole: _Seen | None = None
        self._units: dict[int, _Seen] = {}
        self._blocks: dict[tuple[int, int, Span], _Seen] = {}  # unit, area, addresses
        with under_base():
            self.report: Report = summarize(self.analysis.capture, watch=self._feed)

    def _feed(self, analysed: Analysed) -> None:
        batch = analysed.batch
        self.readings.feed(batch)
        self.texts.feed(batch)
        frames = batch.rows[batch.rows.kind != Kind.NOISE]
        for unit in np.unique(frames.unit).tolist():
            own = frames.index[frames.unit == unit]
            self._units[unit] = _widened(self._units.get(unit), int(own[0]), int(own[-1]))
        if len(frames):
            self.whole = _widened(self.whole, int(frames.index[0]), int(frames.index[-1]))
        self._feed_blocks(batch)

    def _feed_blocks(self, batch: Batch) -> None:
        told = confirmed_values(batch, decode(batch))
        keys = np.stack(
            (batch.rows.unit[told.rows].astype(np.int64), told.area.astype(np.int64), told.address, told.counts)
        )
        for column in np.unique(keys, axis=1).T.tolist():
            unit, area, address, count = column
            own = batch.rows.index[told.rows[(keys == np.array([column]).T).all(axis=0)]]
            key = unit, area, (address, address + count)
            self._blocks[key] = _widened(self._blocks.get(key), int(own[0]), int(own[-1]))

    def frames_of_unit(self, unit: int) -> tuple[int, ...]:
        """Its first frame and its last."""
        seen = self._units.get(unit)
        return () if seen is None else seen.frames

    def frames_of_register(self, unit: int, area: str, address: int, words: int) -> tuple[int, ...]:
        """The first answer that tells all of these registers, and the last."""
        held = [
            seen
            for (whose, where, (begin, end)), seen in self._blocks.items()
            if (whose, where) == (unit, AREAS[area]) and begin <= address and address + words <= end
        ]
        return (min(each.first for each in held), max(each.last for each in held)) if held else ()

    @cached_property
    def recognised(self) -> list[Recognised]:
        """What the units look like."""
        return recognised(self.readings, self.texts, infer(self.readings))

    def registers(self, unit: int | None, maps: UnitMaps | None) -> list[RegisterValue]:
        """What the registers mean, of one unit or of all."""
        named = {} if maps is None else maps.of({block.unit for block in self.readings})
        return infer(self.readings, units=None if unit is None else [unit], charts=named)

    def values(self, unit: int, area: str, address: int, words: int) -> Iterator[tuple[int, int, list[int]]]:
        """Each answer that tells these registers: its frame, when it ended (ns), what they held."""
        for batch in self.analysis.batches():
            told = confirmed_values(batch, decode(batch))
            ends = told.address + told.counts
            own = (batch.rows.unit[told.rows] == unit) & (told.area == AREAS[area])
            for each in np.flatnonzero(own & (told.address <= address) & (ends >= address + words)).tolist():
                begin = int(told.begins[each] + address - told.address[each])
                row = int(told.rows[each])
                held = told.values[begin : begin + words].tolist()
                yield int(batch.rows.index[row]), int(batch.rows.t_end_ns[row]), held


def _widened(seen: _Seen | None, first: int, last: int) -> _Seen:
    return _Seen(first, last) if seen is None else _Seen(min(seen.first, first), max(seen.last, last))


class KeptFacts:
    """Facts of the captures asked for last, each read anew once its file is another; several threads may ask."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Path, tuple[tuple[int, ...], CaptureFacts]] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, path: Path) -> CaptureFacts:
        """Raises RtuscopeError where it is no usable capture."""
        with self._lock:
            state = path.stat()
            now = (state.st_ino, state.st_size, state.st_mtime_ns)
            then, facts = self._kept.get(path, ((), None))
            if facts is None or then != now:
                facts = CaptureFacts(path)
            self._kept[path] = (now, facts)
            self._kept.move_to_end(path)
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
            return facts


def narrowed(facts: CaptureFacts, text: str) -> Analysis:
    """The capture, or what of it passes a filter. Raises FilterError."""
    return facts.analysis.filter(text) if text.strip() else facts.analysis
