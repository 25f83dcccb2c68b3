"""Texts: what people paste. A row is a frame with a right check value: `hex` and `direction`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from ..items import Row


def check(row: Row, _: int) -> str:
    """What is wrong with a row, "" if nothing."""
    told = row.get("hex")
    if not isinstance(told, str) or len(told) % 2 or set(told) - set("0123456789abcdef"):
        return "hex must be lower case digits, two a byte"
    return (
        "" if row.get("direction") in (None, "request", "response") else "direction must be request, response or null"
    )


def texts(truth: Row, rows: Sequence[Row]) -> float:
    """F1 of the frames of a text, each once, with its direction; 1 for no row where a text holds no frame."""
    wanted = Counter((one["hex"], one["direction"]) for one in truth["frames"])
    given = Counter((row["hex"], row.get("direction")) for row in rows)
    total = wanted.total() + given.total()
    return 2 * (wanted & given).total() / total if total else 1.0
