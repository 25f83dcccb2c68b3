"""Random keys, clicks, pastes and resizes through a real terminal, for as long as one likes.

    python benchmarks/keys.py [MINUTES] [--seed N] [CAPTURE ...]        default: 15 minutes, the bundled captures

Each round opens a capture, or replays it as a live bus, at a random size. Told, with the seed and the newest keys, is
what no interface may do: a traceback, an end that nobody asked for, a key that is not answered, cells that a redraw
would draw otherwise, and an exit status or words left behind on the terminal when it is quit with keys waiting.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import random
import shutil
import signal
import struct
import sys
import tempfile
import termios
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "support"))

from emulator import Picture, Watched

from captures import samples

_SIZES: Final = ((80, 24), (120, 40), (60, 20), (200, 60), (40, 12), (100, 30))
_ARROWS: Final = ["\x1b[A", "\x1b[B", "\x1b[C", "\x1b[D", "\x1b[H", "\x1b[F", "\x1b[5~", "\x1b[6~"]
_LETTERS: Final = [c for c in map(chr, range(33, 127)) if c != "q"]
_OTHERS: Final = ["\r", "\t", "\x1b[Z", "\x1b", " ", "\x10", "\x0f", "\x12", "\x06", "\x07", "\x7f", "ц", "ф"]
_PASTES: Final = ["11 03 00 6B 00 03 76 87", "unit == 1", "0s-5s", "\x00\u202e[red]x", "Я" * 300, "08:29:51.5"]
_ROUND_S: Final = 45.0
_KEYS: Final = 40  # between two looks
_ANSWER_S: Final = 10.0
_STILL_S: Final = 2.0  # nothing is painted for so long: nothing is read any more
_TRIES: Final = 2  # keys that are not answered
_NOTICE: Final = "▌"  # at the left of each


class Round:
    """One stay in the interface."""

    def __init__(self, chance: random.Random, capture: Path, folder: Path, language: str) -> None:
        self._chance = chance
        self.columns, self.rows = chance.choice(_SIZES)
        self.live = chance.random() < 0.3
        self._copy = Path(shutil.copy(capture, folder))
        how = ["replay", self._copy.name, "--tui"] if self.live else ["open", self._copy.name]
        self.name = f"{' '.join(how)} at {self.columns}x{self.rows}, {language}"
        self.typed: list[str] = []
        self.wrong: list[str] = []
        size = {"columns": self.columns, "rows": self.rows}
        places = {"XDG_CONFIG_HOME": str(folder), "COLUMNS": "", "LINES": ""}
        self._terminal = Watched(*how, "--lang", language, cwd=folder, **size, **places)  # type: ignore[arg-type]

    def play(self, seconds: float) -> None:
        """Type at random, then leave."""
        with self._terminal:
            self._terminal.until(lambda: "Home" in self._shown or "0" in self._shown[:4])
            end = time.monotonic() + seconds
            while time.monotonic() < end and self._alive():
                for _ in range(_KEYS):
                    self._something()
                self._look()
            if self._alive():
                self._leave()

    @property
    def _shown(self) -> str:
        return self._terminal.shown()

    def _write(self, keys: str) -> None:
        self.typed.append(keys)
        try:
            os.write(self._terminal.fd, keys.encode())
            self._terminal._read(self._chance.choice((0, 0, 0.01, 0.1)))
        except OSError:
            self._said("it has ended")

    def _something(self) -> None:
        draw = self._chance.random()
        if draw < 0.02:
            self._resize(*self._chance.choice(_SIZES))
        elif draw < 0.05:
            self._write(f"\x1b[200~{self._chance.choice(_PASTES)}\x1b[201~")
        elif draw < 0.15:
            x, y = self._chance.randint(1, self.columns), self._chance.randint(1, self.rows)
            button = self._chance.choice((0, 0, 2, 35, 64, 65))
            self._write(f"\x1b[<{button};{x};{y}M\x1b[<{button};{x};{y}m")
        elif draw < 0.5:
            self._write(self._chance.choice(_ARROWS))
        elif draw < 0.7:
            self._write(self._chance.choice(_OTHERS))
        else:
            self._write(self._chance.choice(_LETTERS))

    def _resize(self, columns: int, rows: int) -> None:
        if (columns, rows) == (self.columns, self.rows):
            return  # nothing is drawn anew
        self.typed.append(f"<{columns}x{rows}>")
        self._terminal.settle(0.3, most=5)  # what is under way is for the old size
        self.columns, self.rows = columns, rows
        self._terminal.picture = Picture(columns, rows)
        fcntl.ioctl(self._terminal.fd, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        self._told_of_size()

    def _told_of_size(self) -> None:
        os.kill(self._terminal.pid, signal.SIGWINCH)
        self._terminal._read(_ANSWER_S)
        self._terminal.settle(1.0, most=5)

    def _look(self) -> None:
        """Nothing went wrong, a key is answered, and what stands there is what a redraw draws."""
        self._terminal.settle(1.0 if self.live else _STILL_S, most=15)
        if not self._alive():
            self._said("it ended by itself")
            return
        if b"Traceback" in self._terminal.raw:
            self._said("traceback")
        self._terminal.raw = self._terminal.raw[-4096:]
        if not self.live:
            self._compare()
        self._answered()

    def _compare(self) -> None:
        """Told of its size, the terminal draws all anew. Notices, which go by themselves, do not count."""
        before = self._terminal.picture.lines()
        self._terminal.picture = Picture(self.columns, self.rows)
        self._told_of_size()
        after = self._terminal.picture.lines()
        pairs = [(old, new) for old, new in zip(before, after, strict=True) if old != new and _NOTICE not in old]
        if pairs:
            self._said("another picture:\n" + "\n".join(f"-{old}\n+{new}" for old, new in pairs[:6]))

    def _answered(self) -> None:
        """Out of whatever is open, to two views by their keys; what is read behind an Esc at once is Alt with it."""
        for key in "27":
            for _ in range(_TRIES):
                for _ in range(4):
                    self._write("\x1b")
                    self._terminal.settle(0.5, most=2)
                self._write(key)
                if self._waited(partial(self._has_chosen, key)):
                    break
            else:
                self._said(f"{key} was not answered:\n{self._shown}")

    def _waited(self, so: Callable[[], bool]) -> bool:
        end = time.monotonic() + _ANSWER_S
        while not so() and time.monotonic() < end:
            self._terminal._read(0.1)
        return so()

    def _has_chosen(self, digit: str) -> bool:
        """Whether the tab of a digit stands out."""
        picture = self._terminal.picture
        cells = [c for c, look in zip(picture.cells[0], picture.looks[0], strict=True) if "7" in look]
        return "".join(cells).strip().startswith(digit)

    def _leave(self) -> None:
        """Quit with keys behind it."""
        self._write("\x1b\x1b")
        self._terminal.settle(0.3, most=2)
        self._write("1\x11" + "".join(self._chance.choices(_ARROWS + _LETTERS, k=5)))
        if not self._waited(lambda: not self._alive()):
            self._said(f"it does not end:\n{self._shown}")
            return
        self._terminal.settle(0.1, most=1)
        if b"Traceback" in self._terminal.raw or b"never retrieved" in self._terminal.raw:
            self._said("words on leaving")

    def _alive(self) -> bool:
        if getattr(self, "_status", None) is not None:
            return False
        pid, status = os.waitpid(self._terminal.pid, os.WNOHANG)
        if pid:
            self._status = os.waitstatus_to_exitcode(status)
            if self._status:
                self._said(f"exit status {self._status}")
        return not pid

    def _said(self, words: str) -> None:
        self.wrong.append(words)
        tail = self._terminal.raw[-3000:].decode(errors="replace") if "race" in words or "ended" in words else ""
        print(f"WRONG {self.name}: {words}\n  keys {self.typed[-120:]!r}\n{tail}", flush=True)


def main() -> int:
    """Rounds until the time is over; 1 where anything went wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("minutes", nargs="?", type=float, default=15.0)
    parser.add_argument("captures", nargs="*", type=Path, metavar="CAPTURE")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_intermixed_args()
    files = arguments.captures or [samples.path("troubled.jsonl"), samples.path("healthy.jsonl")]
    end, seed, wrong, keys = time.monotonic() + 60 * arguments.minutes, arguments.seed, 0, 0
    while time.monotonic() < end:
        chance = random.Random(seed)
        with tempfile.TemporaryDirectory() as folder:
            stay = Round(chance, chance.choice(files), Path(folder), chance.choice(("en", "ru")))
            stay.play(min(_ROUND_S, end - time.monotonic()))
        wrong, keys = wrong + len(stay.wrong), keys + len(stay.typed)
        print(f"seed {seed}: {stay.name}, {len(stay.typed)} keys, {len(stay.wrong)} wrong", flush=True)
        seed += 1
    print(f"{keys} keys in {seed - arguments.seed} rounds, {wrong} wrong")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
