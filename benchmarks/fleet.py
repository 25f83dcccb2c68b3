"""What a fleet costs: batches by one and two processes, growth over three sizes, ready questions of a large lake.

    python -m benchmarks.fleet batch /tmp/fleet --sites 20 --days 30
    python -m benchmarks.fleet questions /tmp/fleet --frames 100_000_000

The corpus is simulated: eight buses at 9600 bit/s, two of them noisy, each day of a site one of them, in 24 pieces an
hour apart. The factor
to a real fleet is said with the figures. The large lake of `questions` is one site's month, its files linked under so
many sites' names: all footers and pages are read, though the operating system has the pages once.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import time
from pathlib import Path

import numpy as np

import captures
from analyzer.fleet.batch import BatchResult, compact_lake, run_batch
from analyzer.fleet.datasets import DATASETS
from analyzer.fleet.lake import Lake
from analyzer.fleet.linetask import BatchOptions
from analyzer.fleet.manifest import Manifest
from analyzer.fleet.runners import ProcessPool, in_this_process
from analyzer.fleet.sources import found, lines_of
from analyzer.fleet.stores import store
from analyzer.simulation import Scenario, simulate

DAY_NS = 86_400_000_000_000
BEGIN_NS = 20_700 * DAY_NS  # a midnight in 2026
REAL_FRAMES_A_DAY = 744_000_000 / 365  # of one 9600 baud line, half loaded
BUSES = 8
READY = (
    ("worst-units",),
    ("new-causes", "--since", "7d"),
    ("drift",),
    ("register", "UNIT", "ADDRESS", "--site", "site-0007"),
    ("silent",),
    ("compare", "site-0003", "site-0004"),
)


def bus_of(number: int, transactions: int) -> tuple[captures.LineSettings, list[captures.Chunk]]:
    """A bus's day: its conversation in 24 pieces, each as dense as it was, one an hour."""
    wire = "noisy" if number % 4 == 3 else "clean"
    made = simulate(Scenario(wire, "precise", transactions=transactions, seed=number, baud=9600))
    times = np.array([chunk.t_ns for chunk in made.chunks])
    offsets = np.cumsum([len(chunk.data) for chunk in made.chunks])[:-1]
    asked = np.isin(offsets, [frame.start for frame in made.truth if frame.direction == "request"])
    pauses = np.flatnonzero(asked & (np.diff(times) > 5_000_000)) + 1
    begins = np.searchsorted(times, np.linspace(0, times[-1], 25)[1:-1])
    begins = np.unique(pauses[np.searchsorted(pauses, begins).clip(0, len(pauses) - 1)])
    free = max(0.98 * DAY_NS - times[-1], 0) / max(len(begins), 1)
    times = times + (np.searchsorted(begins, np.arange(len(times)), side="right") * free).astype(np.int64)
    return made.line, [
        captures.Chunk(t, chunk.data, chunk.port) for t, chunk in zip(times.tolist(), made.chunks, strict=True)
    ]


