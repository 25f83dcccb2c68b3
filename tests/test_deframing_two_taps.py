"""Two taps of a bus, one a direction: two clocks, late reads, and still the bus is told as it was."""

from __future__ import annotations

from array import array
from collections import Counter
from dataclasses import dataclass, replace
from random import Random

import numpy as np
import pytest
from buses import adu

from analyzer.core import Analyzer
from analyzer.reports import summarize
from analyzer.reports.page import facts
from analyzer.simulation import taps
from analyzer.simulation.conversation import Client, Habits
from analyzer.tables.findings import codes
from analyzer.tables.schema import Kind, Rows
from captures.chunks import Block, Capture, Chunk
from captures.line import LineSettings

_MS = 1_000_000
_BLAMES = {"no-response", "unexpected-response", "response-mismatch", "late-response", "retry", "echo", "slow-device"}


@dataclass
class TwoTaps:
    """What two adapters make of exchanges; the bytes of each port, and when each byte was over."""

    baud: int
    random: Random

    def __post_init__(self) -> None:
        self.now = 1e9
        self.data = bytearray(), bytearray()
        self.times = array("d"), array("d")
        self.truth: list[tuple[int, int]] = []

    def send(self, port: int, frame: bytes, after_ms: tuple[float, float]) -> None:
        character = 11e9 / self.baud
        self.now += self.random.uniform(*after_ms) * _MS + 3.5 * character
        self.truth.append((port, len(self.data[port])))
        for octet in frame:
            self.now += character
            self.data[port].append(octet)
            self.times[port].append(self.now)

    def read(self, monkeypatch: pytest.MonkeyPatch, poll_ms: int, jitter_ms: int, skew_ms: int) -> list[Chunk]:
        """What is read: all `poll_ms` (0: byte by byte), late by chance, the second clock ahead."""
        monkeypatch.setattr(taps, "_USB_TIMER_NS", max(poll_ms, 1) * _MS)
        chunks = []
        for port, skew in ((0, 0), (1, skew_ms * _MS)):
            deliver = taps.TAPS["ftdi16" if poll_ms else "precise"].deliver
            newest = 0
            for chunk in deliver(bytes(self.data[port]), self.times[port], self.random, 11e9 / self.baud):
                newest = max(newest, chunk.t_ns + skew + round(self.random.uniform(0, jitter_ms) * _MS))
                chunks.append(replace(chunk, t_ns=newest, port=port))
        return sorted(chunks, key=lambda chunk: chunk.t_ns)

    def analysed(self, chunks: list[Chunk], *, said: bool) -> tuple[Rows, Counter[str]]:
        notes = {"directions": "request,response"} if said else {}
        analyzer = Analyzer(LineSettings(baud=self.baud, char_bits=11, notes=notes))
        parts = [*analyzer.feed(Block.from_chunks(chunks)), *analyzer.close()]
        names = codes()
        found = Counter(names[rule] for part in parts for rule in part.findings.rule.tolist())
        return Rows.joined([part.batch.rows for part in parts]), found


def healthy(baud: int, seed: int, exchanges: int = 250) -> TwoTaps:
    taps_of = TwoTaps(baud, Random(seed))
    client = Client(taps_of.random, Habits(False, 0, 0.0, 0.0), 5)
    for _ in range(exchanges):
        exchange = client.exchange()
        assert exchange.response is not None
        taps_of.send(0, exchange.request, (0.5, 4))
        taps_of.send(1, exchange.response, (1, 6))
    return taps_of


