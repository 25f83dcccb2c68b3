"""Jobs, each measured as a process of its own: CPU seconds (user and system), wall seconds, peak memory.

A process's peak begins with that of the process that started it, so this one has to stay small: nothing that runs in
the command itself imports numpy or the tool. Rounds go through all jobs in turn, so that a loaded minute hits everyone,
and the least of all rounds counts. What a job costs on a capture of a few frames is its start-up; rates are without it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
RTUSCOPE = (sys.executable, "-c", "import sys; from analyzer.cli import main; sys.exit(main())")

Command = Sequence[str | Path]


@dataclass(frozen=True, slots=True)
class Job:
    """One tool doing one thing: `command(corpus, out)` reads the corpus in one folder and writes into another.

    The first job of a section is ours; ratios of the others are to it. `most` bounds the frames of slow ones.
    """

    section: str
    tool: str
    command: Callable[[Path, Path], Command]
    most: int | None = None
    prepare: Callable[[Path], Command] | None = None  # makes of the corpus what only this job reads; not measured


@dataclass(frozen=True, slots=True)
class Used:
    """What a process took: seconds and MiB."""

    cpu: float
    wall: float
    peak: float


class JobError(Exception):
    """A job that failed: its last words."""


@dataclass(slots=True)
class Result:
    """A job's best round: on `frames` frames, and on `few`."""

    job: Job
    frames: int
    few: int
    rounds: list[tuple[Used, Used]] = field(default_factory=list)
    failed: str = ""

    @property
    def used(self) -> Used:
        """The least of each figure."""
        return _least(used for _, used in self.rounds)

    @property
    def start(self) -> Used:
        """The same of the few frames."""
        return _least(used for used, _ in self.rounds)

    @property
    def per_million(self) -> float:
        """CPU seconds a million frames, start-up left out."""
        return (self.used.cpu - self.start.cpu) / (self.frames - self.few) * 1e6

    def to_json(self) -> dict[str, Any]:
        """The figures for a program."""
        line: dict[str, Any] = {"section": self.job.section, "tool": self.job.tool, "frames": self.frames}
        if self.failed:
            return {**line, "failed": self.failed}
        return {**line, "cpu_s_per_million": self.per_million, **asdict(self.used), "start": asdict(self.start)}


def _least(rounds: Iterable[Used]) -> Used:
    seen = list(rounds)
    return Used(*(min(getattr(used, name) for used in seen) for name in ("cpu", "wall", "peak")))


def run(command: Command, out: Path) -> Used:
    """One process, its output in the file `stdout` of the folder `out`; JobError where it fails."""
    with (out / "stdout").open("wb") as stdout, (out / "stderr").open("wb") as stderr:
        begin = time.perf_counter()
        process = subprocess.Popen([str(part) for part in command], stdout=stdout, stderr=stderr, env=environment())
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - begin
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        words = (out / "stderr").read_text(errors="replace").strip().splitlines()
        raise JobError(words[-1] if words else f"exit status {process.returncode}")
    unit = 1 << 20 if sys.platform == "darwin" else 1 << 10
    return Used(usage.ru_utime + usage.ru_stime, wall, usage.ru_maxrss / unit)


def cpu_s(pid: int) -> float:
    """Seconds of CPU that a running process and those that it waited for took so far (Linux)."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def python(module: str, *arguments: str | Path) -> Command:
    """A module of this folder as a process."""
    return (sys.executable, "-m", module, *arguments)


def environment() -> dict[str, str]:
    """Modules of this folder and of the source tree are found, and compiled once as those of installed tools are."""
    folders = (str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", ""))
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPATH": os.pathsep.join(filter(None, folders))}


def in_turn(
    results: Sequence[Result], corpora: dict[int, Path], out: Path, rounds: int, tell: Callable[[str], None]
) -> None:
    """Measures all of them `rounds` times, each on few frames and on its own number of them."""
    for number in range(rounds):
        for result in results:
            if result.failed:
                continue
            tell(f"round {number + 1} of {rounds}: {result.job.section}, {result.job.tool}")
            try:
                few, all_of_them = (
                    run(result.job.command(corpora[frames], out), out) for frames in (result.few, result.frames)
                )
            except (JobError, OSError) as error:
                result.failed = str(error)
            else:
                result.rounds.append((few, all_of_them))
