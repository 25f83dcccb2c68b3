"""Our jobs, by the commands and calls that users have; and what they take by size.

The first job of each section is what peers are compared with. By size, what is linear stays on a line, what streams
stays small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from measuring import RTUSCOPE, Command, Job, JobError, python, run
from peers import Accuracy

SECTIONS = {
    "columns": "Frames, direction, pairs, decoded values",
    "findings": "Frames, direction, pairs, findings",
    "mcap": "To MCAP: raw chunks, frames, transactions, values, findings",
    "parquet": "To Parquet",
    "jsonl": "To JSON lines, every field annotated with its offset",
    "csv": "To CSV",
    "pcapng": "To pcapng",
}
EXPORTS = ("mcap", "parquet", "jsonl", "csv", "pcapng")
COLUMNS, PAIRS, FINDINGS = "rtuscope, from MCAP", "rtuscope, without findings", "rtuscope"
REPORT = "rtuscope report, causes too"


def _columns(name: str, *options: str) -> Callable[[Path, Path], Command]:
    return lambda corpus, _: python("workers.columns", corpus / name, *options)


def _export(suffix: str) -> Callable[[Path, Path], Command]:
    return lambda corpus, out: (*RTUSCOPE, "export", corpus / "bus.mcap", "-o", out / f"frames.{suffix}", "--overwrite")


def _there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # of a package that it would be in
        return False


def why_not(section: str) -> str | None:
    """What a section of ours lacks here, if anything."""
    if section == "findings" and not _there("analyzer.diagnosis.judge"):
        return "this version has no findings"
    if section in EXPORTS and not _there(f"analyzer.exports.targets.{section}"):
        return f"this version has no export to {section}"
    if section == "parquet" and not _there("pyarrow"):
        return "the package pyarrow is not installed"
    return None


def jobs() -> list[Job]:
    """All that can run here."""
    found = [
        Job("columns", COLUMNS, _columns("bus.mcap")),
        Job("columns", "rtuscope, from jsonl", _columns("bus.jsonl")),
        Job("columns", "rtuscope, reads of 16 bytes", _columns("fifo.mcap")),
        Job("columns", "rtuscope, without values", _columns("bus.mcap", "--only", "transactions")),
        Job("columns", "rtuscope, frames alone", _columns("bus.mcap", "--only", "frames")),
        Job("findings", FINDINGS, _columns("bus.mcap", "--only", "findings")),
        Job("findings", PAIRS, _columns("bus.mcap", "--only", "transactions")),
        Job("findings", REPORT, lambda corpus, _: (*RTUSCOPE, "report", corpus / "bus.mcap")),
        *(Job(section, "rtuscope", _export(section)) for section in EXPORTS),
    ]
    return [job for job in found if why_not(job.section) is None]


ACCURACY = [
    Accuracy(
        f"rtuscope, {words}",
        lambda corpus, _, name=name: python("workers.accuracy", corpus, name),  # type: ignore[misc]
        "all frames; right is right in start and length, direction, and the request answered",
    )
    for words, name in (("a read a frame", "bus.mcap"), ("reads of 16 bytes", "fifo.mcap"))
]


FEW = 200  # frames: what is left of a run on so few is its start-up


@dataclass(frozen=True, slots=True)
class Grown:
    """A job of ours at one size."""

    tool: str
    frames: int
    per_million: float  # CPU seconds, start-up left out
    wall: float
    peak: float  # MiB


def growth(sizes: Sequence[int], folder: Path, seed: int, bus: str, tell: Callable[[str], None]) -> list[Grown]:
    """Columns, MCAP and Parquet at each size; captures are made and taken away one after the other."""
    grown = [job for job in jobs() if job.tool == COLUMNS or job.section in ("mcap", "parquet")]
    starts: dict[str, float] = {}
    found = []
    for frames in (FEW, *sizes):
        corpus = folder / f"growth-{frames}"
        tell(f"growth: a capture of {frames:,} frames")
        made = ("--frames", str(frames), "--seed", str(seed), "--bus", bus, "--only-mcap")
        run(python("corpus", corpus, *made), folder)
        for job in grown:
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
