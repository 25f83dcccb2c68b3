"""Time and memory by size: what is linear stays on a line, what streams stays small."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import own
from measuring import Job, JobError, python, run

FEW = 200  # frames: what is left of a run on so few is its start-up


@dataclass(frozen=True, slots=True)
class Grown:
    """A job of ours at one size."""

    tool: str
    frames: int
    per_million: float  # CPU seconds, start-up left out
    wall: float
    peak: float  # MiB


def growth(sizes: Sequence[int], folder: Path, seed: int, tell: Callable[[str], None]) -> list[Grown]:
    """Columns, MCAP and Parquet at each size; captures are made and taken away one after the other."""
    jobs = [job for job in own.jobs() if job.tool == own.COLUMNS or job.section in ("mcap", "parquet")]
    starts: dict[str, float] = {}
    found = []
    for frames in (FEW, *sizes):
        corpus = folder / f"growth-{frames}"
        tell(f"growth: a capture of {frames:,} frames")
        run(python("corpus", corpus, "--frames", str(frames), "--seed", str(seed), "--only-mcap"), folder)
        for job in jobs:
            tell(f"growth: {job.section}, {frames:,} frames")
            try:
                used = run(job.command(corpus, folder), folder)
            except JobError as error:
                raise JobError(f"{job.section} at {frames:,} frames: {error}") from error
            if frames == FEW:
                starts[job.section] = used.cpu
            else:
                rate = (used.cpu - starts[job.section]) / (frames - FEW) * 1e6
                found.append(Grown(_tool(job), frames, rate, used.wall, used.peak))
        _clear(corpus, folder)
    return sorted(found, key=lambda one: (one.tool, one.frames))


def _tool(job: Job) -> str:
    return "columns" if job.section == "columns" else f"to {job.section}"


def _clear(corpus: Path, folder: Path) -> None:
    for file in (*corpus.iterdir(), *folder.glob("frames.*")):
        file.unlink()
    corpus.rmdir()
