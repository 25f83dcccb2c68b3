"""`rtuscope help`: pages of the documentation from the installed package, and the package `rtuscope` itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from running import ran, refused

import analyzer
from analyzer.reference.causes import markdown
from captures.formats import foreign_formats, formats

DOCS = Path(__file__).resolve().parents[1] / "docs"


@pytest.mark.parametrize("topic", ["filters", "findings", "causes", "checks", "formats", "maps", "docs/live.md"])
def test_a_page_is_printed(topic: str, capsys: pytest.CaptureFixture[str]) -> None:
    done = ran(capsys, "help", topic)
    assert done.status == 0
    assert done.out.startswith("# ")


def test_without_a_topic_all_pages_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    listed = {line.split()[0] for line in ran(capsys, "help").out.split("\n\n")[0].splitlines()}
    assert listed == {page.stem for page in DOCS.glob("*.md")} - {"index"}  # the first page of the site


def test_a_command_is_helped_with_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(capsys, "help", "parse").out == ran(capsys, "parse", "--help").out


@pytest.mark.parametrize(
    "words", ["map list", "map show", "map check", "map import", "map infer", "map diff", "config show", "config path"]
)
def test_an_action_s_help_is_whole(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    page = ran(capsys, *words.split(), "--help").out
    assert "exit status:\n  0    done\n" in page
    assert f"\n  rtuscope {words}" in page.partition("\nexample:")[2]


def test_what_there_is_not_is_told_with_what_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    assert "did you mean filters?" in refused(capsys, "help", "filtrs")


def test_the_page_of_causes_is_of_these_suspects() -> None:
    page = (DOCS / "causes.md").read_text(encoding="utf-8")
    assert page == markdown(), "write it anew: python -m analyzer.reference.causes"


def test_the_product_has_the_public_names() -> None:
    import rtuscope

    assert rtuscope.open is analyzer.open
    assert set(analyzer.__all__) <= set(dir(rtuscope))
    done = subprocess.run([sys.executable, "-m", "rtuscope", "--version"], capture_output=True, text=True, check=True)
    assert analyzer.__version__ in done.stdout


@pytest.mark.parametrize(
    ("arguments", "near"),
    [
        (("report", "bus.jsonl", "--format", "txet"), "text"),
        (("convert", "bus.jsonl", "-o", "-", "--to-format", "serial-chunk"), "serial-chunks"),
        (("export", "bus.jsonl", "--format", "cvs"), "csv"),
        (("export", "bus.jsonl", "-o", "frames.jsnl"), "jsonl"),
        (("export", "bus.jsonl", "-Y", "unt == 3"), "unit"),
        (("check", "bus.jsonl", "--rule", "evry poll answered"), "every"),
        (("report", "bus.jsonl", "--map", "eastron-sdm63"), "eastron-sdm630"),
        (("report", "bus.jsonl", "--turnaroud-ms", "3"), "--turnaround-ms"),
        (("exprt", "bus.jsonl"), "export"),
        (("report", "bus.jsonl", "--tz", "Europe/Moskow"), "Europe/Moscow"),
        (("parse", "--tz", "Eurpoe/Berlin", "11 03 00 6B 00 03 76 87"), "Europe/Berlin"),
        (("convert", "bus.jsonl", "-o", "bus.mcpa"), ".mcap"),
        (("map", "import", "points.csv", "-o", "meter.csv", "--format", "sunspecs"), "sunspec"),
    ],
)
def test_a_mistyped_name_is_told_with_what_was_meant(
    arguments: tuple[str, ...],
    near: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert ran(capsys, "simulate", "bus.jsonl", "--transactions", "5").status == 0
    assert f"did you mean {near}?" in refused(capsys, *arguments)


def test_the_help_names_every_format_that_is_read(capsys: pytest.CaptureFixture[str]) -> None:
    shown = " ".join(ran(capsys, "report", "--help").out.split())
    names = ", ".join(sorted([*formats(), *foreign_formats()]))
    assert names in shown.replace("saleae- ", "saleae-").replace("serial- ", "serial-")


def test_short_options_of_tshark_are_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert ran(capsys, "simulate", "bus.jsonl", "-b", "9600", "--transactions", "5").status == 0
    assert ran(capsys, "convert", "-r", "bus.jsonl", "-w", "bus.mcap").status == 0
    assert ran(capsys, "convert", "-r", "bus.jsonl", "-r", "bus.mcap", "-w", "both.jsonl").status == 0
    assert ran(capsys, "export", "-r", "bus.mcap", "-Y", "function < 200", "-w", "frames.csv").status == 0
    assert ran(capsys, "open", "-r", "bus.mcap", "--plain", "-Y", "function < 200").status == 0
    assert ran(capsys, "repair", "bus.mcap", "-w", "whole.mcap").status == 0
