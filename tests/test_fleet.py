"""Lakes: what batches make of captures, however they are cut, whoever does the work, whatever dies meanwhile."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import analyzer
import captures
from analyzer.cli import main

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import BEGIN_NS, DAY_NS, batch, bus, plain, rows, same, sliced

from analyzer.fleet.datasets import DATASETS, LakeFiles
from analyzer.fleet.errors import FleetError
from analyzer.fleet.lake import Lake
from analyzer.fleet.linestate import LineState, resumed
from analyzer.fleet.manifest import Manifest
from analyzer.fleet.questions import QUESTIONS, Asked, ready
from analyzer.fleet.runners import ProcessPool
from analyzer.fleet.sources import found, lines_of
from analyzer.fleet.stores import store
from analyzer.fleet.tasks import BatchOptions
from analyzer.options import Options

LARGE = ("frames", "transactions", "values", "findings")


@pytest.fixture
def fleet(tmp_path):
    """Three sites with two lines each, over days."""
    for site in range(3):
        for line in range(2):
            capture = bus("noisy" if site else "clean", seed=site * 10 + line, span_ns=3 * DAY_NS, transactions=60)
            path = tmp_path / "src" / f"site{site}" / f"bus{line}.jsonl"
            path.parent.mkdir(parents=True, exist_ok=True)
            captures.write(path, capture)
    return tmp_path / "src"


def test_a_lake_holds_what_an_export_does(fleet, tmp_path):
    result = batch(tmp_path / "lake", fleet)
    assert (result.lines, result.captures, result.failed, result.damaged) == (6, 6, 0, 0)
    lake = analyzer.lake(tmp_path / "lake")
    assert lake.sites == ["site0", "site1", "site2"]
    bus1 = analyzer.open(fleet / "site1" / "bus1.jsonl")
    for table in LARGE:
        wanted = plain(bus1.to_arrow(table))
        names = ", ".join(f'"{name}"' for name in bus1.to_arrow(table).column_names)
        order = "start, port" if table == "frames" else "1"
        got = lake.arrow(f"SELECT {names} FROM {table} WHERE site = 'site1' AND line = 'bus1.jsonl' ORDER BY {order}")
        assert len(wanted) > 0 and sorted(map(repr, plain(got))) == sorted(map(repr, wanted)), table
    assert lake.sql("SELECT count(*) FROM frames").fetchall()[0][0] == result.frames


def test_rows_lie_in_the_partition_of_their_day(fleet, tmp_path):
    batch(tmp_path / "lake", fleet)
    lake = Lake(str(tmp_path / "lake"))
    days = lake.sql("SELECT DISTINCT day FROM frames").fetchall()
    assert len(days) == 4 or len(days) == 3
    for table, column in (("frames", "t_start_ns"), ("transactions", "t_start_ns"), ("values", "t_ns")):
        elsewhere = f"epoch_ns({column}) // {DAY_NS} <> day - DATE '1970-01-01'"
        wrong = lake.sql(f"SELECT count(*) FROM {table} WHERE {elsewhere}").fetchall()[0][0]
        assert wrong == 0


def test_hours_add_up_to_the_transactions(fleet, tmp_path):
    batch(tmp_path / "lake", fleet)
    lake = Lake(str(tmp_path / "lake"))
    one = lake.sql(
        "SELECT site, line, unit, count(*), count(*) FILTER (WHERE status = 'unanswered'),"
        " count(*) FILTER (WHERE retry), sum(response_time_low_ns)::BIGINT, max(response_time_high_ns)"
        " FROM transactions GROUP BY ALL ORDER BY ALL"
    ).fetchall()
    two = lake.sql(
        "SELECT site, line, unit, sum(requests)::BIGINT, sum(unanswered)::BIGINT, sum(retries)::BIGINT,"
        " if(sum(timed) > 0, sum(response_time_low_sum_ns), NULL)::BIGINT,"
        " if(sum(timed) > 0, max(response_time_high_max_ns), NULL)"
        " FROM hours GROUP BY ALL ORDER BY ALL"
    ).fetchall()
    assert len(one) > 5 and one == two


@settings(max_examples=6, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    st.integers(0, 50),
    st.lists(st.floats(0, 1), min_size=1, max_size=6),
    st.sampled_from(["clean", "noisy"]),
    st.booleans(),
)
def test_a_ring_gives_exactly_the_rows_of_one_pass(tmp_path_factory, seed, cuts, wire, late):
    folder = tmp_path_factory.mktemp("ring")
    capture = bus(wire, seed, span_ns=2 * DAY_NS, transactions=50)
    sliced(capture, [], folder / "one" / "site")
    paths = sliced(capture, cuts, folder / "many" / "site")
    batch(folder / "lake1", folder / "one")
    if late:  # slice after slice, as they come
        for last in range(1, len(paths) + 1):
            batch(folder / "lake2", *paths[:last])
    else:
        batch(folder / "lake2", folder / "many")
    assert same(folder / "lake1", folder / "lake2", [table for table in DATASETS if table != "captures"])


def test_a_ring_that_gave_up_its_old_files_goes_on(tmp_path):
    capture = bus(transactions=100)
    sliced(capture, [], tmp_path / "one" / "site")
    paths = sliced(capture, [0.3, 0.6], tmp_path / "ring" / "site")
    batch(tmp_path / "lake", *paths[:2])
    paths[0].unlink()
    paths[1].unlink()
    result = batch(tmp_path / "lake", tmp_path / "ring")
    assert (result.captures, result.skipped) == (1, 0)
    batch(tmp_path / "whole", tmp_path / "one")
    assert same(tmp_path / "lake", tmp_path / "whole", ["frames", "transactions", "findings", "values", "hours"])


def test_a_slice_that_comes_late_is_put_in_its_place(tmp_path):
    capture = bus(transactions=100)
    sliced(capture, [], tmp_path / "one" / "site")
    first, second, third = sliced(capture, [0.3, 0.6], tmp_path / "ring" / "site")
    batch(tmp_path / "lake", first, third)
    batch(tmp_path / "lake", first, second, third)
    batch(tmp_path / "whole", tmp_path / "one")
    assert same(tmp_path / "lake", tmp_path / "whole", ["frames", "transactions", "findings", "values", "hours"])


def test_nothing_is_done_twice(fleet, tmp_path):
    batch(tmp_path / "lake", fleet)
    before = rows(tmp_path / "lake", "frames")
    again = batch(tmp_path / "lake", fleet)
    assert (again.captures, again.skipped) == (0, 6)
    (fleet / "site0" / "copy.jsonl").write_bytes((fleet / "site0" / "bus0.jsonl").read_bytes())
    more = batch(tmp_path / "lake", fleet)
    assert (more.captures, more.frames) == (1, 0)
    assert rows(tmp_path / "lake", "frames") == before
    states = Lake(str(tmp_path / "lake")).sql("SELECT state FROM captures WHERE line = 'copy.jsonl'").fetchall()
    assert states == [("twice",)]


def test_other_options_are_told_and_redone_when_asked(fleet, tmp_path):
    batch(tmp_path / "lake", fleet)
    noise = BatchOptions(noise=True)
    result = batch(tmp_path / "lake", fleet, options=noise)
    assert (result.captures, result.outdated) == (0, 6)
    result = batch(tmp_path / "lake", fleet, options=noise, redo=True)
    assert (result.captures, result.outdated) == (6, 0)
    batch(tmp_path / "fresh", fleet, options=noise)
    assert same(tmp_path / "lake", tmp_path / "fresh")


def test_one_bad_file_never_stops_the_rest(fleet, tmp_path):
    (fleet / "site0" / "empty.jsonl").write_bytes(b"")
    (fleet / "site1" / "picture.bin").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    cut = fleet / "site2" / "bus1.jsonl"
    lines = cut.read_bytes().splitlines(keepends=True)
    cut.write_bytes(b"".join([*lines[:40], b"{ damage }\n", *lines[41:]]))
    result = batch(tmp_path / "lake", fleet, runner=ProcessPool(2))
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


def test_a_damaged_slice_leaves_the_others_of_its_ring(tmp_path):
    capture = bus("clean", transactions=100)
    paths = sliced(capture, [0.3, 0.6], tmp_path / "ring" / "site")
    paths[1].write_bytes(b"rubbish")
    result = batch(tmp_path / "lake", tmp_path / "ring")
    assert (result.captures, result.damaged, result.failed) == (3, 1, 0)
    whole = sum(analyzer.open(paths[n]).to_arrow().num_rows for n in (0, 2))
    assert abs(result.frames - whole) <= 1


def test_processes_make_the_lake_of_one(fleet, tmp_path):
    batch(tmp_path / "one", fleet)
    batch(tmp_path / "two", fleet, runner=ProcessPool(2))
    assert same(tmp_path / "one", tmp_path / "two")


@pytest.mark.skipif(os.name != "posix", reason="kills by signal")
def test_killed_at_any_moment_nothing_is_lost_or_doubled(fleet, tmp_path):
    batch(tmp_path / "whole", fleet)
    command = [sys.executable, "-m", "analyzer.cli", "batch", str(fleet), "-o", str(tmp_path / "lake"), "--resume"]
    chance, killed, quiet = random.Random(1), 0, subprocess.DEVNULL
    for _ in range(12):
        process = subprocess.Popen(
            [*command, "--workers", "1"], stdout=quiet, stderr=quiet, cwd=Path(__file__).parents[1]
        )
        try:
            status = process.wait(chance.uniform(0.3, 2.0))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
            killed += 1
            if (tmp_path / "lake" / "manifest").is_dir() and Manifest(store(str(tmp_path / "lake"))).newest:
                lake = Lake(str(tmp_path / "lake"))  # whole at each moment
                done = lake.sql("SELECT count(DISTINCT (site, line)) FROM frames").fetchall()[0][0]
                assert done == len(lake.manifest.lines)
        else:
            assert status == 0
            break
    assert killed > 0
    batch(tmp_path / "lake", fleet)
    assert same(tmp_path / "whole", tmp_path / "lake")
    named = Manifest(store(str(tmp_path / "lake"))).named()
    left = list((tmp_path / "lake").rglob("*.parquet"))
    assert {p.relative_to(tmp_path / "lake").as_posix() for p in left} == {n for n in named if n.endswith(".parquet")}


def test_only_one_batch_writes_a_lake(fleet, tmp_path):
    pytest.importorskip("fcntl", reason="no locks on this system")
    from analyzer.fleet.manifest import writing

    with writing(store(str(tmp_path / "lake"))), pytest.raises(FleetError, match="another batch"):
        batch(tmp_path / "lake", fleet)


def test_a_worker_that_dies_is_tried_again_and_then_told(fleet, tmp_path):
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
    batch(tmp_path / "whole", fleet)
    assert same(tmp_path / "lake", tmp_path / "whole")


def test_a_state_is_nothing_but_a_state(tmp_path):
    import pickle

    capture = bus()
    state = LineState(capture.line, Options(), noise=False)
    files = LakeFiles(store(str(tmp_path)), "site", "line", "x")
    assert list(state.slice(capture, files))
    assert resumed(state.kept()).octets == state.octets > 0

    class Evil:
        def __reduce__(self):
            return os.system, ("true",)

    for data in (pickle.dumps(Evil()), pickle.dumps(42), b"", b"\x80\x05."):
        with pytest.raises(FleetError):
            resumed(data)


@pytest.mark.parametrize("name", QUESTIONS)
def test_ready_questions_answer(fleet, tmp_path, name, capsys):
    batch(tmp_path / "lake", fleet / "site0", fleet / "site1")
    words = {"register": ["1", "0"], "compare": ["site0", "site1"]}.get(name, [])
    for more in (["--csv"], ["--json", "--since", "7d"], ["--site", "site1"]):
        assert main(["ask", str(tmp_path / "lake"), name, *words, *more]) == 0, (name, more)
        out = capsys.readouterr().out
        assert out
        if "--json" in more:
            json.loads(out)
    assert main(["ask", str(tmp_path / "lake"), name, "one", "two", "three", "four"]) == 2


def test_what_is_no_query_of_the_lake_is_refused(fleet, tmp_path, capsys):
    batch(tmp_path / "lake", fleet)
    secret = tmp_path / "secret.csv"
    secret.write_text("a\n1\n")
    for sql in (
        "DROP VIEW frames",
        f"COPY frames TO '{tmp_path / 'out.csv'}'",
        "SELECT 1; SELECT 2",
        f"SELECT * FROM read_csv('{secret}')",
        "SELEC 1",
        "SET enable_external_access = true",
    ):
        assert main(["ask", str(tmp_path / "lake"), sql]) == 2, sql
        assert len(capsys.readouterr().err.strip().splitlines()) == 1, sql
    assert not (tmp_path / "out.csv").exists()


def test_names_of_sites_may_be_anything(tmp_path):
    name = "a'b/../c d%é=1"
    captures.write(tmp_path / "bus.jsonl", bus("clean"))
    batch(tmp_path / "it's a lake", tmp_path / "bus.jsonl", site=name)
    lake = Lake(str(tmp_path / "it's a lake"))
    assert lake.sites == [name]
    assert lake.sql("SELECT DISTINCT site FROM frames").fetchall() == [(name,)]
    assert ready(lake, "register", Asked(("1", "0"), site=name)) is not None


def test_a_change_for_good_is_found_with_its_hour():
    import pyarrow as pa

    from analyzer.fleet.drift import drifts

    chance = np.random.default_rng(1)
    count = 200
    mean = np.where(np.arange(count) < 120, 10.0, 14.0) + chance.normal(0, 0.8, count)
    low = (mean * 100 * 1e6).astype(np.int64)
    times = BEGIN_NS // 3_600_000_000_000 * 3_600_000_000_000 + np.arange(count) * 3_600_000_000_000

    def table(low):
        return pa.table(
            {
                "site": ["a"] * count,
                "line": ["b"] * count,
                "unit": pa.array([7] * count, pa.uint8()),
                "t_ns": pa.array(times).view(pa.timestamp("ns", "UTC")),
                "asked": [100] * count,
                "bad": [1] * count,
                "timed": [100] * count,
                "low": low,
                "high": low,
            }
        )

    (change,) = plain(drifts(table(low)))
    assert change["what"].startswith("mean response time")
    assert abs((change["since"] - int(times[120])) // 3_600_000_000_000) <= 3
    steady = (chance.normal(10, 0.8, count) * 100 * 1e6).astype(np.int64)
    assert drifts(table(steady)).num_rows == 0


def test_watch_takes_what_came_since(fleet, tmp_path, capsys):
    command = ["watch", str(tmp_path / "lake"), "--from", str(fleet), "--once", "--workers", "1"]
    assert main(command) == 0
    assert "6 captures" in capsys.readouterr().out
    captures.write(fleet / "site0" / "new.jsonl", bus("clean", 99))
    assert main(command) == 0
    assert "1 captures" in capsys.readouterr().out
    assert main(command) == 0
    assert capsys.readouterr().out == ""


def test_batch_will_not_mix_into_a_lake_unasked(fleet, tmp_path, capsys):
    command = ["batch", str(fleet), "-o", str(tmp_path / "lake"), "--workers", "1"]
    assert main(command) == 0
    assert main(command) == 2
    assert "--resume" in capsys.readouterr().err
    assert main([*command, "--resume"]) == 0
    assert main(["ask", str(fleet), "worst-units"]) == 2
    assert "is no lake" in capsys.readouterr().err


def test_sites_and_lines_by_a_pattern(tmp_path):
    for name in ("a_main_1.jsonl", "a_main_2.jsonl", "b_main_1.jsonl"):
        (tmp_path / name).write_text("x")
    files = found([str(tmp_path)])
    lines = lines_of(files, pattern=r"/(?P<site>\w)_(?P<line>\w+)_\d\.jsonl$")
    assert [(line.site, line.line, len(line.files), line.sliced) for line in lines] == [
        ("a", "main", 2, True),
        ("b", "main", 1, True),
    ]
    for pattern in ("(", "x", r"/(?P<site>zz)"):
        with pytest.raises(FleetError):
            lines_of(files, pattern=pattern)


def test_the_page_of_a_fleet_tells_each_site(fleet, tmp_path, capsys):
    hostile = "<script>alert(1)</script>"
    captures.write(tmp_path / "x.jsonl", bus("noisy", 5))
    batch(tmp_path / "lake", fleet)
    batch(tmp_path / "lake", tmp_path / "x.jsonl", site=hostile)
    page = tmp_path / "fleet.html"
    assert main(["report", str(tmp_path / "lake"), "--html", str(page)]) == 0
    text = page.read_text()
    assert hostile not in text and "&lt;script&gt;" in text
    assert all(f'id="site-site{n}"' in text for n in range(3))
    assert "interference" in text
    assert main(["report", str(tmp_path / "lake")]) == 2
    assert "--html" in capsys.readouterr().err
