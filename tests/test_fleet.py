"""Lakes: what batches make of captures, however they are cut, whoever does the work, whatever dies meanwhile."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import analyzer
import captures
from analyzer import languages
from analyzer.cli import main

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import BEGIN_NS, DAY_NS, batch, bus, plain, rows, same, sliced, write_fleet

from analyzer.fleet import FleetError
from analyzer.fleet.datasets import DATASETS
from analyzer.fleet.lake import Lake, sql_text
from analyzer.fleet.linetask import BatchOptions
from analyzer.fleet.questions import QUESTIONS, Asked, ready
from analyzer.fleet.sources import found, lines_of
from analyzer.reports import summarize
from analyzer.simulation.field.cases.registry import field_cases

LARGE = ("frames", "transactions", "values", "findings")


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """Captures of a fleet, to be read and left as they are."""
    return write_fleet(tmp_path_factory.mktemp("sources"))


@pytest.fixture(scope="module")
def made(sources, tmp_path_factory):
    """Their lake, to be asked and left as it is."""
    path = tmp_path_factory.mktemp("lakes") / "made"
    result = batch(path, sources)
    assert (result.lines, result.captures, result.failed, result.damaged) == (6, 6, 0, 0)
    return path


@pytest.fixture
def fleet(sources, tmp_path):
    """The captures, to be changed."""
    return shutil.copytree(sources, tmp_path / "src")


@pytest.fixture
def lake_path(made, tmp_path):
    """The lake, to go on with."""
    return shutil.copytree(made, tmp_path / "lake")


def test_a_lake_holds_what_an_export_does(sources, made):
    lake = analyzer.lake(made)
    assert lake.sites == ["site0", "site1", "site2"]
    bus1 = analyzer.open(sources / "site1" / "bus1.mcap")
    for table in LARGE:
        wanted = plain(bus1.to_arrow(table))
        names = ", ".join(f'"{name}"' for name in bus1.to_arrow(table).column_names)
        order = "start, port" if table == "frames" else "1"
        got = lake.arrow(f"SELECT {names} FROM {table} WHERE site = 'site1' AND line = 'bus1.mcap' ORDER BY {order}")
        assert len(wanted) > 0 and sorted(map(repr, plain(got))) == sorted(map(repr, wanted)), table
    frames = sum(analyzer.open(path).to_arrow().num_rows for path in sorted(sources.rglob("bus*")))
    assert lake.sql("SELECT count(*) FROM frames").fetchall()[0][0] == frames


def test_rows_lie_in_the_partition_of_their_day(made):
    lake = Lake(str(made))
    days = lake.sql("SELECT DISTINCT day FROM frames").fetchall()
    assert len(days) in (2, 3)
    for table, column in (("frames", "t_start_ns"), ("transactions", "t_start_ns"), ("values", "t_ns")):
        elsewhere = f"epoch_ns({column}) // {DAY_NS} <> day - DATE '1970-01-01'"
        wrong = lake.sql(f"SELECT count(*) FROM {table} WHERE {elsewhere}").fetchall()[0][0]
        assert wrong == 0


def test_hours_add_up_to_the_transactions(made):
    lake = Lake(str(made))
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


def test_what_an_adapter_shows_twice_is_one_request(tmp_path):
    made = field_cases()["echo-dead-unit"].capture("precise", 2)
    path = tmp_path / "site" / "bus.mcap"
    path.parent.mkdir()
    captures.write(path, captures.Capture.of(made.line, made.chunks))
    batch(tmp_path / "lake", tmp_path / "site")
    report = summarize(captures.open(path))
    counted = Lake(str(tmp_path / "lake")).sql(
        "SELECT unit, sum(requests)::BIGINT, sum(unanswered)::BIGINT, sum(retries)::BIGINT, sum(answered)::BIGINT"
        " FROM hours GROUP BY unit ORDER BY unit"
    )
    told = [(row.unit, row.counts) for row in report.units]
    assert report.transactions.echoes > 100
    assert counted.fetchall() == [(u, c.requests, c.unanswered, c.retries, c.answered) for u, c in told]


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
    (fleet / "site0" / "copy.mcap").write_bytes((fleet / "site0" / "bus0.mcap").read_bytes())
    more = batch(tmp_path / "lake", fleet)
    assert (more.captures, more.frames) == (1, 0)
    assert rows(tmp_path / "lake", "frames") == before
    states = Lake(str(tmp_path / "lake")).sql("SELECT state FROM captures WHERE line = 'copy.mcap'").fetchall()
    assert states == [("twice",)]


def test_other_options_are_told_and_redone_when_asked(sources, lake_path, tmp_path):
    noise = BatchOptions(noise=True)
    result = batch(lake_path, sources, options=noise)
    assert (result.captures, result.outdated) == (0, 6)
    result = batch(lake_path, sources, options=noise, redo=True)
    assert (result.captures, result.outdated) == (6, 0)
    batch(tmp_path / "fresh", sources, options=noise)
    assert same(lake_path, tmp_path / "fresh")


@pytest.mark.parametrize("name", QUESTIONS)
def test_ready_questions_answer(made, name, capsys):
    words = {"register": ["1", "0"], "compare": ["site0", "site1"]}.get(name, [])
    for more in (["--csv"], ["--json", "--since", "7d"], ["--site", "site1"]):
        assert main(["ask", str(made), name, *words, *more]) == 0, (name, more)
        out = capsys.readouterr().out
        assert out
        if "--json" in more:
            json.loads(out)
    assert main(["ask", str(made), name, "one", "two", "three", "four"]) == 2


def test_answers_are_json_and_csv_as_exports_are(made, capsys):
    text = "SELECT sum(1::BIGINT) n, 1.5::DECIMAL(4, 2) d, 'inf'::DOUBLE i, {'a': [1]} s, true b,\n" + (
        "TIMESTAMPTZ_NS '2026-01-02 03:04:05.000000006Z' t"
    )
    assert main(["ask", str(made), text, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert row == {"n": 1, "d": 1.5, "i": None, "s": {"a": [1]}, "b": True, "t": "2026-01-02T03:04:05.000000006Z"}
    assert main(["ask", str(made), "SELECT\ntrue AS b, sum(1) AS n", "--csv"]) == 0
    assert capsys.readouterr().out == "b,n\ntrue,1\n"
    assert main(["ask", str(made), "DESCRIBE frames", "--csv"]) == 0
    assert "t_start_ns" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["worst-unit"], "did you mean worst-units?"),
        (["silent", "--site", "site"], "did you mean site"),
        (["compare", "site0", "sit1"], "no site 'sit1' in the lake: did you mean site1?"),
        (["silent", "--limit", "many"], "'many' is not a number of rows (at least 1)"),
        ([], "are required: QUESTION (see"),
    ],
)
def test_what_was_meant_is_told(made, words, said, capsys):
    assert main(["ask", str(made), *words]) == 2
    assert said in capsys.readouterr().err


WRITES = (
    "COPY frames TO '{new}'",
    "COPY findings TO '{own}' (FORMAT parquet)",
    "EXPORT DATABASE '{new}'",
    "CREATE TABLE t AS SELECT 1",
    "CREATE OR REPLACE VIEW frames AS SELECT 1 AS a",
    "DROP VIEW frames",
    "INSERT INTO frames SELECT * FROM frames",
    "ATTACH '{new}'",
    "INSTALL httpfs",
    "LOAD '{new}'",
    "SET memory_limit = '10GB'",
    "RESET memory_limit",
    "PRAGMA enable_profiling",
    "CALL enable_logging()",
    "CHECKPOINT",
    "VACUUM",
    "BEGIN TRANSACTION",
    "PREPARE p AS SELECT 1",
)
AROUND = (
    "{}",
    "EXPLAIN {}",
    "EXPLAIN ANALYZE {}",
    "WITH t AS ({}) SELECT * FROM t",
    "SELECT (WITH t AS ({}) SELECT count(*) FROM t)",
    "SELECT * FROM ({}) t",
    "WITH a AS (SELECT 1), b AS (WITH c AS ({}) FROM c) SELECT * FROM a, b",
    "SELECT 1 UNION ALL (WITH t AS ({}) SELECT 1 FROM t)",
    "SELECT 1; {}",
    "{}; SELECT 1",
    "DESCRIBE {}",
    "SUMMARIZE {}",
)


def everything(folder):
    return {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("around", AROUND)
def test_no_statement_writes_whatever_stands_around_it(made, tmp_path, around, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lake = Lake(str(made))
    own = lake.files("frames").loose[0]
    before = everything(Path(str(made)))
    for write in WRITES:
        for run in ("{}", "FROM query({})", "SELECT * FROM QUERY({})"):
            text = around.format(write.format(new=tmp_path / "new", own=own))
            with pytest.raises(FleetError) as told:
                lake.arrow(run.format(text if run == "{}" else sql_text(text)))
            assert "\n" not in str(told.value)
    assert everything(Path(str(made))) == before
    assert not list(tmp_path.iterdir())
    assert lake.sql("SELECT count(*) FROM frames").fetchall()[0][0] > 0


def test_a_connection_opens_no_file_but_those_of_the_tables(made, tmp_path):
    connection = Lake(str(made)).duckdb()
    for text in (
        f"COPY frames TO '{tmp_path / 'new.csv'}'",
        f"COPY frames TO '{made}/new.parquet'",
        f"SELECT * FROM read_text('{made}/manifest/*')",
        "SET enable_external_access = true",
    ):
        with pytest.raises(pytest.importorskip("duckdb").Error):
            connection.execute(text)


@pytest.mark.parametrize(
    "text",
    [
        "FROM frames",
        "TABLE frames",
        "VALUES (1)",
        "DESCRIBE frames",
        "SUMMARIZE frames",
        "SHOW TABLES",
        "SELECT 1 UNION SELECT 2 ORDER BY 1 LIMIT 1;",
        "WITH RECURSIVE t AS (SELECT 1 a UNION ALL SELECT a + 1 FROM t WHERE a < 5) SELECT max(a) FROM t",
        "SELECT unit, (SELECT count(*) FROM findings) FROM frames QUALIFY row_number() OVER (PARTITION BY unit) = 1",
    ],
)
def test_queries_of_any_shape_are_answered(made, text):
    assert Lake(str(made)).arrow(text).num_rows > 0


def test_what_is_no_query_of_the_lake_is_refused(made, tmp_path, capsys):
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
        assert main(["ask", str(made), sql]) == 2, sql
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

    from analyzer.fleet.questions import drifts

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

    (change,) = plain(drifts([table(low)]))
    assert change["what"].startswith("mean response time")
    assert abs((change["since"] - int(times[120])) // 3_600_000_000_000) <= 3
    steady = (chance.normal(10, 0.8, count) * 100 * 1e6).astype(np.int64)
    assert drifts([table(steady)]).num_rows == 0


def test_watch_takes_what_came_since(fleet, tmp_path, capsys):
    command = ["watch", str(tmp_path / "lake"), "--from", str(fleet), "--once", "--workers", "1"]
    assert main(command) == 0
    assert "6 captures" in capsys.readouterr().out
    captures.write(fleet / "site0" / "new.mcap", bus("clean", 99, 20))
    assert main(command) == 0
    assert "1 capture of 1 bus line taken in, 6 were" in capsys.readouterr().out
    assert main(command) == 0
    assert "0 captures of 0 bus lines taken in, 7 were there already" in capsys.readouterr().out


def test_batch_will_not_mix_into_a_lake_unasked(sources, lake_path, capsys):
    command = ["batch", str(sources), "-o", str(lake_path), "--workers", "1"]
    assert main(command) == 2
    assert "--resume" in capsys.readouterr().err
    assert main([*command, "--resume"]) == 0
    assert main(["ask", str(sources), "worst-units"]) == 2
    assert "is not a lake" in capsys.readouterr().err


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


def test_sites_by_the_headers_of_captures(tmp_path):
    from dataclasses import replace

    capture = bus("clean", transactions=10)
    (tmp_path / "in").mkdir()
    for name, notes in (("a.jsonl", {"site": "plant 7"}), ("b.mcap", {"site": "plant 8"}), ("c.jsonl", {})):
        captures.write(tmp_path / "in" / name, capture.chunks(), line=replace(capture.line, notes=notes))
    (tmp_path / "in" / "d.jsonl").write_bytes(b"{")
    files = found([str(tmp_path / "in")])
    assert [line.site for line in lines_of(files, pattern="header")] == ["in", "in", "plant 7", "plant 8"]
    assert {line.site for line in lines_of(files)} == {"in"}
    assert {line.site for line in lines_of(files, "x", "header")} == {"x"}


@pytest.mark.parametrize("words", [("256", "0"), ("1", "65536"), ("x", "0"), ("1", "-1"), ("1", "0", "relay")])
def test_a_register_that_cannot_be_is_told(made, words):
    with pytest.raises(FleetError, match="register takes UNIT"):
        ready(Lake(str(made)), "register", Asked(words))


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_a_register_is_drawn(made, tmp_path, ending):
    pytest.importorskip("matplotlib", reason="pictures are drawn by matplotlib")
    begins = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    picture = tmp_path / f"register.{ending}"
    unit, address = register_of(made)
    command = ["ask", str(made), "register", unit, address, "--plot", str(picture)]
    assert main(command) == 0
    data = picture.read_bytes()
    assert data.startswith(begins[ending])
    assert main(command) == 2 and picture.read_bytes() == data
    assert main([*command, "--overwrite", "--site", "site1"]) == 0


def test_what_cannot_be_drawn_is_told(made, tmp_path, capsys):
    for words, told in (
        (["register", "1", "0", "--plot", "x.txt"], "must end in"),
        (["register", "200", "65000", "--plot", str(tmp_path / "x.png")], "there is no data on"),
        (["worst-units", "--plot", str(tmp_path / "x.png")], "register"),
    ):
        assert main(["ask", str(made), *words]) == 2
        assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_register_as_csv_is_all_of_its_values(made, capsys):
    unit, address = register_of(made)
    assert main(["ask", str(made), "register", unit, address, "--site", "site1", "--csv"]) == 0
    heading, *lines = capsys.readouterr().out.splitlines()
    assert heading == "t_ns,site,line,area,raw"
    wanted = Lake(str(made)).sql(
        f"SELECT count(*) FROM values WHERE unit = {unit} AND address = {address} AND site = 'site1'"
    )
    assert len(lines) == wanted.fetchall()[0][0] > 2


def register_of(made):
    """The register of site1 that was read most often, as words."""
    by_count = "GROUP BY ALL ORDER BY count(*) DESC, unit, address LIMIT 1"
    often = f"SELECT unit, address FROM values WHERE site = 'site1' {by_count}"
    return [str(word) for word in Lake(str(made)).sql(often).fetchall()[0]]


@pytest.mark.parametrize("name", QUESTIONS)
def test_a_limit_holds_for_every_question(made, name):
    unit, address = register_of(made)
    words = {"register": (unit, address), "compare": ("site0", "site1")}.get(name, ())
    lake = Lake(str(made))
    every = ready(lake, name, Asked(words, limit=10**6))
    assert ready(lake, name, Asked(words, limit=1)).equals(every.slice(0, 1))
    shown = 20 if QUESTIONS[name].most else None
    assert ready(lake, name, Asked(words)).equals(every.slice(0, shown))
    assert name not in ("register", "compare") or len(every) > 1


def test_a_limit_on_sql_is_refused(made, capsys):
    assert main(["ask", str(made), "SELECT 1 AS a", "--limit", "4"]) == 2
    assert "--limit" in capsys.readouterr().err


def test_a_line_without_a_clock_is_not_silent_since_1970_and_keeps_its_causes(tmp_path, capsys):
    for name, begin_ns in (("dated.mcap", BEGIN_NS), ("undated.mcap", 0)):
        (tmp_path / "src").mkdir(exist_ok=True)
        captures.write(tmp_path / "src" / name, bus(begin_ns=begin_ns, transactions=400))
    batch(tmp_path / "lake", tmp_path / "src")
    path = str(tmp_path / "lake")
    assert "nothing recorded any more" not in {row["what"] for row in plain(ready(Lake(path), "silent", Asked()))}
    asked = plain(ready(Lake(path), "new-causes", Asked()))
    assert {row["line"] for row in asked} == {"dated.mcap", "undated.mcap"}
    assert main(["ask", path, "new-causes"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert all(line.startswith("no clock") == ("undated.mcap" in line) for line in told[1:])


def test_causes_of_a_lake_are_told_in_the_language_in_use(tmp_path, capsys):
    (tmp_path / "src").mkdir()
    captures.write(tmp_path / "src" / "one.mcap", bus(transactions=400))
    captures.write(tmp_path / "src" / "two.mcap", bus(transactions=400, begin_ns=BEGIN_NS + 9 * DAY_NS))
    batch(tmp_path / "lake", tmp_path / "src")
    try:
        for question in ("new-causes", "silent"):
            assert main(["ask", str(tmp_path / "lake"), question, "--since", "2d", "--lang", "ru"]) == 0
            _, *told = capsys.readouterr().out.splitlines()
            assert told and all(re.search("[а-я]{4}", line) for line in told)
        assert main(["ask", str(tmp_path / "lake"), "new-causes", "--json", "--lang", "ru"]) == 0
        assert all(re.search("[а-я]{4}", row["remedy"]) for row in json.loads(capsys.readouterr().out))
    finally:
        languages.use_language("en")


def test_the_columns_of_each_view_are_those_that_the_page_names(made):
    for table, dataset in DATASETS.items():
        names = Lake(str(made)).arrow(f"SELECT * FROM {table} LIMIT 0").column_names
        assert names[-2:] == (["site", "day"] if dataset.time else [dataset.schema.names[-1], "site"])
    page = (Path(__file__).parents[1] / "docs" / "fleet.md").read_text(encoding="utf-8")
    without = [f"`{table}`" for table, dataset in DATASETS.items() if not dataset.time]
    assert f"({', '.join(without[:-1])} and {without[-1]} have their times alone)" in page
