"""The account of a campaign of fuzz: a JSON object a line for each process that ran, so that a later run goes on there.

`target`, `seed`, `first` (number of the first input), `count`, `revision` of the source, `cpu_s`, `slowest` (CPU s of
one input), `megabytes` (most of the process), `failures`. Lines are only ever added.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class Entry:
    """What one process did."""

    target: str
    seed: int
    first: int
    count: int
    revision: str
    cpu_s: float
    slowest: float
    megabytes: float
    failures: list[str] = field(default_factory=list)


@cache
def revision() -> str:
    """The commit of the source, `+` where something was changed since."""
    try:
        place = Path(__file__).parent
        said = subprocess.run(
            ["git", "describe", "--always", "--dirty=+"], capture_output=True, text=True, check=True, cwd=place
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return said.stdout.strip()


def entries(path: Path) -> list[Entry]:
    """All that was done; a line that was cut is left out."""
    if not path.exists():
        return []
    found = []
    for line in path.read_text().splitlines():
        with suppress(ValueError):
            found.append(Entry(**json.loads(line)))
    return found


def add(path: Path, entry: Entry) -> None:
    """One more line; one before it that was cut ends first."""
    cut = path.exists() and path.read_bytes()[-1:] not in (b"", b"\n")
    with path.open("ab") as file:
        file.write((b"\n" if cut else b"") + json.dumps(asdict(entry)).encode() + b"\n")


def reached(done: Iterable[Entry], target: str, seed: int) -> int:
    """The number of the first input of a target and a seed that was not tried."""
    ends = (entry.first + entry.count for entry in done if (entry.target, entry.seed) == (target, seed))
    return max(ends, default=0)


def told(done: Iterable[Entry]) -> Iterator[str]:
    """The account in lines: by target, and in all."""
    by_target: dict[str, list[Entry]] = {}
    for entry in done:
        by_target.setdefault(entry.target, []).append(entry)
    for target, mine in sorted(by_target.items()):
        yield f"  {target:<22} {_line(mine)}"
    every = [entry for mine in by_target.values() for entry in mine]
    seeds = sorted({entry.seed for entry in every})
    yield f"  {'all':<22} {_line(every)}; seeds {', '.join(map(str, seeds))}; revisions {_revisions(every)}"


def _line(mine: list[Entry]) -> str:
    tried, spent = sum(entry.count for entry in mine), sum(entry.cpu_s for entry in mine)
    slowest, most = max(entry.slowest for entry in mine), max(entry.megabytes for entry in mine)
    failures = sum(len(entry.failures) for entry in mine)
    return (
        f"{tried:>11,} inputs, {tried / max(spent, 1e-9):>6,.0f} a CPU second, slowest {slowest:.2f} s, "
        f"{most:.0f} MB, {failures} failures"
    )


def _revisions(mine: list[Entry]) -> str:
    found = list(dict.fromkeys(entry.revision for entry in mine))
    return " ".join(found) if len(found) <= 4 else f"{found[0]} ... {found[-1]}, {len(found)} in all"
