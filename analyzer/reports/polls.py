"""The client's list as the bus shows it: a row a poll."""

from __future__ import annotations

from typing import Final

import numpy as np

from ..causes.exchanges import Ending
from ..causes.ledger import Ledger
from .model import PollRow

_RECURS: Final = 3  # requests that make a poll of it
_MOST: Final = 1000


def poll_rows(ledger: Ledger) -> tuple[PollRow, ...]:
    """What is asked for again and again, what is asked most first."""
    made = []
    for poll in ledger.polls.polls():
        if poll.asked < _RECURS:
            continue
        period = jitter = None
        if ledger.timed and len(poll.intervals):
            period = int(np.median(poll.intervals))
            jitter = int(np.quantile(np.abs(poll.intervals - period), 0.9))
        made.append(
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
    made.sort(key=lambda row: (-row.asked, row.unit, row.function, row.address))
    return tuple(made[:_MOST])
