"""A terminal that remembers what it was told to show, and counts what that took."""

from __future__ import annotations

import codecs
import os
import re
import select
import signal
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.cells import get_character_cell_size
from running import PATIENCE_S, ROOT

_TOKEN = re.compile(
    r"\x1b\[([?>=<]?)([\d;:]*)([ -/]*)([@-~])"  # CSI
    r"|\x1b[\]P][^\x07\x1b]*(?:\x07|\x1b\\)|\x1b.|([^\x1b]+)",
    re.DOTALL,
)
_BEGUN = re.compile(r"\x1b(?:\[[?>=<]?[\d;:]*[ -/]*|[\]P][^\x07\x1b]*\x1b?)?$")


class Picture:
    """Cells, as far as the interface's own codes move the cursor; looks as codes of SGR."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self.cells = [[" "] * columns for _ in range(rows)]
        self.looks: list[list[tuple[str, ...]]] = [[()] * columns for _ in range(rows)]
        self.x = self.y = 0
        self.top, self.bottom = 0, rows  # the margins
        self._front, self._back, self._marks = "39", "49", set[str]()
        self._rest = ""

    def feed(self, text: str) -> None:
        """Take in some output."""
        text = self._rest + text
        begun = _BEGUN.search(text)
        self._rest = begun[0] if begun else ""
        for private, numbers, _, final, plain in _TOKEN.findall(text[: len(text) - len(self._rest)]):
            if plain:
                self._write(plain)
            elif final == "H":
                y, _, x = numbers.partition(";")
                self.y, self.x = int(y or 1) - 1, int(x or 1) - 1
            elif final == "r" and not private:
                top, _, bottom = numbers.partition(";")
                self.top, self.bottom = int(top or 1) - 1, min(int(bottom or self.rows), self.rows)
                self.x = self.y = 0
            elif final in ("L", "M") and self.top <= self.y < self.bottom:
                self._move_lines(int(numbers or 1), down=final == "L")
            elif final == "C":
                self.x += int(numbers or 1)
            elif final == "m" and not private:
                self._turn(numbers.split(";") if numbers else ["0"])

    def _move_lines(self, count: int, *, down: bool) -> None:
        """Insert lines at the cursor, or delete them there, up to the lower margin."""
        for _ in range(min(count, self.bottom - self.y)):
            out, into = (self.bottom - 1, self.y) if down else (self.y, self.bottom - 1)
            del self.cells[out], self.looks[out]
            self.cells.insert(into, [" "] * self.columns)
            self.looks.insert(into, [(self._front, self._back, *sorted(self._marks))] * self.columns)

    def _turn(self, codes: list[str]) -> None:
        i = 0
        while i < len(codes):
            code = codes[i]
            if code in ("38", "48"):
                size = 3 if codes[i + 1] == "5" else 5
                whole, i = ";".join(codes[i : i + size]), i + size - 1
                self._front, self._back = (whole, self._back) if code == "38" else (self._front, whole)
            elif code in ("0", ""):
                self._front, self._back, self._marks = "39", "49", set()
            elif code in ("22", "23", "24", "27", "29"):
                self._marks -= {"1", "2"} if code == "22" else {code[1]}
            elif len(code) == 1:
                self._marks.add(code)
            elif code[0] in "39" and code[:2] != "10":
                self._front = code
            else:
                self._back = code
            i += 1

    def _write(self, text: str) -> None:
        for c in text:
            if c == "\n":
                self.y += 1
            elif c == "\r":
                self.x = 0
            else:
                size = get_character_cell_size(c)
                for i in range(size):
                    if self.x < self.columns and self.y < self.rows:
                        self.cells[self.y][self.x] = "" if i else c
                        self.looks[self.y][self.x] = (self._front, self._back, *sorted(self._marks))
                    self.x += 1

    def lines(self) -> list[str]:
        """What stands there."""
        return ["".join(line).rstrip() for line in self.cells]


class Watched:
    """A command on a pty, seen through a `Picture`; `count` are the bytes that came since it was last set to 0."""

    def __init__(self, *arguments: str, columns: int = 80, rows: int = 24, cwd: Path | None = None, **env: str) -> None:
        pty = pytest.importorskip("pty", reason="pseudo-terminals are POSIX")
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            import fcntl
            import termios

            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
            os.environ.pop("NO_COLOR", None)
            os.environ.update(
                {"TERM": "xterm-256color", "COLORTERM": "", "LANG": "C.UTF-8", "PYTHONPATH": str(ROOT)}
                | {"COLUMNS": str(columns), "LINES": str(rows)}
                | env
            )
            os.chdir(cwd or ".")
            os.execv(sys.executable, [sys.executable, "-m", "analyzer.cli", *arguments])
        self.picture = Picture(columns, rows)
        self.raw, self.count = b"", 0
        self.over = False
        self._text = codecs.getincrementaldecoder("utf-8")(errors="replace")  # a read may end inside a character

    def press(self, keys: str | bytes, quiet: float = 0.4) -> Watched:
        """Type all of it at once; wait until nothing comes any more."""
        os.write(self.fd, keys.encode() if isinstance(keys, str) else keys)
        self.settle(quiet)
        return self

    def settle(self, quiet: float = 0.4, most: float = 20.0) -> None:
        """Take in what comes until nothing has come for so long."""
        end = time.monotonic() + most
        while time.monotonic() < end and self._read(quiet):
            pass

    def until(self, wanted: str | Callable[[], bool], seconds: float = PATIENCE_S) -> Watched:
        """Wait for something to be shown, or to be so."""
        end = time.monotonic() + seconds
        while not (wanted() if callable(wanted) else wanted in self.shown()):
            assert time.monotonic() < end, self.shown()
            self._read(0.1)
        return self

    def shown(self) -> str:
        """What stands on the terminal."""
        return "\n".join(self.picture.lines())

    def _read(self, seconds: float) -> bool:
        if not select.select([self.fd], [], [], seconds)[0]:
            return False
        try:
            data = os.read(self.fd, 1 << 16)
        except OSError:
            return False
        if b"\x1b[?2026$p" in data:
            os.write(self.fd, b"\x1b[?2026;2$y")
        self.count += len(data)
        self.raw += data
        self.picture.feed(self._text.decode(data))
        return bool(data)

    def status(self) -> int:
        """Wait for its end."""
        end, ended, status = time.monotonic() + PATIENCE_S, 0, 0
        while not ended:
            assert time.monotonic() < end, self.shown()
            self._read(0.1)
            ended, status = os.waitpid(self.pid, os.WNOHANG)
        while self._read(0.1):
            pass
        self.over = True
        return os.waitstatus_to_exitcode(status)

    def close(self) -> None:
        """End it, if it has not ended."""
        os.close(self.fd)
        if not self.over:
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)

    def __enter__(self) -> Watched:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
