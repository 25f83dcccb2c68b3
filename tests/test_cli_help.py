"""`rtuscope help`: pages of the documentation from the installed package, and the package `rtuscope` itself."""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from running import ran, refused

import analyzer
from analyzer.checks.model import forms
from analyzer.cli.app import command_line
from analyzer.cli.commands import COMMANDS, meanings, pages
from analyzer.cli.help import rendered
from analyzer.languages import catalogue, retold, telling, use_language
from analyzer.reference.causes import markdown
from analyzer.settings import SETTINGS, TABLES
from captures.formats import foreign_formats, formats

DOCS = Path(__file__).resolve().parents[1] / "docs"
_STAY = {"HEX", "HZ", "MS", "URL"}


@pytest.mark.parametrize("topic", ["filters", "findings", "causes", "checks", "formats", "maps", "docs/live.md"])
def test_a_page_is_printed(topic: str, capsys: pytest.CaptureFixture[str]) -> None:
    done = ran(capsys, "help", topic)
    assert done.status == 0
    assert done.out.startswith("# ")


def test_without_a_topic_all_pages_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    listed = {line.split()[0] for line in ran(capsys, "help").out.split("\n\n")[0].splitlines()}
    guides = {page.stem for page in (*DOCS.glob("*.md"), *DOCS.glob("howto/*.md"))} - {"index"}  # that of the site
    assert listed == guides | {f"tutorial-{page.stem}" for page in DOCS.glob("tutorials/*.md")}


