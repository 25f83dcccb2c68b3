"""Tutorials and how-tos: every command runs as it stands there, and shows what stands below it; the site builds.

A block of `text` below commands is what the last of them prints, `...` for lines left out; one of `console` is like it,
digits apart.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import re
import shlex
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from running import ROOT, spawned

DOCS = ROOT / "docs"
PAGES = sorted(page for folder in ("tutorials", "howto") for page in (DOCS / folder).glob("*.md"))
PORT = "/dev/ttyUSB0"
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_REQUEST, _ANSWER = bytes.fromhex("1103006b00037687"), bytes.fromhex("110306ae415652434049ad")


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


@contextlib.contextmanager
def busy_port():
    """A pseudo-terminal at which a client asks a unit again and again."""
    from livebus import pty

    master, name = pty()
    over = threading.Event()

    def talk():
        while not over.is_set():
            for data in (_REQUEST, _ANSWER):
                os.write(master, data)
                time.sleep(0.02)
            time.sleep(0.1)

    os.set_blocking(master, False)
    thread = threading.Thread(target=talk)
    with contextlib.suppress(BlockingIOError):
        thread.start()
    try:
        yield name
    finally:
        over.set()
        thread.join()


def digits_apart(text: str) -> set[str]:
    return {re.sub(r"\d+", "0", line).strip() for line in text.splitlines()}


@pytest.mark.parametrize("page", PAGES, ids=[page.relative_to(DOCS).as_posix() for page in PAGES])
def test_every_command_of_a_page_does_what_stands_there(page, tmp_path):
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
                done = spawned(*arguments, cwd=tmp_path)
                if arguments[0] == "open" and "needs a terminal" in done.err:
                    continue  # tests/test_cli_open.py gives it one
                assert done.status == 0, (line, done)
            if step.kind == "console":
                assert digits_apart(step.text) <= digits_apart(done.out + done.err), line
            at = 0
            for part in re.split(r"^\.\.\.\n", step.text, flags=re.MULTILINE) if step.kind == "text" else ():
                assert part in done.out[at:], (line, part, done.out)
                at = done.out.index(part, at) + len(part)


def test_each_page_stands_in_russian_with_the_same_commands():
    assert len(PAGES) == 8
    for page in PAGES:
        russian = (DOCS / "ru" / page.relative_to(DOCS)).read_text(encoding="utf-8")
        assert _BLOCK.findall(russian) == _BLOCK.findall(page.read_text(encoding="utf-8"))


@pytest.mark.skipif(
    importlib.util.find_spec("mkdocs") is None or importlib.util.find_spec("material") is None,
    reason="mkdocs-material builds the site, and is not here: pip install '.[docs]'",
)
def test_the_site_builds(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    for page in PAGES:
        assert (tmp_path / "site" / page.relative_to(DOCS).with_suffix("") / "index.html").exists()
