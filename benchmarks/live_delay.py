"""How long a frame takes from its last byte on the wire to its line on the screen, and what that costs (Linux only).

    python benchmarks/live_delay.py [--seconds N] [--read BYTES]

A pseudo-terminal is talked on at the pace of a saturated 115200 8N1 line, `--read` bytes at a time (what a FIFO or a
USB adapter gives): polls of ten registers with their answers, 1.8 ms of silence (t3.5) after each frame. `rtuscope
sniff` listens; each line that it prints is stamped when it arrives. Delay is the time from when the last byte was
written to then, t3.5 included. Cost is what the command and the process that reads for it ran (the scheduler's count,
all threads), as a share of one core, once all is imported: from the third second on. The bus is another process's, and
sleeps between its writes: what it takes is not counted, nor does it take a core's time from what is measured.

Then the cost of `sniff` alone, at the same pace, on a line of a function that nobody declared, and on one where half of
the frames are random bytes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from itertools import cycle
from pathlib import Path
from random import Random

import numpy as np

import captures
from dissectors.crc import crc_bytes

_START = "import sys; from analyzer.cli import main; sys.exit(main())"
_CHARACTER_S = 10 / 115_200
_T35_S = 0.00175
_WARM_S = 2.0


def _adu(text: str) -> bytes:
    data = bytes.fromhex(text)
    return data + crc_bytes(data)


_POLL = [_adu("1103006b000a"), _adu("110314" + "0102" * 10)]
_UNDECLARED = [_adu("1141010203"), _adu("1141" + "a15c" * 9)]


def polls() -> Iterator[bytes]:
    """Ten registers, asked for and answered."""
    return cycle(_POLL)


def undeclared() -> Iterator[bytes]:
    """A function that nobody declared."""
    return cycle(_UNDECLARED)


def half_noise() -> Iterator[bytes]:
    """The polls, half of the frames random bytes."""
    random = Random(3)
    return (random.randbytes(len(frame)) if random.random() < 0.5 else frame for frame in cycle(_POLL))


def measure(
    command: list[str], seconds: float, read: int, traffic: Iterator[bytes] | None = None
) -> tuple[np.ndarray, dict[str, float], float]:
    """Delays (s) of all frames after the first seconds, the share of a core by process, frames a second.

    `traffic`: the frames, where these are not polls; then there are no delays.
    """
    master, slave = os.openpty()
    tty.setraw(slave)
    frames = polls() if traffic is None else traffic
    process = subprocess.Popen(
        [sys.executable, "-c", _START, command[0], os.ttyname(slave), *command[1:]],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=Path(captures.__file__).parents[1],
    )
    assert process.stdout is not None and process.stderr is not None
    while b"listening" not in process.stderr.readline():
        assert process.poll() is None
    shown: list[float] = []

    def look() -> None:
        for line in process.stdout or ():
            if b" 03 " in line or b'"direction"' in line:
                shown.append(time.monotonic())

    looker = threading.Thread(target=look)
    looker.start()
    reader = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()[0]
    pids = {"shows" if shows(command) else "records": str(process.pid), "reads": reader}
    sent: list[float] = []
    begun = due = time.monotonic()
    warm, before = 0, dict.fromkeys(pids, 0)
    while due < begun + _WARM_S + seconds:
        if not warm and due >= begun + _WARM_S:
            warm, before = len(sent), {name: _ran_ns(pid) for name, pid in pids.items()}
        frame = next(frames)
        for at in range(0, len(frame), read):
            part = frame[at : at + read]
            due += len(part) * _CHARACTER_S
            time.sleep(max(0.0, due - time.monotonic()))
            os.write(master, part)
        sent.append(time.monotonic())
        due += _T35_S
    shares = {name: (_ran_ns(pid) - before[name]) / seconds / 1e9 for name, pid in pids.items()}
    time.sleep(0.5)
    process.terminate()
    process.wait()
    looker.join()
    process.stderr.close()
    if traffic is not None:
        return np.empty(0), shares, (len(sent) - warm) / seconds
    if shows(command):
        assert len(shown) == len(sent), (len(shown), len(sent))
    delays = np.array(shown) - np.array(sent[: len(shown)])
    return delays[warm:], shares, (len(sent) - warm) / seconds


def shows(command: list[str]) -> bool:
    """Whether it prints lines."""
    return command[0] == "sniff"


def _ran_ns(pid: str) -> int:
    """How long all threads of a process ran so far, ns."""
    return sum(int((task / "schedstat").read_text().split()[0]) for task in Path(f"/proc/{pid}/task").iterdir())


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--read", type=int, default=8)
    given = parser.parse_args()
    for name, command in (
        ("sniff", ["sniff", "--baud", "115200"]),
        ("sniff --json", ["sniff", "--baud", "115200", "--json"]),
        ("sniff -o", ["sniff", "--baud", "115200", "-o", f"/tmp/delay-{os.getpid()}.mcap"]),
        ("record", ["record", "--baud", "115200", "-o", f"/tmp/delay-{os.getpid()}.mcap", "--overwrite"]),
    ):
        delays, shares, rate = measure(command, given.seconds, given.read)
        words = f"{name:14} {rate:.0f} frames/s  {_in_words(shares)}"
        if len(delays):
            low, high = np.percentile(delays, [50, 99]) * 1e3
            words += f"  delay p50 {low:.1f} ms, p99 {high:.1f} ms, max {delays.max() * 1e3:.1f} ms"
        print(words, flush=True)
    Path(f"/tmp/delay-{os.getpid()}.mcap").unlink(missing_ok=True)
    for traffic in (undeclared, half_noise):
        _, shares, _ = measure(["sniff", "--baud", "115200"], given.seconds, given.read, traffic())
        print(f"sniff, {traffic.__name__.replace('_', ' ')}: {_in_words(shares)}", flush=True)


def _in_words(shares: dict[str, float]) -> str:
    each = ", ".join(f"{name} {share:.1%}" for name, share in shares.items())
    return f"{sum(shares.values()):.1%} of a core ({each})"


if __name__ == "__main__":
    main()
