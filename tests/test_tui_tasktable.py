"""What an engineer comes for, on a real terminal of 80x24: a row a task, its keys, what then stands there.

The keys are those of a user who knows the help; `test_tui_tasks.py` looks into the same work from inside.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import pytest

if os.name != "posix":
    pytest.skip("ptys are POSIX", allow_module_level=True)

from buses import write_meter
from emulator import Watched

import captures
from analyzer.simulation import Scenario, simulate
from captures import samples
from captures.chunks import Capture, Chunk

_DOWN: Final = "\x1b[B"
_FLOAT: Final = "01 03 04 43 67 80 00 3F A8"
_DAY_NS: Final = 86_400 * 10**9


@dataclass(frozen=True)
class Task:
    """Steps, each typed at once when what was before it stands; `shown` are patterns of lines, in their order."""

    arguments: str
    steps: tuple[str, ...]
    keys: int
    shown: tuple[str, ...]
    file: str = ""


_TASKS: Final = {
    "the sickest unit": Task("days.jsonl", ("0",), 1, (r"causes explain", r"unit +9 100% bad", r"unit +2 +75% bad")),
    "its slow answers": Task(
        "late.jsonl", (_DOWN, "=", "s", "1"), 4, (r"Filter .*unit == .*response_time >= .*ms", r"late-resp")
    ),
    "a register as a plot": Task("days.jsonl", ("5", "g", "40108\r"), 8, (r"40108.*\d+ readings",)),
    "what changed, by name": Task(
        "meter.jsonl --map meter.csv", ("1", "d"), 2, (r"changed only", r"Voltage L1 230→231.5 V")
    ),
    "exceptions of a clock's hours as a file": Task(
        "days.jsonl",
        ("T", "y 14-16\r", "/", "exc\r", "e", "\r"),
        16,
        (r"Filter .*exc", r"exception 0"),
        file="frames.csv",
    ),
    "a float of a pasted frame": Task(
        "meter.jsonl", ("8", f"\x1b[200~{_FLOAT}\x1b[201~"), 2, (r"f32 ABCD +231\.5", r"Read Holding")
    ),
    "two captures": Task(
        "meter.jsonl",
        ("A", "other.jsonl\r"),
        13,
        (r"beside other\.jsonl", r"moved +value +unit 1, 40001.*was 118\.5.*now 231\.5"),
    ),
    "a comment in the report": Task(
        "meter.jsonl", (";", "looked at\r", "7"), 12, (r"bookmarks", r"frame 1, unit 1.*looked at")
    ),
    "a value found and shown": Task(
        "meter.jsonl --map meter.csv", ("1", "f", "231.5\r"), 8, (r"frame 7", r"40001 Voltage L1 231\.5 V, was 230")
    ),
    "back after a jump": Task("days.jsonl", ("2", "g", "1000\r", "-"), 8, (r"─frame 1─",)),
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two days of a troubled bus, heard for a while every two hours; late answers; a meter, and it on another day."""
    folder = tmp_path_factory.mktemp("tasks")
    troubled = captures.open(samples.path("troubled.jsonl"))
    heard = list(troubled.chunks())
    today = int(datetime.now(UTC).replace(hour=0, minute=0, second=0, microsecond=0).timestamp()) * 10**9
    begin = today - 2 * _DAY_NS - heard[0].t_ns
    chunks = [Chunk(begin + hour * 3600 * 10**9 + c.t_ns, c.data, c.port) for hour in range(0, 48, 2) for c in heard]
    captures.write(folder / "days.jsonl", Capture.of(troubled.line, chunks))
    late = simulate(Scenario("clean", "irq", transactions=400, seed=4, defect="late-response"))
    captures.write(folder / "late.jsonl", Capture.of(late.line, late.chunks))
    write_meter(folder / "meter.jsonl", [230.0, 230.0, 230.0, 231.5, 231.5, 231.5])
    write_meter(folder / "other.jsonl", [118.25, 118.25, 118.5])
    (folder / "meter.csv").write_text("address,name,type,unit\n40001,Voltage L1,float32,V\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", _TASKS)
def test_a_task_ends_in_sight_for_few_keys(name: str, folder: Path) -> None:
    task = _TASKS[name]
    assert sum(_keys(step) for step in task.steps) <= task.keys
    with Watched("open", *task.arguments.split(), cwd=folder, TZ="UTC") as terminal:
        terminal.until("Home").until(lambda: "reading" not in terminal.shown()).settle(1.0)
        for step in task.steps:
            terminal.press(step)
        terminal.until(lambda: _stands(task.shown, terminal.shown()), 30)
        if task.file:
            terminal.until(lambda: (folder / task.file).exists())
            assert len((folder / task.file).read_text(encoding="utf-8").splitlines()) > 1


def _stands(patterns: tuple[str, ...], shown: str) -> bool:
    return re.search(".*?".join(patterns), shown, re.S) is not None


def _keys(step: str) -> int:
    """A paste and an arrow are one key."""
    return 1 if step.startswith("\x1b") else len(step)
