"""Checkpoints of a manifest: with them and without them a lake is the same, and nothing hangs on them."""

from __future__ import annotations

import json
import shutil

import pytest

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import batch, bus, same, sliced, write_fleet

from analyzer.fleet import FleetError, checkpoints
from analyzer.fleet import manifest as manifests
from analyzer.fleet.batch import compact_lake
from analyzer.fleet.datasets import DATASETS
from analyzer.fleet.entries import read_entry
from analyzer.fleet.linetask import BatchOptions
from analyzer.fleet.manifest import Manifest
from analyzer.fleet.stores import ObjectStore, store


@pytest.fixture(autouse=True, scope="module")
def soon():
    """One after each batch in which there is anything new but the entry of the one before."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(manifests, "NEW_ENTRIES", 2)
        patch.setattr(manifests, "NEW_SHARE", 1 << 30)
        yield


@pytest.fixture
def read(monkeypatch):
    """The entries that are read."""
    names = []

    def reading(place, name):
        names.append(name)
        return read_entry(place, name)

    monkeypatch.setattr(manifests, "read_entry", reading)
    return names


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Sources, a lake that grew of them, and all of it once more, untouched."""
    place = tmp_path_factory.mktemp("checkpoints")
    now = place / "now"
    sources, lake = write_fleet(now / "src", transactions=30), now / "lake"
    paths = sliced(bus(transactions=60), [0.3, 0.7], now / "src" / "site9")
    for path in paths[1:]:
        path.rename(path.with_suffix(".later"))
    batch(lake, sources)
    compact_lake(store(str(lake)))
    for path in paths[1:]:
        path.with_suffix(".later").rename(path)
        batch(lake, sources)
    batch(lake, sources / "site1", options=BatchOptions(noise=True), redo=True)
    now.rename(place / "kept")
    return place


@pytest.fixture
def grown(place):
    """A lake that grew by slices, was packed, done anew in part, and whose checkpoint holds all but its own entry.

    Where it was made each time, as it knows its sources by their paths; these are beside it.
    """
    shutil.rmtree(place / "now", ignore_errors=True)
    shutil.copytree(place / "kept", place / "now")
    return place / "now" / "lake"


def told(lake):
    """All that a manifest says of a lake."""
    manifest = Manifest(store(str(lake)))
    files = {table: manifest.files(table) for table in DATASETS}
    lines = {key: (manifest.line(*key), manifest.catalog.known(*key)) for key in manifest.lines}
    return files, lines, manifest.named(), [manifest.rows(table) for table in DATASETS]


def test_what_a_checkpoint_holds_is_not_read_again(grown, read):
    entries = len(list((grown / "manifest").iterdir()))
    with_one = told(grown)
    Manifest(store(str(grown)))
    read.clear()
    assert len(Manifest(store(str(grown))).lines) and read == [f"manifest/{entries:08d}.json"]
    kept = (grown / "checkpoint").rename(grown / "aside")
    read.clear()
    assert told(grown) == with_one and len(read) >= entries
    kept.rename(grown / "checkpoint")


def test_one_checkpoint_stays(grown):
    for _ in range(2):
        batch(grown, grown.parent / "src")
    named = {name for name in Manifest(store(str(grown))).named() if name.startswith("checkpoint/")}
    there = {f"checkpoint/{path.name}" for path in (grown / "checkpoint").iterdir()}
    assert there == named and len(there) == 1


@pytest.mark.parametrize("part", ["head", "content", "cut", "nonsense", "newest"])
def test_a_checkpoint_that_is_damaged_is_none(grown, tmp_path, part):
    whole = told(grown)
    shutil.copytree(grown, tmp_path / "whole")
    for path in (grown / "checkpoint").iterdir():
        data = path.read_bytes()
        head, _, rest = data.partition(b"\n")
        spoilt = {
            "head": data[:40] + bytes([data[40] ^ 1]) + data[41:],
            "content": data[:-40] + bytes([data[-40] ^ 1]) + data[-39:],
            "cut": data[:-100],
            "nonsense": b"\n\n",
            "newest": json.dumps(json.loads(head) | {"newest": 10**6}).encode() + b"\n" + rest,
        }
        path.write_bytes(spoilt[part])
    assert told(grown) == whole
    assert not batch(grown, grown.parent / "src").troubles
    assert same(grown, tmp_path / "whole")


def test_a_checkpoint_of_other_entries_is_none(grown):
    """Of a lake that was put down from elsewhere, or whose entries somebody mended."""
    entry = sorted((grown / "manifest").iterdir())[0]
    whole = entry.read_bytes()
    entry.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FleetError, match="damaged or not an entry"):
        Manifest(store(str(grown)))
    entry.write_bytes(whole)
    expected = told(grown)
    last = sorted((grown / "manifest").iterdir())[-1]
    last.write_bytes(json.dumps(json.loads(last.read_bytes()), indent=1).encode())
    assert told(grown) == expected
    after = max(json.loads(path.read_bytes()).get("after") or 0 for path in (grown / "manifest").iterdir())
    (grown / "manifest" / f"{after:08d}.json").unlink()
    with pytest.raises(FleetError, match="is missing"):
        Manifest(store(str(grown)))


def test_a_kill_between_a_checkpoint_and_its_entry_leaves_waste_alone(grown, monkeypatch):
    """It is used as it is, and taken away by the next batch, which makes another."""
    expected = told(grown)
    sources = grown.parent / "src"
    (sources / "site1" / "late.mcap").write_bytes((sources / "site0" / "bus0.mcap").read_bytes())

    def killed(place, catalog, there):
        name = checkpoints.write_checkpoint(place, catalog, there)
        raise KeyboardInterrupt(name)

    with monkeypatch.context() as patch:
        patch.setattr(manifests, "write_checkpoint", killed)
        with pytest.raises(KeyboardInterrupt):
            batch(grown, grown.parent / "src")
    assert len(list((grown / "checkpoint").iterdir())) == 2
    assert told(grown)[1].keys() > expected[1].keys()
    (sources / "site1" / "last.mcap").write_bytes((sources / "site0" / "bus1.mcap").read_bytes())
    for _ in range(3):  # the killed one's goes, another is written, the one before that goes
        batch(grown, grown.parent / "src")
    assert len(list((grown / "checkpoint").iterdir())) == 1


def test_one_that_cannot_be_written_is_missed_by_nobody(tmp_path, monkeypatch):
    def full(*_):
        raise FleetError("no space")

    monkeypatch.setattr(manifests, "write_checkpoint", full)
    result = batch(tmp_path / "lake", write_fleet(tmp_path / "src", transactions=30))
    assert not result.troubles and not (tmp_path / "lake" / "checkpoint").exists()


def test_of_an_object_store_too(grown, read):
    import fsspec

    system = fsspec.filesystem("memory")
    system.put(str(grown), "/checkpointed", recursive=True)
    try:
        place = ObjectStore("memory://checkpointed")
        first = Manifest(place)
        assert first.lines == Manifest(store(str(grown))).lines
        first.checkpoint()
        read.clear()
        again = Manifest(ObjectStore("memory://checkpointed"))
        assert again.lines == first.lines and len(read) <= 1
    finally:
        system.rm("/checkpointed", recursive=True)
