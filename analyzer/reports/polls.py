"""The client's list as the bus shows it: a row a poll."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from ..causes.exchanges import Ending
from ..causes.ledger import Ledger
from .model import PollRow

_RECURS: Final = 3  # requests that make a poll of it
_MOST: Final = 1000
_MOST_JOINED: Final = {1: 2000, 2: 2000, 3: 125, 4: 125}  # of one request, by the specification
_GAP: Final = {1: 16, 2: 16, 3: 4, 4: 4}  # things between, that one request would ask for in vain
_AROUND: Final = 13  # bytes of a request, and around what an answer holds
_ALIKE: Final = 0.1


def poll_rows(ledger: Ledger) -> tuple[PollRow, ...]:
    """What is asked for again and again, what is asked most first."""
    rows = []
    for poll in ledger.polls.polls():
        if poll.asked < _RECURS:
            continue
        period = jitter = None
        if ledger.timed and len(poll.intervals):
            period = int(np.median(poll.intervals))
            jitter = int(np.quantile(np.abs(poll.intervals - period), 0.9))
        rows.append(
            PollRow(
                poll.unit,
                poll.function,
                poll.address,
                poll.quantity,
                poll.asked,
                poll.count(Ending.OK),
                poll.count(Ending.EXCEPTION),
                poll.count(Ending.SILENT),
                poll.count(Ending.GARBAGE),
                period,
                jitter,
            )
        )
    rows = _joined(rows)
    rows.sort(key=lambda row: (-row.asked, row.unit, row.function, row.address))
    return tuple(rows[:_MOST])


def _joined(rows: list[PollRow]) -> list[PollRow]:
    """The same, with what one request could ask for as two do now: of one unit and function, side by side, as often."""
    ordered = sorted(rows, key=lambda row: (row.unit, row.function, row.address, row.quantity))
    joined = list(ordered)
    for i, (one, two) in enumerate(pairwise(ordered)):
        most = _MOST_JOINED.get(one.function)
        if most is None or (one.unit, one.function) != (two.unit, two.function) or not (one.ok and two.ok):
            continue
        gap, end = two.address - one.address - one.quantity, max(one.address + one.quantity, two.address + two.quantity)
        if gap > _GAP[one.function] or end - one.address > most or not _as_often(one, two):
            continue
        saved = _AROUND - max(gap, 0) * 2 if one.function in (3, 4) else _AROUND - max(gap, 0) // 8
        joined[i] = replace(one, joins=two.address, saves_bytes=saved)
    return joined


def _as_often(one: PollRow, two: PollRow) -> bool:
    if one.period_ns is None or two.period_ns is None:
        return 0.8 < one.asked / two.asked < 1.25
    return abs(one.period_ns - two.period_ns) <= _ALIKE * max(one.period_ns, two.period_ns)
