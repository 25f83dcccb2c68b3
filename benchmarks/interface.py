"""How quick the terminal interface is, measured from outside: on a real pty, by what comes out of it.

    python benchmarks/interface.py [FRAMES] [CAPTURE]        default: 10,000,000 frames

Makes a capture (or takes one), opens it at 160x50 as a user would, and prints: time to the first rows and until all is
read, page-down while reading and after it, end, home, display filters until the final number of rows stands there, and
memory a frame. Times are wall clock, from the key to the end of the picture that shows it. The program runs from
bytecode, as an installed one does.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import pty
import re
import select
import signal
import statistics
import struct
import sys
import tempfile
import termios
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # run as a module too
sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "support"))

from emulator import Picture
from measuring import cpu_s

QUIET_S = 0.06  # no output for so long: the picture is complete
ROWS, COLUMNS = 50, 160
BYTECODE = tempfile.TemporaryDirectory(prefix="rtuscope-bytecode-")
STILL_S = 3.0  # nothing was painted and next to nothing reckoned for so long: all is done
IDLE = 0.05  # of that time, at most, in which it may have reckoned


class Terminal:
    """A program on a pty; what it writes is read, never shown."""

    def __init__(self, command: list[str]) -> None:
        self.begun = time.perf_counter()
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
            os.environ.update(
                TERM="xterm-256color", COLORTERM="truecolor", TEXTUAL_FPS="60", PYTHONPYCACHEPREFIX=BYTECODE.name
            )
            os.execv(command[0], command)
        fcntl.ioctl(self.fd, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
        self.seen = b""
        self.all: list[tuple[float, bytes]] = []  # what came, and when

    @property
    def came(self) -> int:
        """How many pieces of output came so far."""
        return len(self.all)

    def rest(self) -> None:
        """Wait until nothing is painted and nothing reckoned any more."""
        while True:
            reckoned, came = self.cpu(), self.came
            until = time.perf_counter() + STILL_S
            while time.perf_counter() < until:
                self.read(0.1)
            if self.came == came and self.cpu() - reckoned < STILL_S * IDLE:
                return

    def read(self, timeout: float) -> bytes:
        """What comes within this time, at once."""
        if not select.select([self.fd], [], [], timeout)[0]:
            return b""
        try:
            data = os.read(self.fd, 1 << 16)
        except OSError:
            return b""
        if b"\x1b[?2026$p" in data:  # can it take a picture as a whole? it can
            os.write(self.fd, b"\x1b[?2026;2$y")
        self.seen = (self.seen + data)[-(1 << 18) :]
        self.all.append((time.perf_counter(), data))
        return data

    def wait(self, wanted: Callable[[bytes], bool], limit: float) -> float:
        """Seconds until the newest output is as wanted."""
        begun = time.perf_counter()
        while time.perf_counter() - begun < limit:
            if self.read(0.02) and wanted(self.seen):
                return time.perf_counter() - begun
        raise SystemExit("it did not come")

    def drain(self, quiet: float = QUIET_S, limit: float = 5.0) -> float:
        """When the last byte came, once nothing comes any more; now where nothing came."""
        last = begun = time.perf_counter()
        while time.perf_counter() - last < quiet and time.perf_counter() - begun < limit:
            if self.read(quiet):
                last = time.perf_counter()
        return last

    def key(self, key: bytes) -> float:
        """Seconds from a key to the end of the picture that shows it; what follows it is waited for."""
        self.drain()
        begun = time.perf_counter()
        self.seen = b""
        os.write(self.fd, key)
        while b"\x1b[?2026l" not in self.seen and time.perf_counter() - begun < 5:
            self.read(1)
        return time.perf_counter() - begun

    def keys(self, key: bytes, times: int) -> list[float]:
        """The same, several times."""
        return [self.key(key) for _ in range(times)]

    def memory(self) -> int:
        """Bytes resident, of the program alone."""
        return int(re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{self.pid}/status").read_text())[1]) * 1024  # type: ignore[index]

    def cpu(self) -> float:
        """Seconds of CPU that the program took so far."""
        return cpu_s(self.pid)

    def close(self) -> None:
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)


def make(frames: int, path: Path) -> None:
    """A capture of the bus that `bus.py` makes, a read a frame."""
    import bus
    from corpus import a_read_a_frame

    import captures
    from captures.chunks import Capture

    class Source:
        line, timed = bus.LINE, True

        def blocks(self, max_bytes: int, note: object) -> object:  # noqa: ARG002
            return map(a_read_a_frame, bus.slices(frames))

    captures.write(path, Capture(Source()))  # type: ignore[arg-type]


def told(name: str, seconds: list[float] | float) -> None:
    values = seconds if isinstance(seconds, list) else [seconds]
    worst = f", worst {max(values) * 1e3:,.0f} ms of {len(values)}" if len(values) > 1 else ""
    print(f"{name:<64} {statistics.median(values) * 1e3:>10,.1f} ms{worst}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frames", nargs="?", type=_number, default=10_000_000, metavar="FRAMES")
    parser.add_argument("capture", nargs="?", type=Path, metavar="CAPTURE", help="of so many frames; by default made")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = arguments.capture or Path(folder) / "bus.mcap"
        if arguments.capture is None:
            make(arguments.frames, path)
        measure(path, arguments.frames)


def _number(text: str) -> int:
    return int(text.replace(",", ""))


def opened(path: Path) -> Terminal:
    """The program with a transaction in sight."""
    terminal = Terminal([sys.executable, "-m", "analyzer.cli", "open", str(path)])
    terminal.wait(lambda seen: "×".encode() in seen, 60)  # a quantity
    return terminal


def measure(path: Path, frames: int) -> None:
    terminal = Terminal([sys.executable, "-m", "analyzer.cli", "open"])
    terminal.wait(lambda seen: b"paste or type" in seen, 60)
    terminal.drain(0.5)
    bare = terminal.memory()
    terminal.close()
    opened(path).close()  # all of it is bytecode now
    firsts, reckoned = [], []
    for _ in range(4):
        terminal = opened(path)
        firsts.append(time.perf_counter() - terminal.begun)
        reckoned.append(terminal.cpu())
        terminal.close()
    told("start to first rows", firsts)
    told("  of which CPU time", reckoned)
    terminal = opened(path)
    ended = time.perf_counter()
    told("page down, while reading", terminal.keys(b"\x1b[6~", 20))
    while terminal.read(3.0):  # the line of progress moves as long as it reads
        ended = time.perf_counter()
    told("start to all rows", ended - terminal.begun)
    told("  of which CPU time", terminal.cpu())
    terminal.rest()
    told("page down", terminal.keys(b"\x1b[6~", 60))
    told("cursor down", terminal.keys(b"\x1b[B", 60))
    ends = [(terminal.key(b"\x1b[F"), terminal.key(b"\x1b[H")) for _ in range(5)]
    told("end", [end for end, _ in ends])
    told("home", [home for _, home in ends])
    resident = terminal.memory()
    each = (resident - bare) / frames
    print(f"{'memory of the program':<64} {resident / 1e6:>10,.1f} MB, {bare / 1e6:,.1f} MB of it without a capture")
    print(f"{'':<64} {each:>10,.0f} bytes a frame, its own bytes (about 16) among them")
    for text in ("unit == 17", "not exception", "response_time > 8ms", "value > 65000"):
        spent = terminal.cpu()
        seconds, shown = filtered(terminal, text.encode())
        told(f"filter: {text}, until {shown}", seconds)
        told("  CPU time of it, with the typing", terminal.cpu() - spent)
    terminal.close()


def filtered(terminal: Terminal, text: bytes) -> tuple[float, str]:
    """Seconds from Enter to the picture in which the final number of rows stands, and that number as it is shown.

    What came is put on a picture afterwards, so that reading the terminal takes nothing from what is measured.
    """
    terminal.key(b"\x1b")
    terminal.rest()
    terminal.key(b"/")
    terminal.key(text)
    before = terminal.came
    terminal.drain(0.3)
    begun = time.perf_counter()
    os.write(terminal.fd, b"\r")
    terminal.rest()
    picture = Picture(COLUMNS, ROWS)
    shown, at = "", begun
    for when, data in terminal.all:
        picture.feed(data.decode(errors="replace"))
        found = re.search(r"[\d,]+ of [\d,]+ rows shown", picture.lines()[-2])
        now = found[0] if found else ""
        if now != shown:
            shown, at = now, when
    assert before < len(terminal.all) and shown, "the filter was used"
    return at - begun, shown


if __name__ == "__main__":
    main()
