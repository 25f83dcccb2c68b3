"""Attacks on batches: killed a hundred times, and one file in a hundred damaged; the lake must not show it.

    python -m benchmarks.fleet_faults kills /tmp/faults --kills 100
    python -m benchmarks.fleet_faults damage /tmp/faults --captures 1000

Captures are small, so that a kill falls into any step of a task as likely as into another.
"""

from __future__ import annotations

import argparse
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import captures
from analyzer.fleet.batch import BatchResult, run_batch
from analyzer.fleet.datasets import DATASETS
from analyzer.fleet.entries import FOLDER
from analyzer.fleet.lake import Lake
from analyzer.fleet.linetask import BatchOptions
from analyzer.fleet.manifest import Manifest
from analyzer.fleet.questions import Asked, ready
from analyzer.fleet.runners import in_this_process
from analyzer.fleet.sources import found, lines_of
from analyzer.fleet.stores import store
from analyzer.simulation import Scenario, simulate

_LINES_A_SITE = 10
_WAYS = ("cut", "overwritten", "replaced")
_SEEDED = 1  # of what is left to chance


def make_captures(folder: Path, count: int, transactions: int) -> None:
    """So many small captures, each another conversation."""
    for number in range(count):
        path = folder / f"site-{number // _LINES_A_SITE:04d}" / f"bus-{number % _LINES_A_SITE}.mcap"
        path.parent.mkdir(parents=True, exist_ok=True)
        wire = "noisy" if number % 2 else "clean"
        made = simulate(Scenario(wire, "precise", transactions=transactions, seed=number, baud=9600))
        captures.write(path, made.chunks, line=made.line)


def taken(source: Path, lake: Path) -> BatchResult:
    """A batch in this process."""
    return run_batch(store(str(lake)), lines_of(found([str(source)])), BatchOptions(), in_this_process)


def differing(one: Path, two: Path, harmed: frozenset[tuple[str, str]] = frozenset()) -> list[str]:
    """Tables of two lakes of the same sources whose rows differ, apart from lines that were harmed."""
    return [table for table in DATASETS if _rows(one, table, harmed) != _rows(two, table, harmed)]


def _rows(lake: Path, table: str, harmed: frozenset[tuple[str, str]]) -> list[tuple[str, str, str]]:
    """Site, line and the whole row as text, in order."""
    rows: list[tuple[str, str, str]] = (
        Lake(str(lake)).sql(f"SELECT site, line, {table}::VARCHAR FROM {table} ORDER BY ALL").fetchall()
    )
    return [row for row in rows if row[:2] not in harmed]


def kills(folder: Path, count: int, captured: int) -> None:
    """Batches killed at chance moments, until so many kills; then one to its end."""
    source, whole, lake = folder / "source", folder / "whole", folder / "lake"
    make_captures(source, captured, 30)
    taken(source, whole)
    chance, killed, rounds = random.Random(_SEEDED), 0, 1
    command = [sys.executable, "-m", "analyzer.cli", "batch", str(source), "-o", str(lake), "--resume", "--workers"]
    while killed < count:
        before = _entries(lake)
        process = subprocess.Popen([*command, "1"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        further = before + chance.randint(0, max(captured // 12, 1))
        while process.poll() is None and not ((lake / "scratch").is_dir() and _entries(lake) >= further):
            time.sleep(0.002)
        time.sleep(chance.uniform(0, 0.4))
        process.send_signal(signal.SIGKILL)
        process.wait()
        killed += process.returncode == -signal.SIGKILL
        if process.returncode == 0 and killed < count:  # it was done before the kill: another round from nothing
            _compare(whole, lake, f"round {rounds}, {killed} kills")
            shutil.rmtree(lake)
            rounds += 1
    taken(source, lake)
    _compare(whole, lake, f"{killed} kills in {rounds} rounds of {captured} captures")


def _entries(lake: Path) -> int:
    return len(list((lake / FOLDER).glob("*.json")))


def _compare(whole: Path, lake: Path, what: str) -> None:
    wrong = differing(whole, lake)
    named = Manifest(store(str(lake))).named()
    missing = [name for name in named if not (lake / name).exists()]
    print(f"{what}: {'the same rows' if not wrong else f'other rows in {wrong}'}, {len(missing)} files missing")
    if wrong or missing:
        sys.exit(1)


def damage(folder: Path, count: int) -> None:
    """One capture in a hundred cut, overwritten or replaced."""
    source, whole, lake = folder / "source", folder / "whole", folder / "lake"
    make_captures(source, count, 16)
    taken(source, whole)
    chance = random.Random(_SEEDED)
    chosen = chance.sample(sorted(source.rglob("*.mcap")), max(count // 100, 1))
    for number, path in enumerate(chosen):
        path.write_bytes(_harmed(path.read_bytes(), _WAYS[number % len(_WAYS)], chance))
    result = taken(source, lake)
    harmed = frozenset((path.parent.name, path.name) for path in chosen)
    listed = {(row["site"], row["line"]) for row in ready(Lake(str(lake)), "damaged", Asked(limit=count)).to_pylist()}
    wrong = differing(whole, lake, harmed)
    print(
        f"{len(harmed)} of {result.captures} captures damaged: {len(listed & harmed)} of them listed, "
        f"{len(listed - harmed)} others listed, {result.failed} tasks failed, "
        f"{'all rows of the others there' if not wrong else f'other rows in {wrong}'}"
    )
    if wrong or listed != harmed or result.failed:
        sys.exit(1)


def _harmed(data: bytes, way: str, chance: random.Random) -> bytes:
    at = chance.randrange(len(data) // 10, len(data) - len(data) // 10)
    if way == "replaced":
        return chance.randbytes(len(data))
    return data[:at] + (b"" if way == "cut" else bytes(40) + data[at + 40 :])


def main() -> None:
    """Arguments, work, verdict."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("kills", "damage"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--captures", type=int, default=60)
    arguments = parser.parse_args()
    shutil.rmtree(arguments.folder, ignore_errors=True)
    if arguments.what == "kills":
        kills(arguments.folder, arguments.kills, arguments.captures)
    else:
        damage(arguments.folder, arguments.captures)


if __name__ == "__main__":
    main()
