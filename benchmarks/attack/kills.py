"""Kills: a recorder ended with SIGKILL at random moments, and what it left.

A line is talked on without a pause; what was sent, and when, is known. Each file left behind must open, hold what was
sent up to a second before the kill at least, in order and without a gap, and become whole by repair.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tty
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Final

import captures
from attack.target import Outcome
from captures.recording.mcapfile import repair

MOST_LOST_S: Final = 1.0
_START: Final = "import sys; from analyzer.cli import main; sys.exit(main())"
_PIECE: Final = 16  # bytes written at once
_PERIOD_S: Final = 0.002


@dataclass(frozen=True)
class Crash:
    """What a kill left. `lost_s` is the time from the first byte that is not in the file to the kill."""

    after_s: float
    sent: int
    kept: int
    lost_s: float
    in_order: bool
    whole_after_repair: bool


def attack(seed: int, kills: int) -> Outcome:
    """So many kills, each 0.05 to 3 s after the port was opened."""
    chance, outcome, lost = Random(f"{seed} kills"), Outcome("kills"), []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(kills):
            left = crash(Path(folder), chance.uniform(0.05, 3.0))
            lost.append(left.lost_s)
            if not (left.in_order and left.whole_after_repair and left.lost_s <= MOST_LOST_S):
                outcome.failures.append(str(left))
    outcome.tried = kills
    outcome.figures = f"most lost {max(lost) * 1e3:.0f} ms, median {sorted(lost)[kills // 2] * 1e3:.0f} ms"
    return outcome


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
