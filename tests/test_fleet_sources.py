"""What a lake is made of: captures that are none, that change, that cannot be read; slices that do not follow."""

from __future__ import annotations

import errno
import os
import shlex
import shutil
import sys
from pathlib import Path

import pytest

import captures

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import batch, bus, ring, rows, same

from analyzer import version
from analyzer.cli import main
from analyzer.cli.watch import _there
from analyzer.extras import needs
from analyzer.fleet import FleetError, LakeWriteError, datasets, linetask
from analyzer.fleet.lake import Lake
from analyzer.fleet.manifest import Manifest
from analyzer.fleet.sources import found, lines_of
from analyzer.fleet.stores import store
from analyzer.languages import retold, telling

posix = pytest.mark.skipif(os.name != "posix", reason="links, pipes and names of any bytes are POSIX's")


@pytest.fixture
def whole(tmp_path):
    """A capture in a folder of its own."""
    path = tmp_path / "src" / "site" / "bus.mcap"
    path.parent.mkdir(parents=True)
    captures.write(path, bus("clean", 1, 20))
    return path


def states(lake):
    """What the table `captures` says of each file, by its name."""
    found = Lake(str(lake)).sql("SELECT source, state, damage FROM captures").fetchall()
    return {source.rpartition("/")[2]: (state, damage) for source, state, damage in found}


@posix
def test_what_has_a_captures_name_and_is_none_is_told(whole, tmp_path):
    (whole.parent / "gone.mcap").symlink_to("nowhere.mcap")
    (whole.parent / "loop.mcap").symlink_to("loop.mcap")
    (whole.parent / "folder.mcap").mkdir()
    os.mkfifo(whole.parent / "pipe.mcap")
    result = batch(tmp_path / "lake", tmp_path / "src")
    assert (result.captures, result.damaged, result.failed, len(result.troubles)) == (5, 4, 0, 4)
    told = states(tmp_path / "lake")
    assert told["gone.mcap"] == told["loop.mcap"] == ("unreadable", ["is a broken link"])
    assert told["folder.mcap"] == ("unreadable", ["is a folder without captures"])
    assert told["pipe.mcap"] == ("unreadable", ["is a pipe, a socket or a device, not a file"])
    assert told["bus.mcap"] == ("whole", [])
    assert batch(tmp_path / "lake", tmp_path / "src").captures == 0
    (whole.parent / "gone.mcap").unlink()
    captures.write(whole.parent / "gone.mcap", bus("clean", 2, 20))
    assert batch(tmp_path / "lake", tmp_path / "src").captures == 1
    assert states(tmp_path / "lake")["gone.mcap"] == ("whole", [])


@posix
def test_links_are_of_the_folder_that_they_were_put_in(whole, tmp_path):
    linked = tmp_path / "links"
    (linked / "plant").mkdir(parents=True)
    (linked / "plant" / "today.mcap").symlink_to(whole)
    (linked / "other").symlink_to(whole.parent)
    (linked / "round").symlink_to(linked)
    lines = lines_of(found([str(linked)]))
    assert [(line.site, line.line) for line in lines] == [("other", "bus.mcap"), ("plant", "today.mcap")]
    assert [file.url for file in found([f"{tmp_path}/links/*"])] == [file.url for line in lines for file in line.files]


@posix
@pytest.mark.parametrize("name", [b"caf\xe9.mcap", b"two\nlines.mcap", b"quo'\"te.mcap", b"\x1b[31m.mcap"])
def test_any_name_of_a_file_is_taken(name, tmp_path):
    folder = os.fsencode(tmp_path / "src") + b"/si\xe9te"
    Path(os.fsdecode(folder)).mkdir(parents=True)
    captures.write(tmp_path / "one.mcap", bus("clean", 1, 20))
    try:
        shutil.copyfile(os.fsencode(tmp_path / "one.mcap"), folder + b"/" + name)
    except OSError:
        pytest.skip("this file system takes no such names")
    result = batch(tmp_path / "lake", os.fsdecode(tmp_path / "src"))
    assert (result.captures, result.failed, result.damaged) == (1, 0, 0)
    lake = Lake(str(tmp_path / "lake"))
    shown = name.decode("utf-8", "backslashreplace")
    assert lake.sites == ["si\\xe9te"]
    assert lake.sql("SELECT DISTINCT site, line FROM frames").fetchall() == [("si\\xe9te", shown)]
    assert batch(tmp_path / "lake", os.fsdecode(tmp_path / "src")).captures == 0