@pytest.mark.parametrize(
    ("topic", "title"),
    [("tutorial", "# Tutorial: read pasted bytes"), ("dead-unit", "# A unit does not answer"), ("paste", "# Tutorial:"),
     ("howto/crc-errors.md", "# CRC errors"), ("tutorials/live", "# Tutorial: listen"), ("line", "# Line rules")],
)  # fmt: skip
def test_tutorials_and_howtos_are_pages_too(topic: str, title: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(capsys, "help", topic).out.startswith(title)


def test_a_page_is_in_the_language_in_use(capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(capsys, "--lang", "ru", "help", "dead-unit").out.startswith("# Устройство не отвечает")
    assert ran(capsys, "--lang", "ru", "help", "filters").out.startswith("# ")  # stands in English alone
    assert "Ошибки CRC" in ran(capsys, "--lang", "ru", "help").out


@pytest.mark.parametrize("columns", [40, 80, 200])
def test_a_page_on_a_terminal_is_read_as_text(columns: int) -> None:
    for name, page in pages().items():
        if name in ("findings", "causes"):  # long, and like the others
            continue
        shown = rendered(page.read_text(encoding="utf-8"), columns, colour=False)
        assert "](" not in shown and "![" not in shown and "\x1b" not in shown, name
        assert max(map(len, shown.splitlines())) <= min(columns, 120), name
    assert "\x1b[" in rendered("# A *page*", columns, colour=True)


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
    assert names in shown.replace("- ", "-")


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


def placeholders(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Words that stand for values in the help of a parser and of those inside it: CAPTURE, PORT."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in dict.fromkeys(action.choices.values()):
                yield from placeholders(inner)
        if action.nargs != 0 and (action.choices is None or action.metavar is not None):
            yield from re.findall("[A-Z][A-Z_]+", str(action.metavar or action.dest.upper()))


def help_words(parser: argparse.ArgumentParser) -> Iterator[str]:
    """All that a parser and those of its actions say of themselves, in English."""
    yield from (words for group in parser._action_groups for words in (group.title, group.description) if words)
    for action in parser._actions:
        if action.help and action.help != argparse.SUPPRESS:
            yield action.help
        if isinstance(action, argparse._SubParsersAction):
            yield from (choice.help for choice in action._choices_actions if choice.help)
            for inner in dict.fromkeys(action.choices.values()):
                yield from help_words(inner)


def all_help_words() -> list[str]:
    statuses = [words for name in COMMANDS for _, words in meanings(name)]
    around = ["usage: ", "exit status:", "example:", command_line(()).description or ""]
    around.append((command_line(()).epilog or "").splitlines()[-1])
    listed = [*(form.help for form in forms()), *(setting.words for setting in SETTINGS), *TABLES.values()]
    listed += ["read x.toml", "no settings found: neither x.toml nor rtuscope.toml here or above", "from x.toml:1"]
    return list(dict.fromkeys([*help_words(command_line(COMMANDS)), *statuses, *around, *listed]))


def test_help_is_told_in_russian_word_for_word() -> None:
    english = all_help_words()
    with telling("ru"):
        for words in english:
            told = retold(words, "help")
            assert told != words and re.search("[а-я]", told), words
            for code in re.findall(r"%\(\w+\)s|(?<!\w)--?\w[\w-]*|`[^`]+`|https?://\S+|\b[A-Z]{2,}\b", words):
                named = re.sub("[A-Z]{2,}", lambda word: retold(word[0], "help"), code)
                assert named in told or code in told or code in ("HTML", "MAP", "CHANGING", "OpenMetrics"), (code, told)
            assert not re.search(r"\{\d+\}", told), told


def test_no_words_of_help_are_left_over() -> None:
    english, left = [*all_help_words(), *placeholders(command_line(COMMANDS))], []
    for template in catalogue("ru")["help"]:
        pattern = "(.+?)".join(map(re.escape, re.split(r"\{\d+\}", template)))
        if not any(re.search(pattern, words, re.DOTALL) for words in english):
            left.append(template)
    assert not left


@pytest.mark.parametrize("words", ["", "parse", "open", "sniff", "map", "map check", "ask", "simulate"])
def test_a_page_of_help_in_russian_has_no_english_around_it(
    words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RTUSCOPE_LANG", "ru")
    page = ran(capsys, *words.split(), "--help").out
    for english in ("usage:", "options:", "positional arguments", "show this help", "exit status", "example:"):
        assert english not in page
    assert page.startswith("вызов: rtuscope") and "--help" in page


def test_the_language_of_the_settings_is_that_of_help_and_of_errors(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("RTUSCOPE_LANG", raising=False)
    settings = tmp_path / "config.toml"
    settings.write_text('lang = "ru"\n', encoding="utf-8")
    monkeypatch.setenv("RTUSCOPE_CONFIG", str(settings))
    assert ran(capsys, "parse", "--help").out.startswith("вызов:")
    assert "лишнее" in refused(capsys, "parse", "--no-such")
    assert ran(capsys, "parse", "--help", "--lang", "en").out.startswith("usage:")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_takes_a_language_before_it_and_behind(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (("--lang", "ru", command), ("--lang=ru", command), (command, "--lang", "ru")):
        assert ran(capsys, *words, "--help").out.startswith(f"вызов: rtuscope {command}")
        use_language("en")


def test_a_language_is_taken_without_a_command_and_before_an_action(capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(capsys, "--lang", "ru").out.startswith("вызов: rtuscope")
    assert ran(capsys, "--lang", "ru", "help", "filters").out.startswith("# ")
    assert ran(capsys, "map", "--lang", "ru", "list").status == ran(capsys, "map", "list", "--lang", "ru").status == 0
    use_language("en")
    assert "invalid choice: 'fr'" in refused(capsys, "--lang", "fr", "report")
    assert "--lang" in refused(capsys, "--lang")


def test_help_names_values_in_russian(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    words = set(placeholders(command_line(COMMANDS))) - _STAY
    with telling("ru"):
        left = {word for word in words if retold(word, "help") == word}
    assert len(words) > 20 and not left
    monkeypatch.setenv("RTUSCOPE_LANG", "ru")
    told = ran(capsys, "record", "--help").out
    assert "[УЗЕЛ:]ПОРТ" in told and "{7,8}" in told and "FILE" not in told
