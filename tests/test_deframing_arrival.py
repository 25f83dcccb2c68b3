"""Reads of ports whose clocks lie apart: their order is that in which they came, and is never revised."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.core import Analysed, Analyzer
from analyzer.deframing.arrival import ArrivalClock
from analyzer.tables.schema import Rows
from captures import Chunk, LineSettings
from captures.chunks import Block
from dissectors.crc import crc_bytes

MS = 1_000_000
READS = st.lists(
    st.tuples(st.integers(0, 2), st.integers(-5, 50).map(lambda ms: ms * MS), st.integers(1, 9)),
    min_size=1,
    max_size=30,
)


def chunks_of(reads: list[tuple[int, int, int]]) -> list[Chunk]:
    """Reads of ports; of each its time goes on from the one before, or back where it is negative."""
    now, chunks = 0, []
    for port, step, octets in reads:
        now += step
        chunks.append(Chunk(now, bytes(octets), port))
    return chunks


def come(clock: ArrivalClock, chunks: list[Chunk]) -> list[int]:
    """When each read came."""
    begins: dict[int, int] = {}
    times = []
    for chunk in chunks:
        begin = begins.get(chunk.port, 0)
        times.append(clock.came(chunk.port, begin, chunk.t_ns))
        begins[chunk.port] = begin + len(chunk.data)
    return times


@given(READS)
def test_reads_come_one_behind_the_other_however_they_are_told(reads: list[tuple[int, int, int]]) -> None:
    chunks = chunks_of(reads)
    once, each = ArrivalClock(), ArrivalClock()
    once.feed(Block.from_chunks(chunks))
    for chunk in chunks:
        each.feed(Block.from_chunks([chunk]))
    times = come(once, chunks)
    assert times == come(each, chunks) == sorted(times)
    assert all(came >= chunk.t_ns for came, chunk in zip(times, chunks, strict=True))
    assert once.now_ns == each.now_ns == times[-1]


def _asked(number: int, port: int, t_ns: int) -> Chunk:
    return Chunk(t_ns, bytes((number >> 8, number & 255)) + bytes.fromhex("00000006080500050000"), port)


@given(
    st.lists(st.tuples(st.integers(0, 2), st.integers(0, 1), st.booleans()), min_size=1, max_size=30),
    st.integers(-30, 30),
)
def test_an_answer_on_two_ports_is_one_request_s_however_they_are_read(
    told: list[tuple[int, int, bool]], step_ms: int
) -> None:
    """Modbus TCP: a request and its echo look alike but for the port that the line's notes give a direction."""
    line = LineSettings(baud=115200, notes={"directions": "request,response", "protocols": "tcp,tcp"})
    chunks, newest = [], {0: 0, 1: 0}
    for i, (number, port, back) in enumerate(told):
        newest[port] = max(newest[port], i * 20 * MS + back * step_ms * MS)
        chunks.append(_asked(number, port, newest[port]))
    once, each = Analyzer(line), Analyzer(line)
    early = Analyzer(line, settles=False)
    parts = [*once.feed(Block.from_chunks(chunks)), *once.close()]
    others: list[Analysed] = []
    seen: list[Rows] = []
    for chunk in chunks:
        others += each.feed(Block.from_chunks([chunk]))
        early.feed(Block.from_chunks([chunk]))
        seen.append(early.latest.batch.rows)
    others += each.close()
    early.close()
    seen.append(early.latest.batch.rows)
    rows = Rows.joined([part.batch.rows for part in parts])
    for other in (Rows.joined([part.batch.rows for part in others]), Rows.joined(seen)):
        for name in ("index", "start", "port", "kind", "request", "request_start", "response_ns"):
            assert np.array_equal(rows.column(name), other.column(name)), name


def _with_crc(body: bytes) -> bytes:
    return body + crc_bytes(body)


def test_a_request_is_heard_before_its_answer_where_the_answer_s_clock_is_an_hour_behind() -> None:
    line = LineSettings(baud=9600)
    chunks = []
    for i in range(40):
        chunks.append(Chunk((100 + i * 100) * MS, _with_crc(bytes.fromhex("010300000001")), 0))
        chunks.append(Chunk((150 + i * 100 - 3_600_000) * MS, _with_crc(bytes((1, 3, 2, 0, i))), 1))
    analyzer = Analyzer(line)
    parts = [*analyzer.feed(Block.from_chunks(chunks)), *analyzer.close()]
    rows = Rows.joined([part.batch.rows for part in parts])
    frames = rows[rows.index >= 0]
    assert frames.port.tolist() == [0, 1] * 40


@given(READS, st.integers(0, 30))
def test_what_is_decided_is_forgotten_and_nothing_else(reads: list[tuple[int, int, int]], count: int) -> None:
    chunks = chunks_of(reads)
    whole, forgetful = ArrivalClock(), ArrivalClock()
    for clock in (whole, forgetful):
        clock.feed(Block.from_chunks(chunks))
    for port in {chunk.port for chunk in chunks}:
        forgetful.decided(port, sum(len(chunk.data) for chunk in chunks[:count] if chunk.port == port))
    assert come(forgetful, chunks)[count:] == come(whole, chunks)[count:]


@given(READS, st.integers(-50, 2000).map(lambda ms: ms * MS))
def test_time_that_passes_without_reads_never_runs_back(reads: list[tuple[int, int, int]], passed_ns: int) -> None:
    clock, silent = ArrivalClock(), ArrivalClock()
    clock.feed(Block.from_chunks(chunks_of(reads)))
    newest = clock.now_ns
    assert newest is not None
    clock.passed(passed_ns)
    silent.passed(passed_ns)
    assert (clock.now_ns, silent.now_ns) == (max(newest, passed_ns), passed_ns)


def test_a_read_that_seems_earlier_comes_just_behind_another_port_s_and_with_its_own() -> None:
    chunks = [Chunk(t_ms * MS, b"\1", port) for t_ms, port in ((10, 0), (5, 1), (6, 1), (10, 0), (9, 0), (11, 1))]
    clock = ArrivalClock()
    clock.feed(Block.from_chunks(chunks))
    assert [at - 10 * MS for at in come(clock, chunks)] == [0, 1, 1, 2, 2, MS]
