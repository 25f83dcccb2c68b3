"""A master that polls devices with maps, and what was really served.

It asks in blocks as masters do: values that lie near each other in one request, gaps and a few registers beyond the
edges included; some masters ask value by value, some for part of the map only. Now and then it writes a setpoint.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from typing import Final

from dissectors.maps.model import READ_FUNCTIONS, MapArea, MappedValue, RegisterMap

from ..conversation import Exchange, adu
from ..truth import TruthRegister
from .device import MappedDevice, encoded

_LAST: Final = 0x10000
_MOST: Final = 125
_TIDY: Final = 0.9
_EVEN: Final = 0.08
_WRITES: Final = 0.004  # of the exchanges


@dataclass(frozen=True, slots=True)
class PolledBlock:
    """A block that the master asks for again and again."""

    device: MappedDevice
    area: MapArea
    address: int
    quantity: int


class MappedClient:
    """Polls its devices in turn; `exchange` gives the next request with its answer."""

    def __init__(self, random: Random, charts: list[tuple[int, RegisterMap]], wild: float = 0.0) -> None:
        self._random = random
        seconds = 10 ** random.uniform(-0.3, 1.8)
        self.devices = [
            MappedDevice(unit, chart, random.uniform(2.5e6, 31e6), seconds, random, wild) for unit, chart in charts
        ]
        self.polls = [poll for device in self.devices for poll in _polls(random, device, _EVEN if wild else 0.0)]
        self._turn = 0
        self._settable = [(d, row) for d in self.devices for row in d.chart.rows if row.writable and row.length <= 4]

    def exchange(self) -> Exchange:
        """The next poll in the list, or a write of a setpoint."""
        if self._settable and self._random.random() < _WRITES:
            return self._write(*self._random.choice(self._settable))
        poll = self.polls[self._turn % len(self.polls)]
        if self._turn and self._turn % len(self.polls) == 0:
            for device in self.devices:
                device.step()
        self._turn += 1
        words = poll.device.read(poll.area, poll.address, poll.quantity)
        function = READ_FUNCTIONS[poll.area]
        if poll.area in ("coil", "discrete"):
            packed = sum(bit << position for position, bit in enumerate(words))
            data = packed.to_bytes((len(words) + 7) // 8, "little")
        else:
            data = struct.pack(f">{len(words)}H", *words)
        request = struct.pack(">BHH", function, poll.address, poll.quantity)
        response = bytes((function, len(data))) + data
        unit = poll.device.unit
        return Exchange(adu(unit, request), adu(unit, response), poll.device.response_ns)

    def registers(self) -> list[TruthRegister]:
        """What each value that is polled really is, by unit, area and address."""
        polled = {(poll.device.unit, poll.area, poll.address, poll.quantity) for poll in self.polls}
        truths = {}
        for unit, area, address, quantity in polled:
            chart = next(device.chart for device in self.devices if device.unit == unit)
            for row in chart.within(area, address, quantity):
                truths[unit, area, row.address, row.length] = TruthRegister.of(unit, row)
        return [truths[key] for key in sorted(truths)]

    def _write(self, device: MappedDevice, row: MappedValue) -> Exchange:
        random = self._random
        low = 0.0 if row.minimum is None else row.minimum
        high = low + 100 * abs(row.scale) if row.maximum is None else row.maximum
        number = float(random.choice(list(row.values))) if row.values else random.uniform(low, high)
        words = encoded(row, number)
        device.write(row.area, row.address, words)
        if row.area == "coil":
            pdu = struct.pack(">BHH", 5, row.address, 0xFF00 if words[0] else 0)
            answer = pdu
        elif row.length == 1 and random.random() < 0.8:
            pdu = answer = struct.pack(">BHH", 6, row.address, words[0])
        else:
            pdu = struct.pack(f">BHHB{len(words)}H", 16, row.address, len(words), 2 * len(words), *words)
            answer = pdu[:5]
        return Exchange(adu(device.unit, pdu), adu(device.unit, answer), device.response_ns)


def _polls(random: Random, device: MappedDevice, even: float) -> list[PolledBlock]:
    """The blocks in which a master asks for a device's values; by chance `even` so many registers at a time, whatever a
    map says of them."""
    reach = random.choice((0, 1, 2, 4, 8, 16, 40, 40))
    longest = random.choice((2, 10, 20, 40, 60, 100, 125, 125))
    share = random.choice((1.0, 1.0, 1.0, 0.7, 0.4))
    beyond = random.choice((0, 0, 0, 1, 2, 5))
    polls: list[PolledBlock] = []
    for area in READ_FUNCTIONS:
        rows = sorted((row for row in device.chart.rows if row.area == area), key=lambda row: row.address)
        chosen = [row for row in rows if random.random() < share] or rows[:1]
        blocks = _neighbours(chosen, reach, longest)
        if chosen and even and random.random() < even:
            blocks = _even_blocks(chosen, random.choice((10, 16, 25, 50, 100)))
        for block in blocks:
            first, last = _asked_for(random, block, rows, beyond)
            polls.append(PolledBlock(device, area, first, last - first))
    return polls


def _neighbours(rows: Sequence[MappedValue], reach: int, longest: int) -> list[tuple[int, int]]:
    """Values by address in blocks [begin, end): with gaps of so many registers, and so long, at most."""
    blocks: list[tuple[int, int]] = []
    for row in rows:
        begin, end = blocks[-1] if blocks else (row.address, row.address)
        if row.address - end <= reach and row.end - begin <= max(longest, row.length):
            blocks[-1:] = [(begin, max(end, row.end))]
        else:
            blocks.append((row.address, row.end))
    return blocks


def _even_blocks(rows: Sequence[MappedValue], stretch: int) -> list[tuple[int, int]]:
    """Blocks of so many registers each, from the first value to the last, without those that hold none."""
    stop = rows[-1].end
    blocks = [(begin, min(begin + stretch, stop)) for begin in range(rows[0].address, stop, stretch)]
    return [(begin, end) for begin, end in blocks if any(begin <= row.address < end for row in rows)]


def _asked_for(random: Random, block: tuple[int, int], rows: Sequence[MappedValue], beyond: int) -> tuple[int, int]:
    """A block as a master asks for it: by chance some registers more, from a round number on, with its values whole."""
    begin, end = block
    first = max(0, begin - (random.randint(0, beyond) if beyond else 0))
    last = min(_LAST, end + (random.randint(0, beyond) if beyond else 0))
    if random.random() < 0.15:
        first -= first % 10
    if random.random() < _TIDY:  # few masters cut a value in two
        first = min((row.address for row in rows if row.address < first < row.end), default=first)
        last = max((row.end for row in rows if row.address < last < row.end), default=last)
    return (first, last) if last - first <= _MOST else block