def make_corpus(folder: Path, sites: int, days: int, transactions: int) -> None:
    """Ring recordings, a slice a day."""
    buses = [bus_of(number, transactions) for number in range(BUSES)]
    for site in range(sites):
        here = folder / f"site-{site:04d}"
        here.mkdir(parents=True, exist_ok=True)
        for day in range(days):
            line, chunks = buses[(site + day // 10) % BUSES]
            begin = BEGIN_NS + day * DAY_NS
            stamp = f"{np.datetime64(begin, 'ns').astype('datetime64[s]')}".replace("-", "").replace(":", "")
            moved = (captures.Chunk(chunk.t_ns + begin, chunk.data, chunk.port) for chunk in chunks)
            captures.write(here / f"bus-{stamp}.000Z.mcap", moved, line=line)


def timed_batch(source: Path, lake: Path, workers: int) -> BatchResult:
    """One batch into a fresh lake."""
    shutil.rmtree(lake, ignore_errors=True)
    runner = in_this_process if workers == 1 else ProcessPool(workers)
    return run_batch(store(str(lake)), lines_of(found([str(source)])), BatchOptions(), runner)


def tell(what: str, result: BatchResult, lake: Path) -> None:
    """A line."""
    size = sum(path.stat().st_size for path in lake.rglob("*.parquet"))
    print(
        f"{what}: {result.frames:,} frames of {result.captures:,} captures in {result.seconds:.1f} s, "
        f"{result.frames / result.seconds:,.0f} frames/s, {size / result.frames:.1f} bytes a frame in the lake"
    )


def batches(folder: Path, sites: int, days: int, transactions: int) -> None:
    """One process, two, and growth."""
    source = folder / "source"
    make_corpus(source, sites, days, transactions)
    seconds: dict[int, float] = {}
    for workers in (1, 2, 1, 2):  # twice, as other work on the machine comes and goes
        result = timed_batch(source, folder / "lake", workers)
        seconds[workers] = min(seconds.get(workers, float("inf")), result.seconds)
        tell(f"{workers} processes", result, folder / "lake")
    factor = 200 * 30 * REAL_FRAMES_A_DAY / result.frames
    print(
        f"two processes are {seconds[1] / seconds[2]:.2f} times as fast; 200 sites x 30 days would be x {factor:,.0f}"
    )
    for share in (4, 2, 1):
        part = folder / "part"
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir()
        for site in sorted(source.iterdir())[: sites // share]:
            (part / site.name).symlink_to(site)
        shutil.rmtree(folder / "lake")
        files = [file for site in sorted(part.iterdir()) for file in found([str(site.resolve())])]
        result = run_batch(store(str(folder / "lake")), lines_of(files), BatchOptions(), ProcessPool(2))
        tell(f"{sites // share} sites", result, folder / "lake")


def questions(folder: Path, frames: int, days: int, transactions: int) -> None:
    """Ready questions of a lake with so many frames."""
    source, month, lake = folder / "month", folder / "monthlake", folder / "large"
    if not lake.is_dir():
        make_corpus(source, 1, days, transactions)
        made = timed_batch(source, month, 1)
        link_sites(month, lake, -(-frames // made.frames))
    tell_questions(Lake(str(lake)))
    begun = time.process_time()
    packed = compact_lake(store(str(lake)))
    worked = time.process_time() - begun
    print(f"{packed.before:,} files are {packed.after:,} now: {worked:.0f} s of CPU, {peak_mb():,.0f} MB")
    tell_questions(Lake(str(lake)))


def peak_mb() -> float:
    """The most memory of this process."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def tell_questions(large: Lake) -> None:
    """What each costs."""
    lake = Path(large.store.root)
    rows = sum(large.manifest.rows("frames").values())
    files = sum(len(large.files(table).names) for table in DATASETS)
    print(f"{rows:,} frames in {len(large.sites)} sites, {files:,} files")
    ((unit, address),) = large.sql("SELECT unit, address FROM values WHERE site = 'site-0000' LIMIT 1").fetchall()
    for words in READY:
        own = [{"UNIT": str(unit), "ADDRESS": str(address)}.get(word, word) for word in words]
        print(f"{' '.join(own)}: {ask(lake, own)}")
    for text in (
        "SELECT count(*) FROM frames WHERE NOT crc_ok",
        "SELECT unit, count(*) FROM transactions GROUP BY unit",
    ):
        print(f"{text}: {ask(lake, [text])}")


def ask(lake: Path, words: list[str]) -> str:
    """The least time of a question in a process of its own, as a user asks it, and its most memory."""
    import sys

    best = worked = float("inf")
    for _ in range(3):
        begun = time.perf_counter()
        pid = os.posix_spawn(
            sys.executable,
            [sys.executable, "-m", "analyzer.cli", "ask", str(lake), *words, "--csv"],
            os.environ,
            file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)],
        )
        _, status, usage = os.wait4(pid, 0)
        assert status == 0, words
        best = min(best, time.perf_counter() - begun)
        worked = min(worked, usage.ru_utime + usage.ru_stime)  # what a machine shared with others does not lengthen
    return f"{best:.2f} s, {worked:.2f} s of CPU, {usage.ru_maxrss / 1024:,.0f} MB"


def link_sites(month: Path, lake: Path, count: int) -> None:
    """A lake of so many sites, each with the files of the only one of `month`."""
    entries = [json.loads(path.read_text()) for path in sorted((month / "manifest").glob("*.json"))]
    target = Manifest(store(str(lake)))
    for site in range(count):
        for entry in entries:
            name = f"site-{site:04d}"
            copy = json.loads(json.dumps(entry).replace("site=site-0000", f"site={name}"))
            copy |= {"site": name, "state": None}
            for part in ("files", "tail"):
                for table, files in copy[part].items():
                    for (new, _), (old, _) in zip(files, entry[part][table], strict=True):
                        (lake / new).parent.mkdir(parents=True, exist_ok=True)
                        os.link(month / old, lake / new)
            target.add([copy])
    target.checkpoint()


def main() -> None:
    """Arguments, work, figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("batch", "questions"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sites", type=int, default=20)
    parser.add_argument("--days", type=int, default=30)
    parser.add_argument("--transactions", type=int, default=200, help="a site and day")
    parser.add_argument("--frames", type=int, default=100_000_000)
    arguments = parser.parse_args()
    if arguments.what == "batch":
        batches(arguments.folder, arguments.sites, arguments.days, arguments.transactions)
    else:
        questions(arguments.folder, arguments.frames, arguments.days, arguments.transactions)
    print(f"most memory of one process: {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:,.0f} MB")


if __name__ == "__main__":
    main()
