"""Lakes whose small files were made into larger ones: the same rows, whatever is taken in or done anew."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

import captures
from analyzer.cli import main

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import DAY_NS, batch, bus, plain, rows, same, sliced, write_fleet

from analyzer.fleet import LakeWriteError, datasets, packs, tasks
from analyzer.fleet.batch import compact_lake
from analyzer.fleet.datasets import DATASETS
from analyzer.fleet.lake import Lake
from analyzer.fleet.linetask import BatchOptions
from analyzer.fleet.manifest import Manifest
from analyzer.fleet.stores import store


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """Captures of a fleet, to be read and left as they are."""
    return write_fleet(tmp_path_factory.mktemp("sources"), transactions=30)


@pytest.fixture(scope="module")
def loose(sources, tmp_path_factory):
    """Their lake, each line in files of its own."""
    path = tmp_path_factory.mktemp("lakes") / "loose"
    batch(path, sources)
    assert not any(Manifest(store(str(path))).files(table).packs for table in DATASETS)
    return path


@pytest.fixture
def packed(loose, tmp_path):
    """The same, a file a table."""
    path = shutil.copytree(loose, tmp_path / "packed")
    manifest = Manifest(store(str(path)))
    many = [table for table in DATASETS if len(manifest.files(table).loose) > 1]
    assert len(many) >= 5 and compact_lake(store(str(path))).after == len(many)
    return path


def files(lake):
    """What lies there, and what the manifest names."""
    there = {file.relative_to(lake).as_posix() for file in lake.rglob("*.parquet")}
    return there, {name for name in Manifest(store(str(lake))).named() if name.endswith(".parquet")}


def test_packed_rows_are_those_of_the_small_files(loose, packed):
    assert same(loose, packed)
    there, named = files(packed)
    assert named < there and len(named) <= len(DATASETS)  # who reads the old ones has until the next batch
    assert compact_lake(store(str(packed))).before == 0
    there, named = files(packed)
    assert there == named
    assert same(loose, packed)


def test_columns_stand_in_one_order_wherever_rows_lie(loose, packed, sources):
    batch(packed, sources / "site1", options=BatchOptions(noise=True), redo=True)  # some in packs, some in files
    assert packed_and_loose(packed, "frames")
    for table in DATASETS:
        one, two = (Lake(str(path)).sql(f"SELECT * FROM {table}").columns for path in (loose, packed))
        assert one == two and "site" in one, table


def packed_and_loose(lake, table):
    there = Manifest(store(str(lake))).files(table)
    return there.packs and there.loose


@pytest.mark.parametrize("library", ["polars", "dask"])
def test_other_readers_see_the_same(loose, packed, sources, library):
    pytest.importorskip(library, reason=f"needs {library}")
    batch(packed, sources, options=BatchOptions(noise=True), redo=True)  # leaves packs of which no part is the lake's
    batch(packed, sources, redo=True)
    compact_lake(store(str(packed)))
    again = sorted((sources / "site1").iterdir())[0]
    batch(packed, again, options=BatchOptions(noise=True), redo=True)  # and then one of which some are not
    batch(packed, again, redo=True)
    assert any(Lake(str(packed)).manifest.files("frames").packs.values())
    for table in DATASETS:
        one, two = (sorted(map(str, read_by(library, Lake(str(path)), table))) for path in (loose, packed))
        assert one == two and (one or table in ("findings", "causes")), table
    assert same(loose, packed)


def read_by(library, lake, table):
    """Rows as another library reads them, all columns but those with lists."""
    frame = lake.polars(table).collect() if library == "polars" else lake.dask(table).compute()
    records = frame.to_dicts() if library == "polars" else frame.to_dict("records")
    lists = ("findings", "values", "units", "frames", "damage")
    return [{key: str(row[key]) for key in sorted(row) if key not in (*lists, "source")} for row in records]


def test_a_line_done_anew_replaces_only_its_own_rows(packed, loose, sources, tmp_path):
    one = sources / "site1" / "bus1.mcap"
    noise = BatchOptions(noise=True)
    batch(packed, one, options=noise, redo=True)
    batch(loose_copy := shutil.copytree(loose, tmp_path / "copy"), one, options=noise, redo=True)
    stale = Lake(str(packed)).manifest.files("frames").packs
    assert [len(parts) for parts in stale.values()] != [0]
    assert same(packed, loose_copy)
    compact_lake(store(str(packed)))
    assert not any(Lake(str(packed)).manifest.files("frames").packs.values())
    assert same(packed, loose_copy)


def test_a_line_goes_on_behind_what_was_packed(tmp_path):
    capture = bus(transactions=100, span_ns=2 * DAY_NS)
    paths = sliced(capture, [0.3, 0.5, 0.8], tmp_path / "ring" / "site")
    batch(tmp_path / "whole", tmp_path / "ring")
    made = []
    for last in range(1, len(paths) + 1):
        batch(tmp_path / "lake", *paths[:last])
        if last != len(paths):
            made.append(compact_lake(store(str(tmp_path / "lake"))).after)
    assert sum(count > 0 for count in made) >= 2
    assert same(tmp_path / "lake", tmp_path / "whole", [table for table in DATASETS if table != "captures"])
    assert len(rows(tmp_path / "lake", "captures")) == len(paths)


def test_rows_lie_so_that_a_reader_can_skip(packed):
    from pyarrow.parquet import read_table

    lake = Lake(str(packed))
    for table in ("frames", "values", "hours"):
        ((name, stale),) = lake.files(table).packs.items()
        assert not stale
        keys = [key for key in ("site", "day", *DATASETS[table].order) if key != "day" or DATASETS[table].time]
        places = [tuple(row.values()) for row in read_table(name, columns=keys).select(keys).to_pylist()]
        assert places == sorted(places), table
    ((name, _),) = lake.files("values").packs.items()
    from pyarrow.parquet import ParquetFile

    with ParquetFile(name) as file:
        group = file.metadata.row_group(0)
        told = {group.column(i).path_in_schema for i in range(group.num_columns) if group.column(i).statistics}
    assert {"site", "day", "unit", "address", "t_ns"} <= told


def test_a_batch_packs_when_many_small_files_stand(loose, sources, tmp_path, monkeypatch):
    monkeypatch.setattr(packs, "MANY", 8)
    result = batch(tmp_path / "lake", sources)
    assert result.packed.before > 8 and result.packed.after < result.packed.before
    assert same(loose, tmp_path / "lake")


def test_packs_that_are_full_are_made_while_more_is_taken_in(loose, sources, tmp_path, monkeypatch):
    monkeypatch.setattr(packs, "MANY", 4)
    monkeypatch.setattr(packs, "FULL", 60)
    monkeypatch.setattr(packs, "SMALL", 50)
    order, enter = [], Manifest.add

    def entered(manifest, lines, packs=()):
        order.append(bool(packs))
        enter(manifest, lines, packs)

    monkeypatch.setattr(Manifest, "add", entered)
    result = batch(tmp_path / "lake", sources)
    first, last = order.index(True), len(order) - 1 - order[::-1].index(False)
    assert first < last, "a pack before the last capture"
    assert result.packed.after == order.count(True) < result.packed.before
    assert same(loose, tmp_path / "lake")


@pytest.fixture
def together(monkeypatch):
    """All small captures of a batch in one task."""
    monkeypatch.setattr(tasks, "LEAST_TASKS", 1)


@pytest.mark.usefixtures("together")
def test_small_captures_taken_in_together_are_packed_at_once(loose, sources, tmp_path):
    copied = shutil.copytree(sources, tmp_path / "sources")
    shutil.copy(copied / "site1" / "bus0.mcap", copied / "site1" / "copy.mcap")
    result = batch(tmp_path / "lake", copied)
    assert (result.lines, result.captures, result.failed) == (7, 7, 0)
    assert len(list((tmp_path / "lake" / "manifest").iterdir())) == 1  # the copy is known as one
    manifest = Manifest(store(str(tmp_path / "lake")))
    assert not manifest.files("frames").loose and len(manifest.files("frames").packs) == 1
    assert same(loose, tmp_path / "lake", [table for table in DATASETS if table != "captures"])
    assert sum(row["site"] == "site1" for row in rows(tmp_path / "lake", "captures")) == 3
    compact_lake(store(str(tmp_path / "lake")))
    assert not any(Manifest(store(str(tmp_path / "lake"))).files("frames").packs.values())
    batch(tmp_path / "lake", copied)
    there, named = files(tmp_path / "lake")
    assert there == named
    assert same(loose, tmp_path / "lake", [table for table in DATASETS if table != "captures"])


@pytest.mark.usefixtures("together")
def test_lines_taken_in_together_go_on_as_one_does(tmp_path):
    capture = bus(transactions=100, span_ns=2 * DAY_NS)
    paths = [sliced(capture, [0.3, 0.8], tmp_path / "ring" / f"site{number}") for number in range(3)]
    batch(tmp_path / "whole", tmp_path / "ring")
    for last in (1, 2, 3):
        batch(tmp_path / "lake", *(path for line in paths for path in line[:last]))
    made, entries = Manifest(store(str(tmp_path / "lake"))), (tmp_path / "lake" / "manifest").iterdir()
    packs = sum(len(json.loads(path.read_bytes())["packs"]) for path in entries)
    assert packs > sum(len(made.files(table).packs) for table in DATASETS)  # some held tails alone
    assert same(tmp_path / "lake", tmp_path / "whole", [table for table in DATASETS if table != "captures"])


@pytest.mark.usefixtures("together")
def test_lines_whose_packs_cannot_be_written_are_taken_in_alone(loose, sources, tmp_path, monkeypatch):
    write = packs.new_packs

    def full(place, new):
        if new:
            raise LakeWriteError("no space")
        return write(place, new)

    monkeypatch.setattr(tasks, "new_packs", full)
    result = batch(tmp_path / "lake", sources)
    assert (result.captures, result.failed) == (6, 0)
    assert not any(Manifest(store(str(tmp_path / "lake"))).files(table).packs for table in DATASETS)
    assert same(loose, tmp_path / "lake")


def test_a_small_file_of_many_rows_writes_its_own(loose, sources, tmp_path, monkeypatch):
    monkeypatch.setattr(tasks, "LEAST_TASKS", 1)
    monkeypatch.setattr(datasets, "GROUP", 50)
    batch(tmp_path / "lake", sources)
    table = Manifest(store(str(tmp_path / "lake"))).files("frames")
    assert table.loose and table.packs
    assert same(loose, tmp_path / "lake")


def test_large_files_stay_as_they_are(loose, tmp_path, monkeypatch):
    path = shutil.copytree(loose, tmp_path / "lake")
    monkeypatch.setattr(packs, "SMALL", 20)
    monkeypatch.setattr(packs, "FULL", 40)
    large = {name for name, count in Manifest(store(str(path))).rows("frames").items() if count >= 20}
    compact_lake(store(str(path)))
    now = Manifest(store(str(path))).files("frames")
    assert large and large <= set(now.loose)
    catalog = Manifest(store(str(path))).catalog
    assert all(sum(count for _, count in catalog.members(name).values()) <= 40 for name in now.packs)
    assert same(loose, path)


@pytest.mark.skipif(os.name != "posix", reason="kills by signal")
def test_killed_while_packing_the_lake_is_the_old_or_the_new(loose, tmp_path):
    quiet = subprocess.DEVNULL
    for wanted in (0, 2, 5):  # packs that are there when it is killed
        path = shutil.copytree(loose, tmp_path / f"lake{wanted}")
        command = [sys.executable, "-m", "analyzer.cli", "batch", "--compact", "-o", str(path)]
        with subprocess.Popen(command, stdout=quiet, stderr=quiet) as process:
            while process.poll() is None and not (
                (path / "scratch").is_dir() and len(list(path.glob("*/packed/*"))) >= wanted
            ):
                time.sleep(0.001)
            process.send_signal(signal.SIGKILL)
        assert same(loose, path)
        there, named = files(path)
        assert named <= there
        compact_lake(store(str(path)))
        assert same(loose, path)


def test_compact_as_a_user_types_it(loose, tmp_path, capsys):
    path = shutil.copytree(loose, tmp_path / "lake")
    assert main(["batch", "--compact", "-o", str(path)]) == 0
    assert "files" in capsys.readouterr().out
    assert main(["batch", "--compact", "-o", str(tmp_path / "none")]) == 2
    assert "is not a lake" in capsys.readouterr().err and not (tmp_path / "none").exists()
    assert main(["batch", "-o", str(path)]) == 2
    assert "SOURCE" in capsys.readouterr().err
    captures.write(tmp_path / "new.jsonl", bus("clean", 77, 20))
    assert main(["batch", str(tmp_path / "new.jsonl"), "--compact", "--resume", "-o", str(path), "--workers", "1"]) == 0
    assert len(Lake(str(path)).manifest.files("frames").packs) == 1
    assert plain(Lake(str(path)).arrow("SELECT count(DISTINCT line) AS n FROM frames"))[0]["n"] > 2
