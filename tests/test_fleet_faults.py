"""Lakes where things go wrong: damaged captures, workers that die, batches that are killed."""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from multiprocessing import util as spawning
from pathlib import Path

import pytest

import analyzer
import captures

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import DAY_NS, batch, bus, plain, rows, same, sliced, write_fleet

from analyzer.cli.batch import chosen_runner
from analyzer.cli.terminal import endable
from analyzer.fleet import FleetError
from analyzer.fleet.account import writing
from analyzer.fleet.entries import FOLDER
from analyzer.fleet.lake import Lake
from analyzer.fleet.linetask import BatchOptions
from analyzer.fleet.manifest import Manifest
from analyzer.fleet.questions import Asked, ready
from analyzer.fleet.runners import ProcessPool, in_this_process
from analyzer.fleet.stores import store


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """Captures of a fleet, to be left as they are."""
    return write_fleet(tmp_path_factory.mktemp("sources"), transactions=30)


@pytest.fixture(scope="module")
def whole(sources, tmp_path_factory):
    """Their lake, made in one go."""
    path = tmp_path_factory.mktemp("lakes") / "whole"
    batch(path, sources)
    return path


@pytest.fixture
def fleet(sources, tmp_path):
    """The captures, to be damaged."""
    return shutil.copytree(sources, tmp_path / "src")


def test_one_bad_file_never_stops_the_rest(fleet, tmp_path):
    (fleet / "site0" / "empty.jsonl").write_bytes(b"")
    (fleet / "site1" / "picture.bin").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    cut = fleet / "site2" / "bus1.jsonl"
    lines = cut.read_bytes().splitlines(keepends=True)
    cut.write_bytes(b"".join([*lines[:40], b"{ damage }\n", *lines[41:]]))
    result = batch(tmp_path / "lake", fleet)
    assert (result.captures, result.failed, result.damaged) == (8, 0, 3)
    lake = Lake(str(tmp_path / "lake"))
    states = dict(lake.sql("SELECT regexp_extract(source, '[^/]+/[^/]+$'), state FROM captures").fetchall())
    assert states["site0/empty.jsonl"] == states["site1/picture.bin"] == "unreadable"
    assert states["site2/bus1.jsonl"] == "damaged"
    assert list(states.values()).count("whole") == 5
    damaged = plain(ready(lake, "damaged", Asked()))
    assert len(damaged) == 3 and all(row["damage_count"] for row in damaged)
    whole = analyzer.open(cut).to_arrow("frames").num_rows
    assert (
        lake.sql("SELECT count(*) FROM frames WHERE site = 'site2' AND line = 'bus1.jsonl'").fetchall()[0][0] == whole
    )


