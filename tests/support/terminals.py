"""A command on a terminal of its own."""

from __future__ import annotations

import os
import select
import signal
import sys
import time
from pathlib import Path

import pytest
from running import ROOT

posix = pytest.mark.skipif(os.name != "posix", reason="ptys are POSIX")


class Terminal:
    """A command on a pty."""

    def __init__(
        self, *arguments: str, term: str = "xterm-256color", columns: int = 100, rows: int = 30, cwd: Path | None = None
    ) -> None:
        import fcntl
        import pty
        import struct
        import termios

        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.environ.update(TERM=term, PYTHONPATH=str(ROOT), COLUMNS=str(columns), LINES=str(rows))
            os.chdir(cwd or ".")
            os.execv(sys.executable, [sys.executable, "-m", "analyzer.cli", *arguments])
        fcntl.ioctl(self.fd, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        self.seen = b""

    def press(self, keys: str) -> None:
        """Type, and wait a moment for what that does."""
        os.write(self.fd, keys.encode())
        self._read(0.3)

    def until(self, wanted: bytes, seconds: float = 60) -> None:
        """Wait for something to be shown."""
        end = time.monotonic() + seconds
        while wanted not in self.seen:
            assert time.monotonic() < end, self.seen[-2000:]
            if not self._read(0.2):
                break
        assert wanted in self.seen, self.seen[-2000:]

    def status(self, seconds: float = 30) -> int:
        """Wait for its end."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._read(0.05)
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self._read(0.2)
                return os.waitstatus_to_exitcode(status)
        os.kill(self.pid, signal.SIGKILL)
        raise AssertionError("it did not end")

    def whole(self) -> str:
        """All that it shows until it ends."""
        self.status()
        return self.seen.decode()

    def _read(self, seconds: float) -> bool:
        """Take in what comes, for so long; False once nothing can come any more."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            if select.select([self.fd], [], [], left)[0]:
                try:
                    data = os.read(self.fd, 1 << 16)
                except OSError:  # the command has ended
                    return False
                if not data:
                    return False
                self.seen += data
        return True
