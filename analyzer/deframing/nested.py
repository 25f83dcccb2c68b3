"""Frames in a frame: what is forced inside one that has lost.

A payload may hold whole valid frames. The outer one competes with them where it begins and nowhere else: once that
place is decided otherwise, nothing but the inner ones is left, and they may tile the bytes without a rival. So outer
intervals are cut down here to their first byte, the one place where they still count.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .candidates import Candidates
from .rules import Bytes, Mask
from .runs import Runs, runs_of


def inner_runs(found: Candidates, data: Bytes, known: int) -> Runs | None:
    """The same as `runs_of`, of which clean ones may be taken; None where no interval holds another."""
    outer = _holding(found)
    if not outer.any():
        return None
    return runs_of(replace(found, end=np.where(outer, found.start + 1, found.end)), data, known, rivals=outer)


def _holding(found: Candidates) -> Mask:
    """Which candidates hold a whole other one that begins later."""
    least = np.append(np.minimum.accumulate(found.end[::-1])[::-1], np.iinfo(np.intp).max)  # of ends, from each one on
    holding: Mask = least[np.searchsorted(found.start, found.start, side="right")] <= found.end
    return holding
