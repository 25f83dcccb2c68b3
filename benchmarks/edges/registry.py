"""The table of classes: how each is made, on which taps."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from edges.wires import Bus

Edge = Callable[[Random], tuple[Bus, dict[str, str]]]
EDGES: dict[str, tuple[Edge, tuple[str, ...], int]] = {}  # class: how it is made, on which taps, captures a seed
ALL_TAPS = ("precise", "irq", "ftdi16", "untimed")


def edge(name: str, taps: tuple[str, ...] = ALL_TAPS, count: int = 1) -> Callable[[Edge], Edge]:
    """Registers a class of edges: `count` captures of it a seed and tap."""

    def register(make: Edge) -> Edge:
        EDGES[name] = make, taps, count
        return make

    return register
