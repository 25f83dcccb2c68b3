"""What a list of elements comes to."""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any


def mean_of(values: list[Any]) -> float:
    """The mean; nan of none."""
    return sum(values) / len(values) if values else nan


def extreme(choose: Callable[..., Any], initial: Any) -> Callable[[list[Any]], Any]:
    """The least or the greatest, `initial` among them if it is given; nan where any is."""

    def fold(values: list[Any]) -> Any:
        unknown = next((each for each in values if each != each), None)
        return unknown or choose(values if initial is None else [*values, initial])

    return fold
