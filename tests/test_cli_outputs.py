"""Files that commands write: none is written over unasked, whichever command it is."""

from __future__ import annotations

from pathlib import Path

import pytest
from running import ran, refused, spawned
from terminals import Terminal, posix

import captures
from captures import samples

HEALTHY = samples.path("healthy.jsonl")
WRITERS = {
    "out.csv": ("export", HEALTHY, "-o"),
    "out.mcap": ("export", HEALTHY, "-o"),
    "out.html": ("report", HEALTHY, "--html"),
    "out.xml": ("check", HEALTHY, "--junit"),
    "out.jsonl": ("simulate", "--transactions", "20"),
    "out.truth.jsonl": ("simulate", "--transactions", "20", "other.jsonl"),
    "whole.mcap": ("repair", samples.path("mbpoll.mcap"), "-o"),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_that_is_there_needs_a_word(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = [str(word) for word in (*WRITERS[name], name)]
    if name == "out.truth.jsonl":
        command = ["simulate", "--transactions", "20", "out.jsonl"]  # whose truth has that name
    (folder / name).write_text("precious")
    assert refused(capsys, *command).startswith(f"{name}: already exists: give another name, or --overwrite")
    assert [file.name for file in folder.iterdir()] == [name]
    assert (folder / name).read_text() == "precious"
    assert ran(capsys, *command, "--overwrite").status == 0
    assert (folder / name).read_bytes() != b"precious"


@pytest.mark.parametrize("port", ["sniff", "record"])
def test_a_recording_that_is_there_needs_a_word(port: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "bus.mcap").write_text("precious")
    assert "bus.mcap: already exists" in refused(capsys, port, "/dev/nowhere", "-o", "bus.mcap")
    assert (folder / "bus.mcap").read_text() == "precious"


@posix
@pytest.mark.parametrize(
    ("answer", "kept"), [("\n", True), ("n\n", True), ("\x04", True), ("y\n", False), ("да\n", False)]
)
def test_on_a_terminal_it_is_asked(answer: str, kept: bool, folder: Path) -> None:
    (folder / "out.csv").write_text("precious")
    terminal = Terminal("export", str(HEALTHY), "-o", "out.csv", cwd=folder)
    terminal.until(b"out.csv is there already: overwrite it? [y/N]")
    terminal.press(answer)
    assert terminal.status() == (2 if kept else 0)
    assert (b"left unchanged" in terminal.seen) == kept
    assert ((folder / "out.csv").read_text() == "precious") == kept


@posix
def test_ctrl_c_at_the_question_leaves_it_alone(folder: Path) -> None:
    (folder / "out.csv").write_text("precious")
    terminal = Terminal("export", str(HEALTHY), "-o", "out.csv", cwd=folder)
    terminal.until(b"[y/N]")
    terminal.press("\x03")
    assert terminal.status() == 130
    assert (folder / "out.csv").read_text() == "precious"


@posix
def test_what_is_no_file_is_not_asked_about_and_the_capture_itself_is_never_written_over(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ran(capsys, "export", HEALTHY, "--format", "csv", "-o", "/dev/null").status == 0
    (folder / "bus.jsonl").write_bytes(HEALTHY.read_bytes())
    for command in (
        ("export", "bus.jsonl", "-o"),
        ("report", "bus.jsonl", "--html"),
        ("check", "bus.jsonl", "--junit"),
    ):
        assert "is the capture being read" in refused(capsys, *command, "./bus.jsonl", "--overwrite")
    assert spawned("export", "bus.jsonl", "-o", "-", stdin=b"y\n", cwd=folder).status == 0
    assert (folder / "bus.jsonl").read_bytes() == HEALTHY.read_bytes()


TROUBLED = samples.path("troubled.jsonl")


@pytest.mark.parametrize("form", ["csv", "jsonl", "parquet", "pcapng"])
@pytest.mark.parametrize(
    ("wanted", "said"), [("unit == 99", "nothing matches the filter"), ('finding == "noise"', "--noise writes them")]
)
def test_an_export_that_nothing_passes_takes_no_files_place(
    wanted: str, said: str, form: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = folder / f"kept.{form}"
    kept.write_text("precious")
    done = ran(capsys, "export", TROUBLED, "--filter", wanted, "-o", kept.name, "--overwrite")
    assert done.status == 1 and done.err.count("\n") == 1 and f"{kept.name}: not written" in done.err
    assert said in done.err and kept.read_text() == "precious"
    assert [file.name for file in folder.iterdir()] == [kept.name]
    assert ran(capsys, "export", TROUBLED, "--filter", wanted, "-o", f"new.{form}").status == 1
    assert not (folder / f"new.{form}").exists()


def test_noise_that_passes_is_written_where_it_is_asked_for(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wanted = ("export", TROUBLED, "--filter", 'finding == "noise"')
    assert ran(capsys, *wanted, "--noise", "-o", "noise.csv").status == 0
    assert ran(capsys, *wanted, "--table", "findings", "-o", "findings.csv").status == 0
    assert all(len((folder / name).read_text().splitlines()) > 1 for name in ("noise.csv", "findings.csv"))


def test_a_counted_export_of_packets_holds_no_more(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(capsys, "export", TROUBLED, "--count", "5", "-o", "five.pcapng").status == 0
    assert sum(len(block.data) for block in captures.open(folder / "five.pcapng").blocks(1000)) < 100
