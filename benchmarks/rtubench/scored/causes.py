"""Causes: what is wrong with a line, in the bench's own words, the likeliest first.

A row: `cause`, one of WORDS, and `units`, the addresses at fault (empty where it is none in particular). Nothing wrong:
no row. Only the first row counts.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..items import Row

WORDS = {
    "unit-silent": "a unit does not answer, from the beginning or from a moment on",
    "unit-restarts": "a unit is away for a while, again and again",
    "unit-busy": "a unit refuses with code 6, busy",
    "missing-registers": "the client asks for what a unit does not have: it refuses with code 2",
    "timeout-too-short": "the client gives up before the unit answers",
    "two-clients": "two clients ask on one line",
    "same-address": "two units have the same address",
    "line-noise": "the line damages frames of everybody",
    "unit-noise": "frames of one unit are damaged",
    "driver-late": "a unit switches its driver on too late: the beginnings of its answers are missing",
    "driver-early": "a unit switches its driver off too early: the ends of its answers are missing",
    "unit-settings": "a unit speaks at another rate or parity than the others",
}


def check(row: Row, _: int) -> str:
    """What is wrong with a row, "" if nothing. Words that the bench does not have are allowed: they are wrong."""
    units = row.get("units")
    if not isinstance(row.get("cause"), str):
        return "cause must be a word"
    if not isinstance(units, list) or not all(type(unit) is int for unit in units):
        return "units must be a list of addresses"
    return ""


def causes(truth: Row, rows: Sequence[Row]) -> float:
    """1 where the first row is a right word and names the units at fault; on a healthy line, where there is no row."""
    if not truth["causes"]:
        return float(not rows)
    if not rows:
        return 0.0
    units = not truth["units"] or set(rows[0]["units"]) == set(truth["units"])
    return float(rows[0]["cause"] in truth["causes"] and units)
