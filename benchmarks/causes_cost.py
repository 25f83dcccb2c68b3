"""What the layer of causes adds to the time and the memory of findings, by the size of a capture.

    python benchmarks/causes_cost.py [--frames 100000,300000,1000000] [--rounds N] [--wires clean,noisy] [--units N]

Captures come from `rtuscope simulate`, a bus that is well and one that is not. A round is two processes, one that
finds findings and one that weighs causes besides, and a `rtuscope report` of both; the least CPU seconds (user and
system; of the first two without imports) of all rounds count. What causes keep is the growth of the process's peak.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from measuring import HERE, RTUSCOPE, run
from report import table

_MEASURED = """
import resource, sys, time
from analyzer.causes.ledger import Ledger
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from captures import open as open_capture
capture = open_capture(sys.argv[1])
ledger = Ledger(capture.line) if sys.argv[2] == "causes" else None
begun, frames = time.process_time(), 0
for part in analyse(capture):
    frames += int((part.batch.rows.kind > 0).sum())
    if ledger is not None:
        ledger.feed(part.batch, part.transactions)
if ledger is not None:
    ledger.close()
    causes_of(ledger)
print(time.process_time() - begun, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, frames)
"""


def measured(capture: Path, what: str) -> tuple[float, float, int]:
    """CPU seconds, peak MiB and frames of one process."""
    words = subprocess.run(
        [sys.executable, "-c", _MEASURED, capture, what], check=True, capture_output=True, text=True, cwd=HERE.parent
    ).stdout.split()
    return float(words[0]), float(words[1]), int(words[2])


def row(wire: str, frames: int, units: int, rounds: int) -> list[str]:
    """One capture, made, measured and taken away."""
    with tempfile.TemporaryDirectory() as folder:
        capture = Path(folder, "bus.mcap")
        how = ("--wire", wire, "--tap", "irq", "--baud", "19200", "--units", str(units), "--seed", "3")
        subprocess.run([*RTUSCOPE, "simulate", capture, "--transactions", str(frames // 2), *how], check=True)
        runs = [(measured(capture, "findings"), measured(capture, "causes")) for _ in range(rounds)]
        report = min(run([*RTUSCOPE, "report", "--json", capture], Path(folder)).cpu for _ in range(rounds))
    without, with_causes = (min(each[i][0] for each in runs) for i in range(2))
    least, most = (min(each[i][1] for each in runs) for i in range(2))
    added = with_causes - without
    shares = [f"{added / of:.0%}" for of in (without, report - added)]
    frames = runs[0][0][2]
    return [wire, f"{frames:,}", f"{without:.2f}", f"{with_causes:.2f}", *shares, f"{least:.0f}", f"{most:.0f}"]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--frames", default="100000,300000,1000000")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--wires", default="clean,noisy")
    parser.add_argument("--units", type=int, default=8)
    options = parser.parse_args(arguments)
    rows = [
        row(wire, frames, options.units, options.rounds)
        for wire in options.wires.split(",")
        for frames in map(int, options.frames.split(","))
    ]
    heads = ("bus", "frames", "findings, s", "and causes", "added", "to a report", "findings, MiB", "and causes")
    print(table(heads, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
