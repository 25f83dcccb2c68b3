"""Numbers as blocks in eighths of a line: small lines of them beside words, and what taller plots are made of."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from .paint import StyledText

EIGHTHS: Final = " ▁▂▃▄▅▆▇█"  # of a cell, from none to all


def sparkline(values: NDArray[np.float64], width: int) -> str:
    """Values as one line of blocks from 0 to the most, joined to fit; a space where there is none."""
    if not len(values) or width < 1 or np.isnan(values).all():
        return ""
    groups = [group[~np.isnan(group)] for group in np.array_split(values, min(width, len(values)))]
    means = [float(group.mean()) if len(group) else None for group in groups]
    high = max(mean for mean in means if mean is not None)
    scale = (len(EIGHTHS) - 2) / high if high > 0 else 0.0
    return "".join(" " if mean is None else EIGHTHS[1 + round(max(0.0, mean) * scale)] for mean in means)


def trend(values: NDArray[np.float64], width: int) -> StyledText:
    """The same from the least to the most, in exactly this many columns; a line where they stand still."""
    line, kind = "", "accent"
    if not np.isnan(values).all():
        line = sparkline(values - np.nanmin(values), width)
        if np.nanmin(values) == np.nanmax(values):
            line, kind = "".join("─" if block.strip() else " " for block in line), "dim"
    return StyledText(f"{line:<{width}}", kind)
