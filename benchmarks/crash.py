"""Kills a recorder with SIGKILL at random moments and looks at what it left (POSIX only).

    python benchmarks/crash.py [TIMES]

A line is talked on without a pause; what was sent, and when, is known. Each file left behind must open, hold what was
sent up to a second before the kill at least, in order and without a gap, and become whole by repair.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tty
from dataclasses import dataclass
from pathlib import Path

import captures
from captures.recording.repair import repair

_START = "import sys; from analyzer.cli import main; sys.exit(main())"
_PIECE = 16  # bytes written at once
_PERIOD_S = 0.002


@dataclass(frozen=True)
class Crash:
    """What a kill left. `lost_s` is the time from the first byte that is not in the file to the kill."""

    after_s: float
    sent: int
    kept: int
    lost_s: float
    in_order: bool
    whole_after_repair: bool


def crash(folder: Path, after_s: float) -> Crash:
    """Record a busy line, kill the recorder `after_s` seconds after it opened the port."""
    master, slave = os.openpty()
    tty.setraw(slave)
    path = folder / f"crash-{time.monotonic_ns()}.mcap"
    process = subprocess.Popen(
        [sys.executable, "-c", _START, "record", os.ttyname(slave), "--baud", "115200", "-o", str(path)],
        stderr=subprocess.PIPE,
        cwd=Path(captures.__file__).parents[1],
    )
    assert process.stderr is not None
    while b"listening" not in process.stderr.readline():
        assert process.poll() is None
    sent: list[float] = []  # when each piece was written
    ended = threading.Event()

    def talk() -> None:
        while not ended.is_set():
            os.write(master, len(sent).to_bytes(4, "little") * (_PIECE // 4))
            sent.append(time.monotonic())
            time.sleep(_PERIOD_S)

    talker = threading.Thread(target=talk)
    talker.start()
    time.sleep(after_s)
    killed = time.monotonic()
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stderr.close()
    ended.set()
    talker.join()
    os.close(master)
    os.close(slave)
    return _look(path, after_s, sent, killed)


def _look(path: Path, after_s: float, sent: list[float], killed: float) -> Crash:
    left = path.with_name(path.name + ".part")
    data = b"".join(block.data.tobytes() for block in captures.open(left).blocks())
    expected = b"".join(number.to_bytes(4, "little") * (_PIECE // 4) for number in range(len(sent)))
    whole = path.with_name("repaired-" + path.name)
    repair(left, whole)
    again = captures.open(whole)
    same = b"".join(block.data.tobytes() for block in again.blocks()) == data
    before = [at for at in sent if at <= killed]
    first_lost = len(data) // _PIECE
    lost_s = max(0.0, killed - sent[first_lost]) if first_lost < len(before) else 0.0
    left.unlink()
    whole.unlink()
    return Crash(after_s, len(before) * _PIECE, len(data), lost_s, expected.startswith(data), same and not again.damage)


def main() -> None:
    times = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    chance = random.Random()
    with tempfile.TemporaryDirectory() as folder:
        crashes = [crash(Path(folder), chance.uniform(0.05, 3.0)) for _ in range(times)]
    worst = max(crashes, key=lambda each: each.lost_s)
    bad = [each for each in crashes if not (each.in_order and each.whole_after_repair)]
    print(f"{times} kills; most lost {worst.lost_s * 1e3:.0f} ms; out of order or not whole after repair: {len(bad)}")
    print(f"median lost {sorted(each.lost_s for each in crashes)[times // 2] * 1e3:.0f} ms")


if __name__ == "__main__":
    main()
