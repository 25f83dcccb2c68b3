"""`rtuscope open` and `demo` as users start them: on a terminal, on a pipe, in a browser."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from running import environment, ran, refused
from terminals import Terminal, posix

from captures import samples

_ROOT = Path(__file__).parents[1]


@posix
def test_a_capture_opens_on_a_terminal_and_q_leaves(tmp_path: Path) -> None:
    shutil.copy(samples.path("troubled.jsonl"), tmp_path / "bus.jsonl")
    terminal = Terminal("open", str(tmp_path / "bus.jsonl"))
    terminal.until(b"Transactions")
    os.write(terminal.fd, b"q")
    assert terminal.status() == 0
    assert [file.name for file in tmp_path.iterdir()] == ["bus.jsonl"]


@posix
def test_a_language_alone_opens_the_start_screen() -> None:
    terminal = Terminal("--lang", "ru")
    terminal.until("Вставьте".encode())
    os.write(terminal.fd, b"\x11")  # Ctrl+Q
    assert terminal.status() == 0


@posix
def test_keys_come_from_the_terminal_where_standard_input_gave_the_capture() -> None:
    master, slave = os.openpty()
    steps = (
        "import fcntl, termios; fcntl.ioctl(1, termios.TIOCSCTTY, 0)",
        "from analyzer.cli.keyboard import keys_from_terminal; from analyzer.cli.terminal import full_screen",
        "before = full_screen(); keys_from_terminal(); print(before, full_screen())",
    )
    command = [sys.executable, "-c", "\n".join(steps)]
    where = environment(TERM="xterm")
    subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=slave, stderr=slave, start_new_session=True, check=True, env=where
    )
    assert os.read(master, 100).split() == [b"False", b"True"]


@posix
def test_without_a_capture_it_is_a_prompt_and_ctrl_c_hints_how_to_leave() -> None:
    terminal = Terminal("open")
    terminal.until(b"paste or type bytes")
    os.write(terminal.fd, b"\x1b[200~11 03 00 6B\n00 03 76 87\x1b[201~")
    terminal.until(b"unit 17")
    os.write(terminal.fd, b"\x1b")
    time.sleep(0.3)
    os.write(terminal.fd, b"\x11")  # Ctrl+Q
    assert terminal.status() == 0


@posix
def test_the_demo_opens_the_sample_on_a_terminal() -> None:
    terminal = Terminal("demo")
    terminal.until(b"troubled.jsonl")
    os.write(terminal.fd, b"q")
    assert terminal.status() == 0
    assert not list(samples.path("troubled.jsonl").parent.glob("*.rtuscope.json"))


def test_the_demo_reports_on_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    done = ran(capsys, "demo")
    assert done.status == 0 and done.out.startswith("capture")


def test_limits_are_checked_and_go_along_to_the_browser(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = samples.path("healthy.jsonl")
    assert "longer than --t35-ms" in refused(capsys, "open", path, "--t15-ms", "3", "--t35-ms", "2")
    given: list[Sequence[str]] = []
    monkeypatch.setattr("analyzer.cli.open.serve", lambda command, *_: given.append(command))
    ran(capsys, "open", path, "--web", "--t35-ms", "2.5", "--idle-ms", "20")
    assert list(given[0][-6:]) == ["--t35-ms", "2.5", "--idle-ms", "20", "--", str(path)]


def test_a_pipe_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    assert "needs a terminal" in refused(capsys, "open", samples.path("troubled.jsonl"))


def test_what_cannot_be_opened_is_said_before_the_screen_is_taken(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert "no such file" in refused(capsys, "open", tmp_path / "missing.jsonl")


def test_without_its_extra_the_browser_is_refused_in_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "textual_serve.server", None)
    assert "[web]" in refused(capsys, "open", samples.path("troubled.jsonl"), "--web")


@posix
def test_a_terminal_that_places_no_text_gets_the_report() -> None:
    terminal = Terminal("demo", term="dumb")
    terminal.until(b"what costs this bus")
    assert b"\x1b" not in terminal.seen
    assert terminal.status() == 0


@posix
def test_a_terminal_that_is_gone_is_not_read_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where its signal is ignored (`nohup`) the interface goes on; it spun on the end of its input."""
    from analyzer.tui.viewer import heed_lost_terminal

    master, slave = os.openpty()
    done: list[str] = []
    looks: list[Callable[[], None]] = []

    def set_interval(_: float, look: Callable[[], None]) -> SimpleNamespace:
        looks.append(look)
        return timer

    driver = SimpleNamespace(exit_event=SimpleNamespace(set=lambda: done.append("keys")))
    timer = SimpleNamespace(stop=lambda: done.append("looks"))
    app = SimpleNamespace(_driver=driver, set_interval=set_interval)
    with os.fdopen(slave) as terminal:
        monkeypatch.setattr(sys, "__stdin__", terminal)
        heed_lost_terminal(cast(Any, app))
        looks[0]()
        assert not done
        os.close(master)
        looks[0]()
        assert done == ["keys", "looks"]
