"""Our jobs, by the commands and calls that users have. The first of each section is what peers are compared with."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from measuring import RTUSCOPE, Command, Job, python
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
    if section == "findings" and not _there("analyzer.diagnosis.running"):
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