def test_a_long_name_of_a_site_is_one(tmp_path):
    site = "Котельная № 12, улица Ленина, дом 5, второй подвал, щит управления насосами"
    path = tmp_path / site / "bus.mcap"
    path.parent.mkdir()
    captures.write(path, bus("clean", 1, 20))
    batch(tmp_path / "lake", path.parent)
    lake = Lake(str(tmp_path / "lake"))
    assert lake.sql("SELECT DISTINCT site FROM frames UNION SELECT site FROM captures").fetchall() == [(site,)]


@pytest.mark.usefixtures("whole")
def test_a_folder_that_cannot_be_looked_into_is_told(tmp_path, monkeypatch, capsys):
    shut = tmp_path / "src" / "shut"
    shut.mkdir()
    scandir = os.scandir

    def scan(path):
        if str(path) == str(shut):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return scandir(path)

    monkeypatch.setattr(os, "scandir", scan)
    with pytest.raises(FleetError, match="shut: permission denied"):
        found([str(tmp_path / "src")])
    for resume in ([], ["--resume"]):  # as long as it is so
        assert main(["batch", str(tmp_path / "src"), "-o", str(tmp_path / "lake"), "--workers", "1", *resume]) == 1
        assert f"{shut}: permission denied" in capsys.readouterr().err


def test_what_may_not_be_read_is_read_once_it_may(whole, tmp_path, monkeypatch):
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != whole and access(path, mode))
    result = batch(tmp_path / "lake", tmp_path / "src")
    assert (result.damaged, result.frames) == (1, 0) and "permission denied" in result.troubles[0]
    assert states(tmp_path / "lake")["bus.mcap"] == ("unreadable", ["permission denied"])
    assert batch(tmp_path / "lake", tmp_path / "src").captures == 0
    monkeypatch.undo()
    assert batch(tmp_path / "lake", tmp_path / "src").frames
    assert states(tmp_path / "lake")["bus.mcap"] == ("whole", [])


def test_a_disk_that_fails_is_told_in_a_line(whole, tmp_path, monkeypatch):
    def broken(_path):
        raise OSError(errno.EIO, os.strerror(errno.EIO), str(whole))

    monkeypatch.setattr(linetask, "_digest", broken)
    result = batch(tmp_path / "lake", tmp_path / "src")
    assert result.damaged == 1 and result.troubles == [f"{whole.as_posix()}: input/output error"]


