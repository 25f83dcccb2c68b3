"""The line that tells how far long work has come."""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from analyzer.cli import terminal
from analyzer.cli.terminal import Progress, ProgressLine
from analyzer.terminal_text import TerminalText
from captures.files import opened, share_read

WORDS = "1,000 frames, 200/s, 3.0 MB of the line"


def plain(line: str) -> str:
    return re.sub(r"\x1b\[[\d;]*m", "", line)


def test_it_tells_share_words_and_the_time_left() -> None:
    line = ProgressLine("report bus.mcap", colour=True)
    line.at(0.25, WORDS, 5.0, 120)
    text = line.at(0.5, WORDS, 10.0, 120)
    assert isinstance(text, TerminalText)
    assert re.fullmatch(rf"report bus\.mcap [━╺╸ -]+ +50% {WORDS} 00:10 left", plain(text).rstrip())


def test_without_a_share_there_is_no_time_left() -> None:
    text = plain(ProgressLine("report -", colour=True).at(None, WORDS, 5.0, 120))
    assert WORDS in text
    assert "left" not in text
    assert "%" not in text


@pytest.mark.parametrize("columns", [20, 40, 79, 120])
def test_it_is_one_line_however_narrow_and_whatever_the_file_is_called(columns: int) -> None:
    line = ProgressLine("report [red]bus\n\x1b[2J" + 50 * "x", colour=True)
    for number in range(1, 4):
        text = plain(line.at(number / 4, WORDS, float(number), columns))
        assert len(text) <= columns
        assert "\n" not in text
        assert "\x1b" not in text


def test_where_only_ascii_can_be_shown_the_bar_is_of_ascii() -> None:
    line = ProgressLine("report bus.mcap", colour=False, encoding="ascii")
    assert line.at(0.5, WORDS, 5.0, 120).isascii()
    assert "\x1b" not in line.at(0.6, WORDS, 6.0, 120)


class Screen(io.StringIO):
    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


def test_short_work_shows_nothing_and_long_work_is_taken_away_at_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(terminal, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(sys, "stderr", screen := Screen())
    teller = Progress("report bus.mcap")
    teller(10, 100, 0.1)
    teller.clear()
    assert not screen.getvalue()
    now[0] += 1.0
    teller(1000, 3_000_000, 0.25)
    assert "1,000 frames, 1,000/s, 3.0 MB of the line" in plain(screen.getvalue())
    teller.clear()
    assert screen.getvalue().endswith("\r\x1b[K")


def test_a_pipe_is_told_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(terminal, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(sys, "stderr", pipe := io.StringIO())
    teller = Progress("report bus.mcap")
    now[0] += 60.0
    teller(1000, 3_000_000, 0.25)
    assert not pipe.getvalue()


def test_the_share_is_that_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "bus.bin"
    path.write_bytes(bytes(1000))
    assert share_read() is None
    with opened(path) as file:
        file.read(250)
        assert share_read() == 0.25
    assert share_read() is None
