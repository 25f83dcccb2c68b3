"""How long a frame takes from its last byte on the wire to its line on the screen, and what that costs (POSIX only).

    python benchmarks/live_delay.py [--seconds N] [--read BYTES]

A pseudo-terminal is talked on at the pace of a saturated 115200 8N1 line, `--read` bytes at a time (what a FIFO or a
USB adapter gives): polls of ten registers with their answers, 1.8 ms of silence (t3.5) after each frame. `rtuscope
sniff` listens; each line that it prints is stamped when it arrives. Delay is the time from when the last byte was
written to then, t3.5 included; cost is CPU time of the command and its reader, as a share of one core.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import threading
import time
import tty
from pathlib import Path

import numpy as np

import captures
from dissectors.checks import crc_bytes

_START = "import sys; from analyzer.cli import main; sys.exit(main())"
_CHARACTER_S = 10 / 115_200
_T35_S = 0.00175


def _adu(text: str) -> bytes:
    data = bytes.fromhex(text)
    return data + crc_bytes(data)


def measure(command: list[str], seconds: float, read: int) -> tuple[np.ndarray, float, int]:
    """Delays (s) of all frames but the first hundred, share of a core, frames."""
    master, slave = os.openpty()
    tty.setraw(slave)
    frames = [_adu("1103006b000a"), _adu("110314" + "0102" * 10)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
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
    time.sleep(0.3)
    sent: list[float] = []
    begun = due = time.monotonic()
    while due < begun + seconds:
        frame = frames[len(sent) % 2]
        for at in range(0, len(frame), read):
            part = frame[at : at + read]
            due += len(part) * _CHARACTER_S
            _until(due)
            os.write(master, part)
        sent.append(time.monotonic())
        due += _T35_S
    time.sleep(0.5)
    process.terminate()
    process.wait()
    looker.join()
    process.stderr.close()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    count = min(len(sent), len(shown))
    if shown:
        assert len(shown) == len(sent), (len(shown), len(sent))
    delays = np.array(shown[:count]) - np.array(sent[:count])
    return delays[100:], cpu / seconds, len(sent)


def _until(due: float) -> None:
    while (left := due - time.monotonic()) > 0:
        if left > 0.0003:
            time.sleep(left - 0.0002)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--read", type=int, default=8)
    given = parser.parse_args()
    idle = measure(["sniff", "--baud", "115200", "--duration", "1s"], 0.01, given.read)[1] * 0.01  # start and end
    for name, command in (
        ("sniff", ["sniff", "--baud", "115200"]),
        ("sniff --json", ["sniff", "--baud", "115200", "--json"]),
        ("record", ["record", "--baud", "115200", "-o", f"/tmp/delay-{os.getpid()}.mcap"]),
    ):
        delays, share, frames = measure(command, given.seconds, given.read)
        share -= idle / given.seconds
        words = ""
        if len(delays):
            low, high = np.percentile(delays, [50, 99]) * 1e3
            words = f"  delay p50 {low:.1f} ms, p99 {high:.1f} ms, max {delays.max() * 1e3:.1f} ms"
        print(f"{name:14} {frames / given.seconds:.0f} frames/s  {share:.1%} of a core{words}", flush=True)
    Path(f"/tmp/delay-{os.getpid()}.mcap").unlink(missing_ok=True)


if __name__ == "__main__":
    main()
