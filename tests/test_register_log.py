"""The log of registers knows nothing beyond the last address: no other area, no other unit."""

from __future__ import annotations

import struct

import pytest
from buses import LINE
from diagnosed import Wire

from analyzer.core import analyse
from analyzer.model.bus import Bus
from analyzer.model.registers import RegisterLog, RegisterSeries
from analyzer.model.source import CaptureSource
from captures.chunks import Capture
from dissectors.crc import crc_bytes

INPUT, HOLDING = 2, 3


def polled(*reads: tuple[int, int, int, list[int]]) -> Bus:
    """A bus on which each of (unit, function, address, words) was read some times."""
    wire = Wire()
    for _ in range(4):
        for unit, function, address, words in reads:
            request = struct.pack(">BBHH", unit, function, address, len(words))
            answer = struct.pack(f">BBB{len(words)}H", unit, function, 2 * len(words), *words)
            wire.exchange(request + crc_bytes(request), answer + crc_bytes(answer))
    capture = Capture.of(LINE, wire.chunks)
    bus = Bus.of(CaptureSource(capture, "bus"))
    for analysed in analyse(capture):
        bus.feed(analysed)
    bus.close()
    return bus


@pytest.mark.parametrize(("unit", "function", "area"), [(7, 4, INPUT), (255, 3, HOLDING)])
def test_a_value_beyond_the_last_address_is_not_known(unit: int, function: int, area: int) -> None:
    bus = polled((unit, function, 0xFFFF, [11]), (unit, 3, 0, [22, 33]))
    begin, alone = bus.registers.samples(unit, area, 0xFFFF, 1)
    assert (begin, set(alone[:, 0].tolist())) == (0, {11})
    for words in (2, 4):
        begin, samples = bus.registers.samples(unit, area, 0xFFFF, words)
        assert (begin, samples.shape) == (0, (0, words))
        assert not len(RegisterSeries(unit, area, 0xFFFF, words).extend(bus).readings()[2])


def test_nothing_is_known_of_a_register_before_any_was_seen() -> None:
    log = RegisterLog()
    assert log.at((1, 2, 5)) is None and not log.all()
    assert log.samples(1, 2, 5, 2)[1].shape == (0, 2)
