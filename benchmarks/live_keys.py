"""How soon a key is answered in each view while a large bus is watched live, on this machine and on a slower one.

    python benchmarks/live_keys.py [--slower 5] [--registers 5000] [--rate 340] [--times 5]

A bus of so many registers, at so many frames a second, is replayed in the interface. In each view Help is asked for and
closed again; told is the time from the key to the page that stands there, as a terminal shows it. A slower machine is a
share of all cores (a cgroup's quota; Linux, as root). Then, with all keys at rest: what the interface costs of a core,
beside the same replay without it, as lines that nobody reads.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parent))  # run as a module too
sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "support"))

from emulator import Watched
from measuring import cpu_s

import captures
from analyzer.tui.views import VIEWS
from captures.chunks import Capture, Chunk, LineSettings
from dissectors.crc import crc_bytes

_QUANTITY: Final = 125  # registers of a poll
_UNITS: Final = 10
_PERIOD_US: Final = 100_000
_GROUP: Final = Path("/sys/fs/cgroup/cpu/rtuscope-slower")
_REST_S: Final = 20.0
_HELP: Final = "Narrow"  # a head on the page
_ASKING: Final = ("paste", "against")  # views whose keys are text


def polls(registers: int, rate: float, seconds: float) -> Iterator[Chunk]:
    """Requests and answers in turn; a third of the registers move."""
    count, begin = registers // _QUANTITY, 1_780_000_000_000_000_000
    for i in range(int(rate * seconds / 2)):
        poll, at = i % count, begin + round(i * 2e9 / rate)
        unit, address = 1 + poll % _UNITS, poll // _UNITS * _QUANTITY
        asked = bytes((unit, 3)) + address.to_bytes(2, "big") + _QUANTITY.to_bytes(2, "big")
        words = (poll * 1311 + k * 7 + (i // count if k % 3 == 0 else 0) for k in range(_QUANTITY))
        told = bytes((unit, 3, 2 * _QUANTITY)) + b"".join((word & 0xFFFF).to_bytes(2, "big") for word in words)
        yield Chunk(at, asked + crc_bytes(asked))
        yield Chunk(at + round(0.8e9 / rate), told + crc_bytes(told))


@contextmanager
def quota(slower: float) -> Iterator[Path | None]:
    """A group of processes that get so small a share of all cores; None where nothing is to be slower."""
    if slower <= 1:
        yield None
        return
    _GROUP.mkdir(exist_ok=True)
    try:
        (_GROUP / "cpu.cfs_period_us").write_text(str(_PERIOD_US), encoding="ascii")
        (_GROUP / "cpu.cfs_quota_us").write_text(
            str(round(_PERIOD_US * (os.cpu_count() or 1) / slower)), encoding="ascii"
        )
        yield _GROUP
    finally:
        _GROUP.rmdir()


def answered(terminal: Watched, key: str, *, page: bool, most_s: float) -> float:
    """Seconds from a key until Help stands there, or is gone."""
    terminal.settle(0.01, 0.05)
    begun = time.perf_counter()
    os.write(terminal.fd, key.encode())
    terminal.until(lambda: (_HELP in terminal.shown()) is page, most_s)
    return time.perf_counter() - begun


def measure(path: Path, group: Path | None, times: int) -> float:
    """Prints a line a view; the share of a core that is taken while no key is pressed."""
    with Watched("replay", str(path), "--tui", columns=120, rows=40, cwd=path.parent) as terminal:
        if group is not None:
            (group / "cgroup.procs").write_text(str(terminal.pid), encoding="ascii")
        terminal.until(lambda: "frames" in terminal.shown().splitlines()[-2], 120)
        for view in VIEWS:
            if view.name in _ASKING:
                continue
            terminal.press(view.key, 0.05)
            taken = []
            for _ in range(times):
                taken += [
                    answered(terminal, "?", page=True, most_s=60),
                    answered(terminal, "\x1b", page=False, most_s=60),
                ]
            half, most = statistics.median(taken) * 1e3, max(taken) * 1e3
            print(f"  {view.name:12} {half:6.0f} ms, at most {most:6.0f} ms", flush=True)
        terminal.press("1")
        begun, spent = time.perf_counter(), cpu_s(terminal.pid)
        while time.perf_counter() - begun < _REST_S:
            terminal.settle(0.05, 1)
        return (cpu_s(terminal.pid) - spent) / (time.perf_counter() - begun)


def alone(path: Path) -> float:
    """The same share without the interface."""
    command = [sys.executable, "-m", "analyzer.cli", "replay", str(path)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            time.sleep(5)
            begun, spent = time.perf_counter(), cpu_s(process.pid)
            time.sleep(_REST_S)
            return (cpu_s(process.pid) - spent) / (time.perf_counter() - begun)
        finally:
            process.kill()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--slower", type=float, default=1, metavar="TIMES", help="a machine so many times slower")
    parser.add_argument("--registers", type=int, default=5000)
    parser.add_argument("--rate", type=float, default=340, help="frames a second")
    parser.add_argument("--times", type=int, default=5, help="in each view")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, quota(arguments.slower) as group:
        path = Path(folder) / "large.jsonl"
        heard = polls(arguments.registers, arguments.rate, 900)
        captures.write(path, Capture.of(LineSettings(baud=921_600, char_bits=10), list(heard)))
        print(f"{arguments.registers:,} registers, {arguments.rate:g} frames/s, {arguments.slower:g} times slower")
        watched = measure(path, group, arguments.times)
        print(f"keys at rest: {watched:.1%} of a core; the same replay as lines: {alone(path):.1%}")


if __name__ == "__main__":
    main()
