"""CPU time and memory: a tool's own command on a bus of many frames, less what it costs to start.

CPU time of the process and all its children, user and system; not time on the wall, for machines are shared. Of several
rounds, tools in turn, the least counts. A tool that prints fewer than half as many lines as there are frames did not do
the work, and has no figure.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from .items import Item, Row
from .tools import AdapterError, Tool, asked

_SLOW_S = 1e-4  # a frame: who needs longer is not put the many


@dataclass(frozen=True)
class Used:
    """What a run took: CPU seconds, peak MiB, lines printed."""

    cpu_s: float
    peak_mib: float
    lines: int


@dataclass(frozen=True)
class Job:
    """A command to be measured, where it runs, and how many frames it reads."""

    command: list[str]
    scratch: Path
    frames: int


def prepared(tool: Tool, item: Item, folder: Path, scratch: Path) -> Job:
    """The command that the adapter's `speed` names, which reads a file made by it; without one the adapter itself."""
    path, place = str(item.path(folder, tool.given).resolve()), scratch / item.name
    try:
        (row,) = asked(tool.command, "speed", path, scratch=place)
        command = [str(part) for part in row["command"]]
    except (AdapterError, ValueError, KeyError):
        command = [*tool.command, "bus", path]
    return Job(command, place, len(item.inputs["frames"]))


_LAUNCHER = """
import json, os, sys
out, err, *command = sys.argv[1:]
if (child := os.fork()) == 0:
    for name, stream in ((out, 1), (err, 2)):
        os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), stream)
    os.execvp(command[0], command)
_, status, usage = os.wait4(child, 0)
print(json.dumps([os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024]))
"""


def run(job: Job) -> Used:
    """Runs it once, from a small process: a peak of memory begins with that of the process that starts it."""
    said = job.scratch / "said"
    launch = [sys.executable, "-IS", "-c", _LAUNCHER, str(said), str(job.scratch / "words"), *job.command]
    done = subprocess.run(launch, capture_output=True, text=True, cwd=job.scratch, check=True)
    status, cpu_s, peak_mib = json.loads(done.stdout)
    if status:
        raise AdapterError(f"{job.command[0]}: exit status {status} in the speed track")
    with said.open("rb") as file:
        lines = sum(1 for _ in file)
    return Used(cpu_s, peak_mib, lines)


def measure(tools: list[Tool], buses: list[Item], folder: Path, rounds: int) -> dict[str, Row | str]:
    """By tool: microseconds of CPU a frame, peak MiB, seconds to start; or a sentence why there is no figure.

    Three buses, of few frames, of more and of many; a tool that is slow on one is not put the next.
    """
    found: dict[str, Row | str] = {}
    jobs: dict[str, list[Job]] = {}
    for at, tool in enumerate(tools):
        scratch = folder / "scratch" / f"speed-{at}"
        try:
            jobs[tool.name] = _chosen(tool, buses, folder, scratch)
        except AdapterError as error:
            found[tool.name] = str(error)
    used: dict[str, list[list[Used]]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, some in jobs.items():
            used[name].append([run(job) for job in some])
    return found | {name: _figures(jobs[name], each) for name, each in used.items()}


def _chosen(tool: Tool, buses: list[Item], folder: Path, scratch: Path) -> list[Job]:
    """What a tool is measured on: the fewest frames, which cost the start, and more by its speed."""
    few, more, many = buses
    first = prepared(tool, few, folder, scratch)
    start_s = run(first).cpu_s
    second = prepared(tool, more, folder, scratch)
    slow = (run(second).cpu_s - start_s) / (second.frames - first.frames) > _SLOW_S
    return [first, second if slow else prepared(tool, many, folder, scratch)]


def _figures(jobs: list[Job], rounds: list[list[Used]]) -> Row | str:
    """The least of all rounds; what the fewest frames cost is the start."""
    last = jobs[-1]
    if rounds[0][-1].lines < last.frames / 2:
        return f"{rounds[0][-1].lines} lines for {last.frames} frames in the speed track"
    cpu = [min(one[at].cpu_s for one in rounds) for at in (0, 1)]
    return {
        "cpu_us": max(cpu[1] - cpu[0], 0.0) / (last.frames - jobs[0].frames) * 1e6, "start_s": cpu[0],
        "peak_mib": min(one[-1].peak_mib for one in rounds), "frames": last.frames,
    }  # fmt: skip
