"""A task: lines into files of a lake. A pure function, so it may run anywhere, and twice.

Lines with little in them are a task together: what they make is written as packs at once, so that a small capture does
not pay for files of its own.

Its files have names that no other run gives; until the manifest names them they are nobody's. So a worker that dies, a
scheduler that tries again and two that do the same leave nothing in the lake but waste, which the next batch removes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from ..languages import telling
from .linetask import LineTask, TaskPlace, contents_taken, line_entry
from .packs import new_packs
from .stores import store

TOGETHER: Final = 16  # lines with little in them: what a task costs beside them is nothing then
LEAST_TASKS: Final = 8  # that many small ones are made into
A_SMALL_LINE: Final = 1 << 17  # bytes of captures


@dataclass(frozen=True, slots=True)
class LinesTask:
    """Lines to be taken in together, or one."""

    lines: tuple[LineTask, ...]

    @property
    def key(self) -> tuple[str, str]:
        """What tells it from other tasks."""
        return self.lines[0].site, self.lines[0].line

    def run(self) -> dict[str, Any]:
        """Do it: what the manifest is to say of each of `lines`, or what was wrong with it, and of their `packs`.

        Rows are in English, wherever it runs. Raises LakeWriteError where no packs can be written.
        """
        place = TaskPlace(store(self.lines[0].lake), [] if len(self.lines) > 1 else None)
        outcomes: list[dict[str, Any] | Exception] = []
        taken: dict[str, set[str]] = defaultdict(set)  # contents of captures, by site
        with telling("en"):
            for line in self.lines:
                outcome = _outcome(line.knowing(taken[line.site]), place)
                if not isinstance(outcome, Exception):
                    taken[line.site].update(contents_taken(outcome))
                outcomes.append(outcome)
        return {"lines": outcomes, "packs": new_packs(place.store, place.waiting or ())}


def line_tasks_together(lines: Sequence[LineTask]) -> list[LinesTask]:
    """Each of these in one task, small ones together; but tasks enough for as many to be at work."""
    small = [line for line in lines if line.size <= A_SMALL_LINE]
    together = min(-(-len(small) // LEAST_TASKS), TOGETHER)
    groups = [small[first : first + together] for first in range(0, len(small), max(together, 1))]
    return [LinesTask((line,)) for line in lines if line.size > A_SMALL_LINE] + [LinesTask((*each,)) for each in groups]


def _outcome(task: LineTask, place: TaskPlace) -> dict[str, Any] | Exception:
    before = len(place.waiting or ())
    try:
        return line_entry(task, place)
    except Exception as error:
        if place.waiting:
            del place.waiting[before:]
        return error
