"""Lakes made by other rules: what those touch is made anew, all else stays; nothing is lost for it."""

from __future__ import annotations

import shutil

import pytest

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import BEGIN_NS, DAY_NS, batch, bus, rows, same, sliced, write_fleet

import captures
from analyzer.causes import reasoning
from analyzer.fleet import manifest as manifests
from analyzer.fleet.batch import compact_lake
from analyzer.fleet.datasets import DATASETS, touched
from analyzer.fleet.entries import read_entry
from analyzer.fleet.lake import Lake
from analyzer.fleet.linetask import BatchOptions
from analyzer.fleet.manifest import Manifest
from analyzer.fleet.stores import store
from analyzer.version import RULES


@pytest.fixture
def sources(tmp_path):
    """Captures of three sites."""
    return write_fleet(tmp_path / "src", transactions=60)


def files(lake):
    """The files of each table that the lake consists of."""
    manifest = Manifest(store(str(lake)))
    return {table: set(manifest.rows(table)) for table in DATASETS}


def changed(monkeypatch, name):
    """Rules of this name, as another release would have them."""
    monkeypatch.setitem(RULES, name, RULES[name] + 1)
    if name == "causes":
        monkeypatch.setattr(reasoning, "THRESHOLD", 4 * reasoning.THRESHOLD)


@pytest.mark.parametrize(
    ("name", "tables", "packed"),
    [
        ("causes", {"causes"}, False),
        ("findings", {"frames", "findings", "hours"}, True),
        ("pairing", {"frames", "transactions", "findings", "hours", "causes"}, False),
        ("reading", set(DATASETS), True),
    ],
)
def test_a_changed_rule_makes_anew_what_it_touches(sources, tmp_path, monkeypatch, name, tables, packed):
    batch(tmp_path / "lake", sources)
    if packed:
        compact_lake(store(str(tmp_path / "lake")))
    before = files(tmp_path / "lake")
    changed(monkeypatch, name)
    assert touched({**RULES, name: RULES[name] - 1}) == tables
    result = batch(tmp_path / "lake", sources)
    assert (result.captures, result.outdated) == (0, 6)
    assert files(tmp_path / "lake") == before
    result = batch(tmp_path / "lake", sources, redo=True)
    assert (result.captures, result.outdated, result.failed) == (6, 0, 0)
    after = files(tmp_path / "lake")
    assert {table for table in DATASETS if before[table] and not before[table] & after[table]} == tables
    assert {table for table in DATASETS if before[table] == after[table]} >= DATASETS.keys() - tables
    batch(tmp_path / "fresh", sources)
    assert same(tmp_path / "lake", tmp_path / "fresh")
    assert batch(tmp_path / "lake", sources, redo=True).captures == 0
    assert same(tmp_path / "lake", tmp_path / "fresh")


def test_other_causes_come_of_other_rules(sources, tmp_path, monkeypatch):
    batch(tmp_path / "lake", sources)
    before = rows(tmp_path / "lake", "causes")
    changed(monkeypatch, "causes")
    batch(tmp_path / "lake", sources, redo=True)
    assert len(rows(tmp_path / "lake", "causes")) < len(before)


@pytest.mark.parametrize(("name", "known"), [("causes", 1), ("findings", 3)])
def test_a_ring_made_anew_goes_on(tmp_path, monkeypatch, name, known):
    capture = bus(transactions=100, span_ns=3 * DAY_NS)
    paths = sliced(capture, [0.25, 0.5, 0.8], tmp_path / "ring" / "site")
    for last in range(1, known + 1):
        batch(tmp_path / "lake", *paths[:last])
    changed(monkeypatch, name)
    result = batch(tmp_path / "lake", *paths[:3], redo=True)
    assert (result.captures, result.failed) == (3, 0)
    batch(tmp_path / "three", *paths[:3])
    tables = [table for table in DATASETS if table != "captures"]
    assert same(tmp_path / "lake", tmp_path / "three", tables)
    batch(tmp_path / "lake", *paths)
    batch(tmp_path / "whole", *paths)
    assert same(tmp_path / "lake", tmp_path / "whole", tables)
    assert len(rows(tmp_path / "lake", "captures")) == len(paths)


