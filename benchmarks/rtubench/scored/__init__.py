"""How answers are scored, a file a task: each track a function of an item's truth and a tool's rows.

`TRACKS` names the tracks in the order of the table. A score is from 0 to 1, a track's figure the mean over its items.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..items import Row
from . import bus, causes, registers, texts


class Track(NamedTuple):
    """A track: which task its rows come from, and its score for an item."""

    task: str
    score: Callable[[Row, Sequence[Row]], float | None]  # None where the item has nothing that counts


TRACKS = {
    "frames": Track("bus", bus.frames),
    "directions": Track("bus", bus.directions),
    "pairs": Track("bus", bus.pairs),
    "damage": Track("bus", bus.damage),
    "causes": Track("causes", causes.causes),
    "texts": Track("text", texts.texts),
    "registers": Track("registers", registers.registers),
}
CHECKS = {"bus": bus.check, "causes": causes.check, "text": texts.check, "registers": registers.check}
