"""What the pages say is what the tool does, and the site builds.

Tutorials and how-tos: every command runs as it stands there, and shows what stands below it: the Russian pages on a
Russian system, the others in the locale C. Each how-to makes the trouble that it is about. A block of `text` below
commands is what the last of them prints, `...` for lines left out; one of `console` is like it, digits apart. What the
README and the page for Python show is what the tool does. The Russian page keeps up with it: its codes and their
severities, its commands and their options. `docs/findings.md` is what the rules declare, and shows each at work.
"""

from __future__ import annotations

import contextlib
import importlib.util
import itertools
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from livebus import busy_port
from running import ROOT, Ran, ran, spawned

import captures
from analyzer.cli import main
from analyzer.cli.app import Parser
from analyzer.cli.commands import COMMANDS as CLI
from analyzer.cli.commands import NO_FRAME, add_arguments
from analyzer.reference.causes import markdown as causes_page
from analyzer.reference.findings import markdown
from analyzer.tables.findings import rules
from captures import samples

DOCS = ROOT / "docs"
ENGLISH = sorted(page for folder in ("tutorials", "howto") for page in (DOCS / folder).glob("*.md"))
PAGES = [*ENGLISH, *(DOCS / "ru" / page.relative_to(DOCS) for page in ENGLISH)]
PORT = "/dev/ttyUSB0"
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Step:
    """Commands, and what the last one prints: its kind, and the text."""

    commands: list[str]
    kind: str
    text: str


def steps(page: Path) -> list[Step]:
    blocks = _BLOCK.findall(page.read_text(encoding="utf-8"))
    found = []
    for at, (kind, text) in enumerate(blocks):
        if kind == "sh":
            shown = blocks[at + 1] if at + 1 < len(blocks) and blocks[at + 1][0] in ("text", "console") else ("", "")
            found.append(Step([line.partition("  #")[0] for line in text.splitlines() if line], *shown))
    return found


def digits_apart(text: str) -> set[str]:
    return {re.sub(r"\d+", "0", line).strip() for line in text.splitlines()}


@pytest.mark.parametrize("page", PAGES, ids=[page.relative_to(DOCS).as_posix() for page in PAGES])
def test_every_command_of_a_page_does_what_stands_there(page, tmp_path, capsys, monkeypatch):
    def done_here(arguments: list[str]) -> Ran:
        """One that needs a port or a terminal has a process of its own."""
        if port in arguments or arguments[0] == "open":
            return spawned(*arguments, cwd=tmp_path)
        return ran(capsys, *arguments)

    monkeypatch.chdir(tmp_path)
    for name in ("LANG", "LC_ALL"):
        monkeypatch.setenv(name, locale_of(page))
    run = steps(page)
    assert run
    with contextlib.ExitStack() as stack:
        port = ""
        if PORT in page.read_text(encoding="utf-8"):
            if os.name != "posix":
                pytest.skip("pseudo-terminals are POSIX")
            port = stack.enter_context(busy_port())
        for step in run:
            for line in step.commands:
                program, *arguments = shlex.split(line.replace(PORT, port) if port else line)
                assert program == "rtuscope", line
                done = done_here(arguments)
                if arguments[0] == "open" and re.search("needs a terminal|нужен терминал", done.err):
                    continue  # tests/test_cli_open.py gives it one
                nothing = re.search("^(No Modbus frame was found|Кадров Modbus не найдено)", step.text, re.MULTILINE)
                assert done.status == (NO_FRAME if nothing and arguments[0] == "report" else 0), (line, done)
            if step.kind == "console":
                assert digits_apart(step.text) <= digits_apart(done.out + done.err), line
            at = 0
            for part in re.split(r"^\.\.\.\n", step.text, flags=re.MULTILINE) if step.kind == "text" else ():
                assert part in done.out[at:], (line, part, done.out)
                at = done.out.index(part, at) + len(part)


def test_the_view_of_a_running_bus_is_what_a_replay_of_the_sample_shows():
    told = spawned("replay", samples.path("troubled.jsonl"), "--speed", "max", "--tz", "UTC").out
    blocks = [text for _, text in _BLOCK.findall((DOCS / "live.md").read_text(encoding="utf-8"))]
    (shown,) = (text for text in blocks if text.startswith("08:29"))
    at = 0
    for line in shown.splitlines():
        if line != "...":
            assert line.rstrip("…") in told[at:], line
            at = told.index(line.rstrip("…"), at)


def locale_of(page):
    return "ru_RU.UTF-8" if "ru" in page.relative_to(DOCS).parts else "C.UTF-8"


def commands_of(page):
    return [text for kind, text in _BLOCK.findall(page.read_text(encoding="utf-8")) if kind == "sh"]


def test_each_page_stands_in_russian_with_the_same_commands():
    assert len(ENGLISH) == 8
    for page in ENGLISH:
        russian = DOCS / "ru" / page.relative_to(DOCS)
        assert commands_of(russian) == commands_of(page)


HOWTOS = [page for page in ENGLISH if page.parent.name == "howto"]


