"""A capture reads alike however its source cuts it into blocks, and from any format that holds it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from buses import LINE, spaced, streams
from hypothesis import given
from scripts import script

import analyzer
import captures
import captures.samples
from analyzer.analysis import Analysis
from analyzer.simulation import Scenario, simulate
from analyzer.tables.schema import Row, Rows
from captures.chunks import Block, Capture, Chunk


@given(streams())
def test_joined_blocks_are_the_blocks_of_all_chunks(chunks: list[Chunk]) -> None:
    if chunks:
        joined = Block.joined([Block.from_chunks([chunk]) for chunk in chunks])
        whole = Block.from_chunks(chunks)
        for name in ("data", "offsets", "t_ns", "port", "mark", "errors"):
            assert (getattr(joined, name) == getattr(whole, name)).all()


def test_mcap_and_json_lines_of_one_capture_give_the_same_rows(tmp_path: Path) -> None:
    made = simulate(Scenario("brutal", "ftdi16", transactions=200, seed=7))
    capture = Capture.of(made.line, made.chunks)
    rows = []
    for name in ("bus.jsonl", "bus.mcap"):
        captures.write(tmp_path / name, capture)
        rows.append(analyzer.open(tmp_path / name).rows())
    assert rows[0].tolist() == rows[1].tolist() == Analysis(capture).rows().tolist()


def test_the_public_calls(tmp_path: Path) -> None:
    read, answer = bytes.fromhex("1103006b00037687"), bytes.fromhex("110306ae415652434049ad")
    captures.write(tmp_path / "bus.jsonl", Capture.of(LINE, spaced([read, answer] * 3)))
    bus = analyzer.open(tmp_path / "bus.jsonl")
    assert [frame.direction for frame in bus.frames()] == ["request", "response"] * 3
    assert next(iter(bus.frames())).summary() == "read 3 holding registers from 107 (40108)"
    assert bus.rows().length.tolist() == [8, 11] * 3
    assert (bus.transactions().response_ns > 0).all()
    assert bus.line.baud == LINE.baud
    assert bus.damage == []
    with pytest.raises(captures.CaptureError):
        analyzer.open(tmp_path / "nothing.jsonl")


@pytest.mark.parametrize("name", captures.samples.names())
def test_the_samples_read_as_expected_frame_by_frame(name: str) -> None:
    expectations = script("expect_samples")
    path = captures.samples.path(name)
    assert expectations.expected(path) == expectations.beside(path).read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("name", ["healthy.jsonl", "mbpoll.mcap"])
def test_a_healthy_sample_is_whole(name: str) -> None:
    rows = analyzer.open(captures.samples.path(name)).rows()
    assert rows.check.all()
    assert (rows.request[rows.kind == 2] >= 0).all()


def test_no_times_are_made_up(tmp_path: Path) -> None:
    """Without a baud rate a frame has the time of its read; without a clock it has none."""
    log = tmp_path / "log.txt"
    log.write_text("[12:00:01.100] TX 11 03 00 6B 00 03 76 87\n[12:00:01.150] RX 11 03 06 AE 41 56 52 43 40 49 AD\n")
    rows = analyzer.open(log).rows()
    assert (rows.t_start_ns == rows.t_end_ns).all()
    assert rows.response_ns.tolist() == [-1, 50_000_000]
    for name, data in (("rtu.bin", bytes.fromhex("1103006b00037687")), ("ascii.bin", b":1103006B00037E\r\n" * 3)):
        (tmp_path / name).write_bytes(data)
        untimed = analyzer.open(tmp_path / name).rows()
        assert len(untimed) and not untimed.t_start_ns.any() and not untimed.t_end_ns.any()


def test_a_row_has_the_columns_of_the_rows() -> None:
    assert [field.name for field in dataclasses.fields(Row)] == list(Rows.dtypes())
