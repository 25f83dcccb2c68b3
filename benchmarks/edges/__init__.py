"""The edges that real lines have every day: captures with known truth, class by class (`EDGES`)."""

from __future__ import annotations

from edges import lines, streams  # noqa: F401 - each registers its classes
from edges.registry import EDGES

__all__ = ["EDGES"]