def test_a_ring_that_gave_up_old_files_is_left_as_it_is(tmp_path, monkeypatch):
    paths = sliced(bus(transactions=100), [0.3, 0.6], tmp_path / "ring" / "site")
    batch(tmp_path / "lake", *paths)
    before = rows(tmp_path / "lake", "frames")
    paths[0].unlink()
    changed(monkeypatch, "causes")
    result = batch(tmp_path / "lake", tmp_path / "ring", redo=True)
    assert (result.captures, result.outdated) == (0, 1)
    assert "1 of its captures are gone" in result.troubles[0]
    assert rows(tmp_path / "lake", "frames") == before


def test_a_capture_that_is_another_by_now_leaves_no_old_rows(sources, tmp_path, monkeypatch):
    batch(tmp_path / "lake", sources)
    shutil.copyfile(sources / "site2" / "bus0.mcap", sources / "site1" / "bus0.mcap")
    changed(monkeypatch, "causes")
    batch(tmp_path / "lake", sources, redo=True)
    batch(tmp_path / "fresh", sources)
    assert same(tmp_path / "lake", tmp_path / "fresh")


@pytest.mark.parametrize("late", [False, True], ids=["at once", "later"])
def test_a_copy_and_what_it_is_of_are_one_however_often_they_are_made(sources, tmp_path, late):
    batch(tmp_path / "lake", sources)
    before = rows(tmp_path / "lake", "frames")
    shutil.copyfile(sources / "site0" / "bus0.mcap", sources / "site0" / "copy.mcap")
    if late:
        batch(tmp_path / "lake", sources)
    else:
        shutil.rmtree(tmp_path / "lake")
        batch(tmp_path / "lake", sources)
    count = "SELECT count(*) FROM captures WHERE state = 'twice'"
    for options in (BatchOptions(), BatchOptions(noise=True), BatchOptions()):
        batch(tmp_path / "lake", sources, options=options, redo=True)
        assert Lake(str(tmp_path / "lake")).sql(count).fetchall() == [(1,)]
    assert [{**row, "line": ""} for row in rows(tmp_path / "lake", "frames")] == [{**row, "line": ""} for row in before]


def test_functions_that_are_declared_otherwise_are_other_options(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("A = 1\n")
    before = BatchOptions(functions=(str(path),)).mark()
    path.write_text("A = 2\n")
    assert BatchOptions(functions=(str(path),)).mark() != before


def test_of_a_manifest_only_what_is_new_is_read(sources, tmp_path, monkeypatch):
    """As `watch` reads it; but all of it where the lake is another by now, of which nothing is taken away."""
    read, lake, first = [], tmp_path / "lake", sorted(sources.iterdir())[0]

    def reading(place, name):
        read.append(name)
        return read_entry(place, name)

    monkeypatch.setattr(manifests, "read_entry", reading)
    batch(lake, first)
    kept = Manifest(store(str(lake)))
    assert len(read) == 2
    batch(lake, sources)
    read.clear()
    assert batch(lake, sources, manifest=kept).captures == 0
    assert len(read) == 4
    other = Manifest(store(str(lake)))
    assert kept.lines == other.lines and all(kept.line(*key) == other.line(*key) for key in kept.lines)
    read.clear()
    batch(lake, sources, manifest=kept)
    assert not read
    shutil.rmtree(lake)
    batch(tmp_path / "whole", sources, options=BatchOptions(noise=True))
    batch(lake, sources, options=BatchOptions(noise=True))
    read.clear()
    batch(lake, sources, options=BatchOptions(noise=True), manifest=kept)
    assert len(read) == 6 and same(lake, tmp_path / "whole")


def test_a_name_that_another_recording_has_now_is_told(tmp_path):
    path, lake = tmp_path / "site" / "bus.mcap", tmp_path / "lake"
    path.parent.mkdir()
    captures.write(path, bus("clean", 1, 20))
    batch(lake, path.parent)
    captures.write(path, bus("clean", 1, 30))  # it has grown
    assert batch(lake, path.parent).troubles == []
    captures.write(path, bus("clean", 2, 20, begin_ns=BEGIN_NS + DAY_NS))
    (told,) = batch(lake, path.parent).troubles
    assert "another recording has this name now: its rows take the place of the former one's" in told
