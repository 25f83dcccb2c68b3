"""A run: the corpus of a seed, tools, their answers, scores."""

from __future__ import annotations

import os
import platform
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from statistics import fmean
from typing import Any

from .items import Item, Row
from .scored import TRACKS
from .tools import AdapterError, Tool


@dataclass
class Scored:
    """What a tool made of the corpus."""

    tool: Tool
    scores: dict[str, dict[str, float]] = field(default_factory=lambda: defaultdict(dict))  # by track, by item
    speed: dict[str, float] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)

    def figure(self, track: str, only: Callable[[str], bool] = lambda _: True) -> float | None:
        """A track's score: the mean over its items; None where the tool does not claim it."""
        scores = [score for name, score in self.scores.get(track, {}).items() if only(name)]
        return fmean(scores) if scores else None

    def to_json(self, items: Sequence[Item]) -> Row:
        """The figures for a program, by track and there by source."""
        source = {item.name: item.source for item in items}
        tracks = {}
        for track, scores in self.scores.items():
            by = {one: [score for name, score in scores.items() if source[name] == one]
                  for one in dict.fromkeys(source[name] for name in scores)}  # fmt: skip
            tracks[track] = {"score": round(fmean(scores.values()), 6), "items": len(scores),
                             **{one: round(fmean(some), 6) for one, some in by.items()}}  # fmt: skip
        return {
            "tool": self.tool.name, "version": self.tool.version, "input": self.tool.given,
            "claims": list(self.tool.claims), "tracks": tracks, "speed": self.speed, "wrong": self.wrong,
        }  # fmt: skip


def score(tool: Tool, items: Iterable[Item], folder: Path, tracks: Sequence[str], jobs: int) -> Scored:
    """Puts every item to a tool for which it claims a track; the same file is put once."""
    scored = Scored(tool)
    groups: dict[tuple[str, bytes], list[Item]] = defaultdict(list)
    for item in items:
        if set(item.tracks) & set(tool.claims) & set(tracks):
            groups[item.task, item.path(folder, tool.given).read_bytes()].append(item)

    def answer(some: list[Item]) -> list[Row]:
        return tool.rows(some[0], folder, folder / "scratch" / _safe(tool.name) / some[0].name)

    with ThreadPoolExecutor(jobs) as pool:
        for some, rows in zip(groups.values(), pool.map(_caught(answer), groups.values()), strict=True):
            for item in some:
                for track in (one for one in item.tracks if one in tool.claims and one in tracks):
                    value = 0.0 if isinstance(rows, str) else TRACKS[track].score(item.truth, rows)
                    if value is not None:
                        scored.scores[track][item.name] = value
            if isinstance(rows, str):
                scored.wrong.append(rows)
    return scored


def _caught(answer: Callable[[list[Item]], list[Row]]) -> Callable[[list[Item]], list[Row] | str]:
    """An adapter that breaks the protocol scores nothing there, and that is said."""

    def caught(some: list[Item]) -> list[Row] | str:
        try:
            return answer(some)
        except AdapterError as error:
            return str(error)

    return caught


def _safe(name: str) -> str:
    return "".join(char if char.isalnum() else "-" for char in name)


def machine() -> dict[str, Any]:
    """Date, processor and system of a run."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())
    return {
        "date": f"{datetime.now(UTC):%Y-%m-%d}", "processor": f"{model}, {os.cpu_count()} cores",
        "system": f"{platform.system()} {platform.machine()}", "python": platform.python_version(),
    }  # fmt: skip
