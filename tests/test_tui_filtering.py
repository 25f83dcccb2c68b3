"""A filter in the interface passes the rows that it passes in an export, though it reads the bytes of few."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pdus import SMALL, batches

import captures
from analyzer.core import Analysed
from analyzer.filters import BatchTable, compile_filter
from analyzer.model.bus import Bus
from analyzer.model.selection import PieceTable, compiled
from analyzer.model.source import CaptureSource
from analyzer.tables.columns import decode
from analyzer.tables.findings import NOTHING
from analyzer.tables.transactions import TransactionRows
from captures import samples
from captures.line import LineSettings


def alike(bus: Bus, texts: list[str]) -> None:
    """Each passes in any stretch of the model what it passes of those rows as a batch."""
    for low in {0, bus.count // 2}:
        batch = bus.batch(np.arange(low, bus.count))
        for text in texts:
            own = compiled(text, bus.line).test(bus, 0, low, bus.count)
            exported = compile_filter(text).mask(BatchTable(batch, bus.line))
            assert own.tolist() == exported.tolist(), (text, low)


def bus_of(name: str) -> Bus:
    """A sample, read."""
    source = CaptureSource(captures.open(samples.path(name)), name)
    bus = Bus.of(source)
    for analysed in source.steps(bool):
        bus.feed(analysed)
    bus.close()
    return bus


def of_values(values: list[int]) -> list[str]:
    return [
        *(f"value == {value}" for value in values),
        *(f"signed_value == {value - (value >> 15 << 16)}" for value in values),
        *(f"response and value == {value}" for value in values),
        "value > 65000",
        "signed_value < -30000",
        "value != 0",
    ]


@pytest.mark.parametrize("name", ["troubled.jsonl", "healthy.jsonl", "mbpoll.mcap"])
def test_values_of_a_capture(name: str) -> None:
    bus = bus_of(name)
    values = decode(bus.batch(np.arange(bus.count))).values
    rare = [value for value in np.unique(values).tolist() if value > 1]
    octets = PieceTable(bus, 0, 0, bus.count).octets(0, bus.count)
    assert octets is not None and rare
    alike(bus, of_values(rare[:: max(1, len(rare) // 12)]))


_OF_FEW = (
    "unit == {unit} and register == {register}",
    "unit == {unit} and register == {register} and value > 3",
    "unit == {unit} and not (register == {register} and value > 3)",
    "unit == {unit} and quantity > 2 and not exception",
    "exception or unit == {unit} and bit in 1..20",
    "unit == 250 and register == {register} and signed_value < 0",
    "response or register == {register}",
    "index < 40 and address == 107 and value != 0",
)


@pytest.mark.parametrize("name", ["troubled.jsonl", "healthy.jsonl", "mbpoll.mcap"])
def test_what_few_rows_hold_is_told_as_of_all(name: str) -> None:
    bus = bus_of(name)
    units = np.unique(bus.table.column(0, "unit")[: bus.count]).tolist()
    alike(
        bus,
        [text.format(unit=unit, register=number) for text in _OF_FEW for unit in units for number in (40108, 30009)],
    )


@settings(max_examples=50, deadline=None)
@given(st.data(), st.lists(st.sampled_from(sorted({code for code, _ in SMALL})), min_size=1, max_size=8))
def test_values_of_any_function_whole_or_damaged(data: st.DataObject, codes: list[int]) -> None:
    """Of files too, whose values have no fixed place."""
    bus = Bus(LineSettings())
    for code in codes:
        bus.feed(Analysed(data.draw(batches(code)), TransactionRows.zeros(0), NOTHING))
    bus.close()
    values = np.unique(decode(bus.batch(np.arange(bus.count))).values).tolist()
    alike(bus, of_values(values[:6] + values[-6:]))