@pytest.mark.parametrize("change", ["shrinks", "grows", "goes"])
def test_a_capture_that_changes_while_it_is_read_is_told(whole, tmp_path, monkeypatch, change):
    opened = linetask._opened

    def open_and_change(path, options):
        capture = opened(path, options)
        if change == "goes":
            path.unlink()
        elif change == "grows":
            path.write_bytes(path.read_bytes() + bytes(100))
        else:
            os.truncate(path, path.stat().st_size // 2)
        return capture

    monkeypatch.setattr(linetask, "_opened", open_and_change)
    result = batch(tmp_path / "lake", tmp_path / "src")
    assert result.failed == 0
    if change != "goes":
        state, damage = states(tmp_path / "lake")["bus.mcap"]
        assert state != "whole" and damage
    monkeypatch.undo()
    captures.write(whole, bus("clean", 1, 40))
    assert batch(tmp_path / "lake", tmp_path / "src").damaged == 0
    assert states(tmp_path / "lake")["bus.mcap"] == ("whole", [])


@pytest.mark.usefixtures("whole")
def test_a_lake_that_cannot_be_written_blames_no_capture(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(datasets.LakeFiles, "_flush", full)
    result = batch(tmp_path / "lake", tmp_path / "src")
    assert (result.failed, result.captures, result.damaged) == (1, 0, 0)
    assert "the lake cannot be written: no space left on device" in result.troubles[0]
    monkeypatch.undo()
    assert batch(tmp_path / "lake", tmp_path / "src").captures == 1
    assert issubclass(LakeWriteError, FleetError)


def test_what_fits_no_line_is_told_and_the_rest_is_taken(tmp_path, capsys):
    for name in ("north/plant", "south/plant", "south/other"):
        (tmp_path / "src" / name).mkdir(parents=True)
        captures.write(tmp_path / "src" / name / "bus.mcap", bus("clean", len(name), 20))
    command = ["batch", str(tmp_path / "src"), "-o", str(tmp_path / "lake"), "--workers", "1"]
    assert main(command) == 1
    told = capsys.readouterr()
    assert "would both be site plant, line bus.mcap: use --site-from" in told.err and "1 capture of" in told.out
    watching = ["watch", str(tmp_path / "new"), "--from", str(tmp_path / "src"), "--once", "--workers", "1"]
    assert main([*watching, "--site-from", r"/(?P<site>north|other)/"]) == 1
    told = capsys.readouterr()
    assert "south/plant/bus.mcap: --site-from" in told.err and "2 captures" in told.out
    assert main([*watching, "--site-from", r"/(?P<site>west)/"]) == 2


def test_options_that_no_line_can_have_are_refused_at_once(whole, tmp_path, capsys):
    for wrong in (["--baud", "0"], ["--functions", str(tmp_path / "none.py")]):
        assert main(["batch", str(whole), "-o", str(tmp_path / "lake"), *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "lake" / "manifest").exists()


@pytest.mark.parametrize("what", ["rubbish", "a pickle", "nothing"])
def test_a_line_whose_state_is_of_no_use_is_read_anew_while_its_captures_are_there(tmp_path, what, capsys):
    _, paths = ring(tmp_path)
    command = ["batch", str(paths[0].parent), "-o", str(tmp_path / "lake"), "--resume", "--workers", "1"]
    paths[2].rename(tmp_path / "later.mcap")
    assert main(command) == 0
    (tmp_path / "later.mcap").rename(paths[2])
    (state,) = (tmp_path / "lake" / "state").iterdir()
    if what == "nothing":
        state.unlink()
    else:
        state.write_bytes(b"rubbish" if what == "rubbish" else b"\x80\x05K*.")
    capsys.readouterr()
    assert main(command) == 1
    told = capsys.readouterr()
    assert "state" in told.err and told.err.count("all captures of the line were read again") == 1
    batch(tmp_path / "whole", *paths)
    assert same(tmp_path / "lake", tmp_path / "whole")
    assert main(command) == 0


@pytest.mark.parametrize("what", ["rules", "version", "state", "no state"])
def test_a_ring_whose_state_is_of_no_use_goes_on_and_loses_nothing(tmp_path, monkeypatch, what):
    """The rows that waited at the seam are all that is known there: they stay."""
    _, paths = ring(tmp_path)
    batch(tmp_path / "lake", *paths[:2])
    before = rows(tmp_path / "lake", "frames")
    (state,) = (tmp_path / "lake" / "state").iterdir()
    if "state" in what:
        paths.pop(0).unlink()  # so that the line cannot be done anew
    if what == "rules":
        monkeypatch.setitem(version.RULES, "findings", version.RULES["findings"] + 1)
    elif what == "version":
        for module in ("batch", "linetask"):
            monkeypatch.setattr(f"analyzer.fleet.{module}.__version__", "0.0.1")
    elif what == "state":
        state.write_bytes(b"rubbish")
    else:
        state.unlink()
    result = batch(tmp_path / "lake", *paths)
    assert (result.captures, result.failed) == (1, 0)
    assert bool(result.troubles) == result.is_flawed == ("state" in what)
    batch(tmp_path / "last", paths[-1])
    after = rows(tmp_path / "lake", "frames")
    assert len(after) == len(before) + len(rows(tmp_path / "last", "frames"))
    requests = sum(row["requests"] for row in rows(tmp_path / "lake", "hours"))
    assert requests == len(rows(tmp_path / "lake", "transactions"))
    assert batch(tmp_path / "lake", *paths).captures == 0
    assert rows(tmp_path / "lake", "frames") == after
    if what == "rules":
        assert batch(tmp_path / "lake", *paths, redo=True).captures == 3
        batch(tmp_path / "fresh", *paths)
        assert same(tmp_path / "lake", tmp_path / "fresh")


def test_watch_tells_of_changed_rules_and_redoes_when_asked(tmp_path, monkeypatch, capsys):
    _, paths = ring(tmp_path)
    command = ["watch", str(tmp_path / "lake"), "--from", str(paths[0].parent), "--once", "--workers", "1"]
    assert main(command) == 0
    monkeypatch.setitem(version.RULES, "causes", version.RULES["causes"] + 1)
    capsys.readouterr()
    assert main(command) == 0
    assert "lines made with other rules or options: 1; --redo" in capsys.readouterr().err
    assert main([*command, "--redo"]) == 0
    assert "3 captures of 1 bus line" in capsys.readouterr().out
    assert main([*command, "--redo"]) == 0
    assert "0 captures of 0 bus lines" in capsys.readouterr().out


@pytest.mark.parametrize("back_s", [0, 100], ids=["an overlap", "clock set back"])
def test_slices_whose_times_do_not_follow_are_told(tmp_path, back_s):
    capture, paths = ring(tmp_path)
    chunks = list(capture.chunks())
    half = len(chunks) // 2
    later = chunks[half - 400 * (not back_s) :]
    moved = [captures.Chunk(chunk.t_ns - back_s * 1_000_000_000, chunk.data) for chunk in later]
    captures.write(paths[1], captures.Capture.of(capture.line, moved))
    paths[2].unlink()
    result = batch(tmp_path / "lake", *paths[:2])
    (text,) = states(tmp_path / "lake")[paths[1].name][1]
    assert "before the previous slice ends" in text and "the line starts afresh here" in text
    assert result.damaged == 1 and text in result.troubles[0]
    assert states(tmp_path / "lake")[paths[0].name] == ("whole", [])
    with telling("ru"):
        assert "часы перевели назад" in retold(text)


def test_a_manifest_names_what_a_line_without_its_state_has(tmp_path):
    _, paths = ring(tmp_path)
    batch(tmp_path / "lake", *paths[:2])
    shutil.rmtree(tmp_path / "lake" / "state")
    batch(tmp_path / "lake", *paths)
    batch(tmp_path / "lake", *paths)  # its waste is taken away by now
    manifest = Manifest(store(str(tmp_path / "lake")))
    assert all((tmp_path / "lake" / name).exists() for name in manifest.named())


@pytest.mark.parametrize(
    ("mark", "said"),
    [
        ("pyvenv.cfg", "-m pip install polars"),
        ("pipx_metadata.json", "pipx inject rtuscope polars"),
        ("uv-receipt.toml", "uv tool install --with polars"),
    ],
)
def test_a_library_without_an_extra_is_added_where_this_program_is(monkeypatch, tmp_path, mark, said):
    (tmp_path / mark).touch()  # in a folder of any name: PIPX_HOME and UV_TOOL_DIR move it
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    assert said in needs("a polars frame", "polars")


def test_uv_is_told_again_what_it_would_take_away(monkeypatch, tmp_path):
    (tmp_path / "uv-receipt.toml").write_text(
        '[tool]\nrequirements = [{ name = "rtuscope", extras = ["mqtt", "columns"], directory = "/x" }, '
        '{ name = "paho-mqtt" }, { name = "pymodbus", specifier = ">=3.8" }, { name = "own", directory = "/o p" }]\n'
    )
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    line = needs("a polars frame", "polars").partition(": ")[2]
    words = shlex.split(line.replace('"', "'"))
    assert words[:3] == ["uv", "tool", "install"]
    assert words[3:-1] == ["--with", "paho-mqtt", "--with", "pymodbus>=3.8", "--with", "/o p", "--with", "polars"]
    assert words[-1].endswith("[columns,mqtt]")


def test_watch_takes_from_the_sources_that_are_there(whole, tmp_path):
    told = list[str]()
    (tmp_path / "empty").mkdir()
    sources = [str(tmp_path / "gone"), str(whole.parent), str(tmp_path / "empty")]
    assert [file.name for file in _there(sources, [], told.append)] == ["bus.mcap"]
    assert len(told) == 2 and "gone" in told[0] and "empty" in told[1]
    with pytest.raises(FleetError, match="gone"):
        _there(sources, [], None)


def test_a_full_disk_ends_the_batch(whole, tmp_path, monkeypatch):
    for number in range(9):
        shutil.copyfile(whole, whole.parent / f"more{number}.mcap")
    tried = []

    def full(tasks):
        for task in tasks:
            tried.append(task)
            yield task, LakeWriteError("the lake cannot be written: no space left on device")

    with pytest.raises(FleetError, match="no space left on device; partial output is kept: continue with --resume"):
        batch(tmp_path / "lake", tmp_path / "src", runner=full)
    assert len(tried) == 5

    def refuse(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    lake = store(str(tmp_path / "lake"))
    lake.fresh("entered")
    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(FleetError, match=r"00000001\.json: .*[Nn]o space left"):
        lake.write("manifest/00000001.json", b"{}")