def test_all_that_is_whole_is_there_and_each_damage_is_listed(tmp_path):
    for site in range(4):
        for line in range(5):
            path = tmp_path / "src" / f"site{site}" / f"bus{line}.mcap"
            path.parent.mkdir(parents=True, exist_ok=True)
            captures.write(path, bus("noisy" if line % 2 else "clean", site * 10 + line, 16, span_ns=DAY_NS // 24))
    batch(tmp_path / "before", tmp_path / "src")
    harmed = {("site0", "bus3.mcap"): "cut", ("site2", "bus0.mcap"): "overwritten", ("site3", "bus4.mcap"): "rubbish"}
    for (name, file), how in harmed.items():
        path = tmp_path / "src" / name / file
        data, middle = path.read_bytes(), path.stat().st_size // 2
        damage = {"cut": b"", "overwritten": bytes(40) + data[middle + 40 :]}
        path.write_bytes(b"\xa5" * 99 if how == "rubbish" else data[:middle] + damage[how])
    result = batch(tmp_path / "after", tmp_path / "src")
    assert (result.captures, result.damaged, result.failed, len(result.troubles)) == (20, 3, 0, 3)
    before, after = Lake(str(tmp_path / "before")), Lake(str(tmp_path / "after"))
    listed = plain(ready(after, "damaged", Asked()))
    assert {(row["site"], row["line"]) for row in listed} == set(harmed) and all(row["first"] for row in listed)
    for table in ("frames", "transactions", "values", "findings", "causes", "hours"):
        one, two = (
            [row for row in rows(lake, table) if (row["site"], row["line"]) not in harmed] for lake in (before, after)
        )
        assert one == two and (one or table in ("findings", "causes")), table
    for name, file in harmed:  # and of those what can still be read, as it is by itself
        path = tmp_path / "src" / name / file
        readable = 0 if harmed[name, file] == "rubbish" else analyzer.open(path).to_arrow().num_rows
        count = after.sql(f"SELECT count(*) FROM frames WHERE site = '{name}' AND line = '{file}'").fetchall()[0][0]
        assert count == readable


def test_a_damaged_slice_leaves_the_others_of_its_ring(tmp_path):
    capture = bus("clean", transactions=100)
    paths = sliced(capture, [0.3, 0.6], tmp_path / "ring" / "site")
    paths[1].write_bytes(b"rubbish")
    result = batch(tmp_path / "lake", tmp_path / "ring")
    assert (result.captures, result.damaged, result.failed) == (3, 1, 0)
    whole = sum(analyzer.open(paths[n]).to_arrow().num_rows for n in (0, 2))
    assert abs(result.frames - whole) <= 1


def test_processes_make_the_lake_of_one_though_two_of_them_die(fleet, whole, tmp_path):
    functions = tmp_path / "dies.py"  # declarations are code, run in the worker
    functions.write_text(
        "import os, pathlib\nfrom construct import Pass\nfrom dissectors import Function\n"
        "OFFERED = Function(101, 'Good', Pass, Pass)\n"
        f"flag = pathlib.Path({str(tmp_path / 'deaths')!r})\n"
        "flag.mkdir(exist_ok=True)\n"
        "if len(list(flag.iterdir())) < 2:\n"
        "    (flag / str(os.getpid())).touch()\n"
        "    os._exit(9)\n"
    )
    options = BatchOptions(functions=(str(functions),))
    result = batch(tmp_path / "lake", fleet, runner=ProcessPool(2), options=options)
    assert (result.captures, result.failed) == (6, 0)
    assert same(tmp_path / "lake", whole)


@pytest.mark.skipif(os.name != "posix", reason="kills by signal")
def test_killed_at_any_moment_nothing_is_lost_or_doubled(sources, whole, tmp_path):
    """Three kills, each after the batch has got further; benchmarks.fleet_faults makes a hundred."""
    path, chance, killed, quiet = tmp_path / "lake", random.Random(1), 0, subprocess.DEVNULL
    command = [sys.executable, "-m", "analyzer.cli", "batch", str(sources), "-o", str(path), "--resume"]
    for least in (0, 1, 3):
        with subprocess.Popen(
            [*command, "--workers", "1"], stdout=quiet, stderr=quiet, cwd=Path(__file__).parents[1]
        ) as process:
            while process.poll() is None and not ((path / "scratch").is_dir() and _entries(path) >= least):
                time.sleep(0.005)
            time.sleep(chance.uniform(0, 0.1))
            process.send_signal(signal.SIGKILL)
        killed += process.returncode == -signal.SIGKILL
        if _entries(path):
            lake = Lake(str(path))  # whole at each moment
            done = lake.sql("SELECT count(DISTINCT (site, line)) FROM frames").fetchall()[0][0]
            assert done == len(lake.manifest.lines)
    assert killed > 0
    batch(path, sources)
    assert same(whole, path)
    named = Manifest(store(str(path))).named()
    left = {file.relative_to(path).as_posix() for file in path.rglob("*.parquet")}
    assert left == {name for name in named if name.endswith(".parquet")}


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes by their session")
def test_no_worker_outlives_its_batch(sources, tmp_path):
    """Neither one that is told to end nor one that is killed leaves processes, or words of Python's, behind."""
    functions = tmp_path / "sleeps.py"
    functions.write_text(
        "import multiprocessing, time\nfrom construct import Pass\nfrom dissectors import Function\n"
        "OFFERED = Function(101, 'Good', Pass, Pass)\n"
        "if multiprocessing.parent_process():\n"
        "    time.sleep(60)\n"
    )
    ways = (signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
    command = [sys.executable, "-m", "analyzer.cli", "batch", str(sources), "--workers", "2"]
    running = [
        subprocess.Popen(
            [*command, "--functions", str(functions), "-o", str(tmp_path / way.name)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            cwd=Path(__file__).parents[1],
            start_new_session=True,
        )
        for way in ways
    ]
    for way, process in zip(ways, running, strict=True):
        while len(_workers(process.pid)) < 2:
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(way)
        assert process.stderr is not None
        told = process.stderr.read().decode()  # until nobody has it open any more
        assert process.wait() == (-signal.SIGKILL if way == signal.SIGKILL else 130)
        if way != signal.SIGKILL:
            assert told == "rtuscope: stopped at once; partial output is kept: continue with --resume\n"


@pytest.mark.skipif(os.name != "posix", reason="ends by a signal")
def test_what_ends_a_batch_waits_until_a_worker_has_begun(sources, tmp_path, monkeypatch, capfd):
    """A worker whose batch ended before it had all that it begins with would say so in a traceback of Python's."""
    begin, begun = spawning.spawnv_passfds, []

    def begin_and_end(*given):
        number = begin(*given)
        if b"spawn_main" in b" ".join(map(os.fsencode, given[1])):
            begun.append(number)
            os.kill(os.getpid(), signal.SIGTERM)
        return number

    monkeypatch.setattr(spawning, "spawnv_passfds", begin_and_end)
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), endable():
        batch(tmp_path / "lake", sources, runner=ProcessPool(2))
    assert signal.getsignal(signal.SIGTERM) == before
    for number in begun:
        with suppress(ChildProcessError):  # the pool has waited for it
            os.waitpid(number, 0)
    assert begun
    assert capfd.readouterr().err == ""


def _workers(session):
    """The processes of a session that are a pool's workers."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            number, words = stat.parent.name, (stat.parent / "cmdline").read_bytes()
            if b"spawn_main" in words and os.getsid(int(number)) == session:
                found.append(int(number))
        except OSError:
            continue
    return found


def test_as_many_workers_as_were_asked_for_whatever_the_system_tells(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    asked = argparse.Namespace(scheduler=None, workers=1)
    assert chosen_runner(asked) is in_this_process


def _entries(lake):
    return len(list((lake / FOLDER).glob("*.json")))


def test_only_one_batch_writes_a_lake(fleet, tmp_path):
    pytest.importorskip("fcntl", reason="no locks on this system")
    with writing(store(str(tmp_path / "lake"))), pytest.raises(FleetError, match="another batch"):
        batch(tmp_path / "lake", fleet)