@pytest.mark.parametrize("page", HOWTOS, ids=[page.stem for page in HOWTOS])
def test_each_howto_makes_its_trouble_and_the_report_names_it_first(page, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pattern = re.compile(r"^rtuscope (simulate (\S+) .*--cause (\S+).*)\n(rtuscope report \2)$", re.MULTILINE)
    made = pattern.search("".join(commands_of(page)))
    assert made, "no simulate --cause with a report"
    assert f"1. {made[3]}, " in page.read_text(encoding="utf-8")
    assert ran(capsys, *shlex.split(made[1])).status == 0
    told = ran(capsys, "report", made[2], "--json")
    assert json.loads(told.out)["causes"][0]["cause"] == made[3]


@pytest.mark.skipif(
    importlib.util.find_spec("mkdocs") is None or importlib.util.find_spec("material") is None,
    reason="mkdocs-material builds the site, and is not here: pip install '.[docs]'",
)
def test_the_site_builds(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    for page in PAGES:
        assert (tmp_path / "site" / page.relative_to(DOCS).with_suffix("") / "index.html").exists()


RUSSIAN = (DOCS / "ru.md").read_text(encoding="utf-8")
ENDS = {"|", ">", ">>", "<", "&&", ";"}  # of a command, as a shell reads it
COMMANDS = sorted(
    {
        line
        for page in (ROOT / "README.md", *DOCS.rglob("*.md"))
        for text in commands_of(page)
        for line in re.findall(r"(?:^|[|;&] )rtuscope (.+)$", text.replace("\\\n", " "), re.MULTILINE)
        if line.split()[0] in CLI  # else tests/test_cli_door.py
    }
)


def test_every_finding_stands_there_with_its_severity() -> None:
    told = {code: letter for letter, code in re.findall(r"^\| ([EWN]) \| `([a-z-]+)` \|", RUSSIAN, re.MULTILINE)}
    assert told == {rule.code: rule.severity.name[0] for rule in rules()}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_one(command: str) -> None:
    name, *given = itertools.takewhile(lambda word: word not in ENDS, shlex.split(command, comments=True))
    parser = Parser(prog=name)
    add_arguments(parser, name)
    assert parser.parse_args(given)


README = (ROOT / "README.md").read_text(encoding="utf-8")
PYTHON = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")


def test_the_parsed_frame(capsys: pytest.CaptureFixture[str]) -> None:
    shown = re.search(r"```text\n\$ rtuscope (parse [0-9A-F ]+)\n(.*?)\n```", README, re.DOTALL)
    assert shown is not None
    assert main(shown[1].split()) == 0
    assert capsys.readouterr().out.rstrip() == shown[2]


def test_the_report_of_the_bundled_sample(capsys: pytest.CaptureFixture[str]) -> None:
    shown = re.search(r"```text\n(capture .*?)\n\.\.\.\n```", README, re.DOTALL)
    assert shown is not None
    assert main(["demo"]) == 0
    assert capsys.readouterr().out.startswith(shown[1])


def test_the_vendor_function(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    declared = re.search(r"```python\n(from construct import .*?)\n```", PYTHON, re.DOTALL)
    assert declared is not None
    file = tmp_path / "trend.py"
    file.write_text(declared[1])
    assert main(["parse", "--functions", str(file), "--role", "request", "01 41 07 50 22"]) == 0
    assert "trend of 7" in capsys.readouterr().out


@pytest.mark.parametrize(
    "begin", ["import rtuscope\n\nframe", "import rtuscope\n\nbus", "from analyzer import Deframer"]
)
def test_what_is_done_from_python(begin: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = re.search(rf"```python\n({begin}.*?)\n```", PYTHON, re.DOTALL)
    assert code is not None
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "captures" / "samples" / "troubled.jsonl", "bus.jsonl")
    done = subprocess.run([sys.executable, "-c", code[1]], capture_output=True, text=True, check=True)
    expected = ("all-silent", "read 3 holding registers", "Read Holding Registers")
    assert any(words in done.stdout for words in expected)


def test_the_own_format_is_read_as_its_page_says(tmp_path: Path) -> None:
    shown = re.search(r"```json\n(.*?)```", (DOCS / "formats.md").read_text(encoding="utf-8"), re.DOTALL)
    assert shown is not None
    path = tmp_path / "own.jsonl"
    path.write_text(shown[1], encoding="utf-8")
    capture = captures.open(path)
    line = capture.line
    assert (line.baud, line.char_bits, line.parity, line.stop_bits, line.tap) == (19200, 11, "E", 1, "irq")
    assert line.notes == {}
    chunks = [*capture.chunks()]
    assert [chunk.t_ns for chunk in chunks] == [1795239591000000000, 1795239591021340000]
    assert list(chunks[1].errors) == [3]


def test_every_file_that_is_named_exists() -> None:
    names = re.findall(r"\]\(([^)#:]+)\)", README)
    assert names
    for name in names:
        assert (ROOT / name).exists(), name


def test_the_page_is_of_these_rules() -> None:
    page = DOCS / "findings.md"
    assert page.read_text(encoding="utf-8") == markdown(), "write it anew: python -m analyzer.reference.findings"


def test_who_asks_is_a_client_as_in_the_glossary() -> None:
    """Names of causes and titles of clauses are no words of ours."""
    names = re.compile(r"`[a-z-]+`|#[a-z-]+|## [a-z-]+|Master State diagram|MODBUS Master/Slaves")
    for page in (markdown(), causes_page()):
        assert not re.search("master|slave", names.sub("", page), re.IGNORECASE)


def test_every_rule_says_when_why_and_what_to_do() -> None:
    for rule in rules():
        assert rule.when, rule.code
        assert rule.cause, rule.code
        assert rule.remedy, rule.code
        assert rule.when[0].islower() or rule.when.startswith(("UART", "CRC")), rule.code
        assert not rule.when.endswith("."), rule.code
