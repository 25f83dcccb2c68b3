"""Slices that are taken while they are still recorded: what is behind what the lake has of them is new."""

from __future__ import annotations

import pytest

import captures
from captures import Block

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import batch, bus, ring, rows, same, sliced

from analyzer.fleet import datasets
from analyzer.fleet.linestate import ChunkDigest, NotGrownError, behind


def test_a_slice_that_grew_goes_on_though_older_ones_are_gone(tmp_path):
    """A ring that is batched while it is recorded, and pruned: the rows of one pass, one row a source."""
    capture, paths = ring(tmp_path)
    chunks, half = list(capture.chunks()), len(list(captures.open(paths[0]).chunks()))
    grown = len(list(captures.open(paths[1]).chunks()))
    batch(tmp_path / "whole", *paths)
    last = paths[2].read_bytes()
    paths[2].unlink()
    told = []
    for until in (half + grown // 4, half + grown // 2, half + grown // 2, half + grown):
        captures.write(paths[1], captures.Capture.of(capture.line, chunks[half:until]))
        result = batch(tmp_path / "lake", *(path for path in paths if path.exists()))
        assert not result.troubles
        paths[0].unlink(missing_ok=True)
        told.append(result.frames)
    paths[2].write_bytes(last)
    told.append(batch(tmp_path / "lake", *paths[1:]).frames)
    assert same(tmp_path / "whole", tmp_path / "lake", tuple(datasets.DATASETS.keys() - {"captures"}))
    assert sum(told) == len(rows(tmp_path / "lake", "frames"))
    assert len(rows(tmp_path / "lake", "captures")) == 3
    assert rows(tmp_path / "lake", "captures") == rows(tmp_path / "whole", "captures")


def test_a_slice_that_others_took_the_place_of_stays_as_it_was(tmp_path):
    capture, paths = ring(tmp_path)
    chunks = list(capture.chunks())
    whole = paths[1].read_bytes()
    batch(tmp_path / "lake", *paths[:2])
    before = {table: rows(tmp_path / "lake", table) for table in datasets.DATASETS}
    paths[0].unlink()
    captures.write(paths[1], captures.Capture.of(capture.line, chunks[len(chunks) * 5 // 8 :]))
    result = batch(tmp_path / "lake", paths[1])
    assert result.frames == 0 and "has changed since" in result.troubles[0]
    assert {table: rows(tmp_path / "lake", table) for table in datasets.DATASETS} == before
    assert not batch(tmp_path / "lake", paths[1]).troubles  # told once
    paths[1].write_bytes(whole)
    batch(tmp_path / "lake", *paths[1:])  # what comes behind is taken
    assert len(rows(tmp_path / "lake", "captures")) == 3


def test_a_slice_that_changed_makes_its_line_anew_while_all_are_there(tmp_path):
    capture, paths = ring(tmp_path)
    chunks = list(capture.chunks())
    batch(tmp_path / "lake", *paths[:2])
    captures.write(paths[1], captures.Capture.of(capture.line, chunks[len(chunks) * 5 // 8 :]))
    assert not batch(tmp_path / "lake", *paths[:2]).troubles
    batch(tmp_path / "whole", *paths[:2])
    assert same(tmp_path / "whole", tmp_path / "lake")


def test_chunks_are_known_again_however_they_are_read():
    blocks = list(bus("clean", 3, 40).blocks())
    joined = Block.joined(blocks)
    seen, again = ChunkDigest(), ChunkDigest()
    assert b"".join(part.data.tobytes() for part in behind([joined], 0, "", seen)) == joined.data.tobytes()
    parts = [joined.slice(at, min(at + 7, len(joined))) for at in range(0, len(joined), 7)]
    assert not list(behind(parts, seen.count, seen.text(), again)) and again.text() == seen.text()
    for wrong in (parts[1:], [*parts[1:], parts[0]]):
        with pytest.raises(NotGrownError):
            list(behind(wrong, seen.count, seen.text(), ChunkDigest()))


def test_frames_that_a_slice_settles_are_counted_once(tmp_path):
    paths = sliced(bus("clean", 4, 60), [0.3, 0.7], tmp_path / "ring" / "site")
    told = [batch(tmp_path / "lake", *paths[:number]).frames for number in range(1, 4)]
    assert sum(told) == len(rows(tmp_path / "lake", "frames")) and all(told)