@pytest.mark.parametrize("baud", [9600, 115200])
@pytest.mark.parametrize("skew_ms", [-5, 0, 5])
@pytest.mark.parametrize(("poll_ms", "jitter_ms"), [(1, 0), (4, 0), (16, 0), (0, 3), (0, 10)])
@pytest.mark.parametrize("said", [True, False])
def test_a_healthy_bus_is_healthy_behind_two_adapters(
    baud: int, skew_ms: int, poll_ms: int, jitter_ms: int, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = healthy(baud, seed=poll_ms + skew_ms)
    rows, found = bus.analysed(bus.read(monkeypatch, poll_ms, jitter_ms, skew_ms), said=said)
    assert {code: count for code, count in found.items() if code in _BLAMES} == {}
    frames = rows[rows.kind != Kind.NOISE]
    assert list(zip(frames.port.tolist(), frames.start.tolist(), strict=True)) == bus.truth
    assert (frames.request[1::2] == frames.index[::2]).all()


def test_directions_that_nobody_says_are_settled_by_certain_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    bus = healthy(9600, seed=3)
    rows, _ = bus.analysed(bus.read(monkeypatch, 16, 0, 0), said=False)
    frames = rows[rows.kind != Kind.NOISE]
    assert (frames.kind == frames.port + 1).all()
    assert (frames.request[1::2] == frames.index[::2]).all()


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("poll_ms", [0, 16])
def test_writes_and_their_echoes_alone_are_told_apart_by_the_ports(
    poll_ms: int, first: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = TwoTaps(19200, Random(5))
    for i in range(40):
        write = adu(f"0b06{i % 7:04x}{i:04x}") if i % 3 else adu(f"0b1600{i:02x}00f20025")
        bus.send(first, write, (20, 60))
        bus.send(1 - first, write, (2, 9))
    rows, _ = bus.analysed(bus.read(monkeypatch, poll_ms, 0, 0), said=False)
    assert (rows.kind == np.where(rows.port == first, Kind.REQUEST, Kind.RESPONSE)).all()
    assert (rows.request[1::2] == rows.index[::2]).all()


@pytest.mark.parametrize(("poll_ms", "skew_ms"), [(0, 0), (16, 0), (16, 5)])
def test_what_nobody_answered_is_still_said(poll_ms: int, skew_ms: int, monkeypatch: pytest.MonkeyPatch) -> None:
    bus = TwoTaps(115200, Random(9))
    for i in range(120):
        bus.send(0, adu("110300000002" if i % 8 else "120300000002"), (1, 6))
        if i % 8:
            bus.send(1, adu("11030400010002"), (1, 6))
        else:
            bus.now += 200 * _MS  # the master's patience
    _, found = bus.analysed(bus.read(monkeypatch, poll_ms, 0, skew_ms), said=True)
    assert {code: count for code, count in found.items() if code in _BLAMES} == {"no-response": 15}


def test_a_response_time_that_lies_within_the_clocks_doubt_is_not_given(monkeypatch: pytest.MonkeyPatch) -> None:
    bus = healthy(115200, seed=4)
    rows, _ = bus.analysed(bus.read(monkeypatch, 0, 3, -5), said=True)
    told = rows.response_ns[rows.response_ns >= 0]
    assert len(told) < len(rows) / 20  # the clocks are 5 ms apart, and units answer within 6
    rows, _ = bus.analysed(bus.read(monkeypatch, 0, 0, 0), said=True)
    assert (rows.response_ns > 0).sum() == len(rows) / 2  # both taps are exact, and of one clock as far as seen


@pytest.mark.parametrize("count", [3, 60])
def test_a_relay_that_gets_whole_frames_in_turn_tells_response_times(count: int) -> None:
    """Each port's reads are counted apart: the third of one and the third of the other are not the same."""
    notes = {"directions": "request,response"}
    line = LineSettings(baud=9600, char_bits=10, tap="pty", notes=notes)
    pairs = [(0, adu("0103000a0002")), (1, adu("01030400010002"))]
    chunks = [Chunk((1000 + 100 * at + 24 * port) * _MS, data, port) for at in range(count) for port, data in pairs]
    report = summarize(Capture.of(line, chunks))
    assert report.transactions.answered == count
    (unit,) = report.units
    assert unit.times.count == count and unit.times.bounds("p50") is not None


@pytest.mark.parametrize("skew_ms", [-5, 5])
def test_how_far_the_clocks_are_apart_is_said(skew_ms: int, monkeypatch: pytest.MonkeyPatch) -> None:
    line = LineSettings(baud=115200, char_bits=11, notes={"directions": "request,response"})
    chunks = healthy(115200, seed=4).read(monkeypatch, 0, 0, skew_ms * 3)
    report = summarize(Capture.of(line, chunks))
    assert report.clock_skew_ns is not None
    least, most = report.clock_skew_ns
    assert least <= skew_ms * 3 * _MS <= most
    assert most - least < 8 * _MS  # the least wait of a unit, and of the master
    (told,) = (words for label, words in facts(report) if label == "clocks")
    assert ("ahead of" if skew_ms > 0 else "behind") in told
