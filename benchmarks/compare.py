"""This tool and its peers side by side on the same frames: time, memory, accuracy, growth, hard data, goals.

    python benchmarks/compare.py                 200,000 frames, growth to a million: some minutes
    python benchmarks/compare.py --quick         2,000 frames, once: does everything run?
    python benchmarks/compare.py --full          a million frames, growth to ten million
    python benchmarks/compare.py --bus plant     a healthy bus whose values stand, in place of one whose values drift

Prints Markdown, ready to paste. Peers that are not installed are said and left out. Needs Linux, macOS or the like.
Exit status: 0 done, 1 where a job of ours failed (or, with --strict, a goal was missed).
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import own
import peers
import report
from goals import Goal, goals
from measuring import HERE, RTUSCOPE, Job, JobError, Result, Used, in_turn, python, run
from own import FEW, Grown, growth


@dataclass(slots=True)
class Comparison:
    """All that one run measured."""

    machine: dict[str, str]
    corpus: dict[str, Any]
    rounds: int
    results: list[Result] = field(default_factory=list)
    absent: dict[str, str] = field(default_factory=dict)  # tool or section: why it is not there
    accuracy: list[tuple[peers.Accuracy, dict[str, float]]] = field(default_factory=list)
    starts: tuple[Used, Used] = (Used(0, 0, 0), Used(0, 0, 0))  # bare Python, `rtuscope parse`
    hard: dict[str, float] = field(default_factory=dict)
    grown: list[Grown] = field(default_factory=list)

    @property
    def goals(self) -> list[Goal]:
        return goals(self.results, self.hard, self.starts, self.grown)

    def to_json(self) -> dict[str, Any]:
        """The figures for a program."""
        return {
            **{key: getattr(self, key) for key in ("machine", "corpus", "rounds", "absent", "hard")},
            "jobs": [result.to_json() for result in self.results],
            "accuracy": [{"tool": one.tool, **figures} for one, figures in self.accuracy],
            "starts": {"python": asdict(self.starts[0]), "parse": asdict(self.starts[1])},
            "growth": [asdict(one) for one in self.grown],
            "goals": [asdict(goal) for goal in self.goals],
        }


def compare(given: argparse.Namespace, folder: Path) -> Comparison:
    """Everything in order: corpora, jobs in turn, accuracy, start, hard data, growth."""
    corpora: dict[int, Path] = {}

    def corpus(frames: int) -> Path:
        if frames not in corpora:
            _tell(f"making a corpus of {frames:,} frames")
            corpora[frames] = folder / f"{given.bus}-{frames}-seed-{given.seed}"
            bus = ("--frames", str(frames), "--seed", str(given.seed), "--bus", given.bus)
            run(python("corpus", corpora[frames], *bus), folder)
        return corpora[frames]

    about = json.loads((corpus(given.frames) / "about.json").read_text())
    found = Comparison(about_machine(), about, given.rounds)
    jobs = [*own.jobs(), *_peer_jobs(found)]
    found.absent |= {title: why for key, title in own.SECTIONS.items() if (why := own.why_not(key))}
    for job in jobs:
        if not given.only or job.section in given.only:
            frames = min(given.frames, job.most or given.frames)
            found.results.append(Result(job, frames, FEW))
            for size in (FEW, frames):
                if job.prepare is not None:
                    run(job.prepare(corpus(size)), folder)
                corpus(size)
    in_turn(found.results, corpora, folder, given.rounds, _tell)
    if given.only:
        return found
    for one in _accuracies():
        _tell(f"accuracy: {one.tool}")
        run(one.command(corpora[given.frames], folder), folder)
        found.accuracy.append((one, json.loads(_said(folder))))
    found.starts = _starts(folder, 3 if given.quick else 20)
    _tell("hard data")
    run(python("workers.hard", str(1 << (13 if given.quick else 18))), folder)
    found.hard = json.loads(_said(folder))
    found.grown = growth(given.growth, folder, given.seed, given.bus, _tell)
    return found


def _peer_jobs(found: Comparison) -> list[Job]:
    jobs = []
    for peer in peers.all_of_them():
        if why := peer.absent():
            found.absent[peer.__name__.split(".")[-1]] = why
        else:
            jobs += peer.JOBS
    return jobs


def _accuracies() -> list[peers.Accuracy]:
    return own.ACCURACY + [one for peer in peers.all_of_them() if peer.absent() is None for one in peer.ACCURACY]


def _said(folder: Path) -> str:
    return (folder / "stdout").read_text().splitlines()[-1]


def _starts(folder: Path, times: int) -> tuple[Used, Used]:
    """Bare Python and `rtuscope parse`, in turn: the least of each."""
    commands = ((sys.executable, "-c", "pass"), (*RTUSCOPE, "parse", "11", "03", "00", "6B", "00", "03", "76", "87"))
    rounds = [[run(command, folder) for command in commands] for _ in range(times)]
    bare, parse = (min(used, key=lambda one: one.wall) for used in zip(*rounds, strict=True))
    return bare, parse


def _tell(words: str) -> None:
    if sys.stderr.isatty():
        print(f"\r\x1b[K{words}", end="", file=sys.stderr, flush=True)


def _arguments(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="this tool and its peers side by side on the same frames")
    parser.add_argument("--frames", type=int, help="frames of the corpus (default 200,000)")
    parser.add_argument("--rounds", type=int, help="times that each job runs; the least counts (default 3)")
    parser.add_argument("--growth", type=int, help="largest capture of the growth table (default a million; 0: none)")
    parser.add_argument("--seed", type=int, default=1, help="another bus of the same kind")
    parser.add_argument("--bus", choices=("drifts", "plant"), default="drifts", help="what the bus is like")
    parser.add_argument("--quick", action="store_true", help="2,000 frames, one round, no growth")
    parser.add_argument("--full", action="store_true", help="a million frames, growth to ten million")
    parser.add_argument("--only", nargs="+", choices=tuple(own.SECTIONS), help="these sections of the table alone")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures for a program too")
    parser.add_argument("--folder", type=Path, help="where corpora are made and kept (default: nowhere)")
    parser.add_argument("--strict", action="store_true", help="exit with 1 where a goal is missed")
    given = parser.parse_args(arguments)
    usual = (2_000, 1, 0) if given.quick else (1_000_000, 3, 10_000_000) if given.full else (200_000, 3, 1_000_000)
    for name, value in zip(("frames", "rounds", "growth"), usual, strict=True):
        if getattr(given, name) is None:
            setattr(given, name, value)
    if given.frames <= FEW or given.rounds < 1:
        parser.error(f"more than {FEW} frames and at least one round are needed")
    given.growth = [size for size in (100_000, 1_000_000, 10_000_000, 100_000_000) if size <= given.growth]
    return given


def main(arguments: list[str]) -> int:
    given = _arguments(arguments)
    sys.path.insert(1, str(HERE.parent))  # the source tree needs not be installed
    try:
        with tempfile.TemporaryDirectory() as temporary:
            folder = given.folder or Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            found = compare(given, folder)
    except JobError as error:
        print(f"compare: {error}", file=sys.stderr)
        return 1
    _tell("")
    print(report.markdown(found))
    if given.json is not None:
        given.json.write_text(json.dumps(found.to_json(), indent=1) + "\n")
    failed = [result for result in found.results if result.failed and result.job in own.jobs()]
    missed = given.strict and not given.only and any(goal.reached is False for goal in found.goals)
    return 1 if failed or missed else 0


def about_machine() -> dict[str, str]:
    """Date, processor, system, and versions of what runs."""
    return {
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "processor": f"{_processor()}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": ", ".join(_versions()),
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def _versions() -> list[str]:
    from analyzer.version import __version__

    found = [f"rtuscope {__version__}"]
    found += [peers.version(package) for package in ("numpy", "orjson", "pyarrow") if peers.missing(package) is None]
    return found + [peer.version() for peer in peers.all_of_them() if peer.absent() is None]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
