"""Exchanges as `analyzer.requests` takes them: what each request got."""

from __future__ import annotations

from typing import Final

import numpy as np

from dissectors.limits import OVERHEAD

from ..requests.history import Got, RequestHistory
from ..tables.schema import Kind
from .exchanges import Ending, Stretch

_WORDS: Final = (3, 4)
_COUNT: Final = 2  # bytes of an answer's PDU before its registers
_TOLD: Final = (Ending.OK, Ending.EXCEPTION, Ending.SILENT, Ending.GARBAGE)


def enter_requests(history: RequestHistory, stretch: Stretch) -> None:
    """The exchanges of a stretch, those of which nothing is known left out."""
    exchanges = stretch.exchanges
    outcome = exchanges.outcome
    got = np.where(outcome == Ending.EXCEPTION, exchanges.exception.astype(np.int64), int(Got.ANSWER))
    got[outcome == Ending.SILENT] = Got.SILENCE
    got[(outcome == Ending.SILENT) & (exchanges.late + exchanges.strays > 0)] = Got.DAMAGE  # another's answer met it
    got[outcome == Ending.GARBAGE] = Got.DAMAGE
    told_apart = exchanges.answer >= 0
    told_apart[told_apart] = ~stretch.table.rows.unsure[exchanges.answer[told_apart]]
    got[(got == Got.ANSWER) & ~told_apart] = Got.DAMAGE
    odd = (outcome == Ending.GARBAGE) & (exchanges.strays > 0) & np.isin(exchanges.function, _WORDS)
    for i in odd.nonzero()[0].tolist():
        if _is_half(stretch, i):
            got[i] = Got.HALF
    told = np.isin(outcome, _TOLD) & (exchanges.unit > 0)
    history.feed(exchanges.unit[told], exchanges.poll[told], got[told], exchanges.repeats[told])


def _is_half(stretch: Stretch, i: int) -> bool:
    """Whether a right answer came with as many bytes as registers were asked for."""
    exchanges, rows = stretch.exchanges, stretch.table.rows
    due = _COUNT + OVERHEAD + (int(exchanges.poll[i]) & 0xFFFF)
    return any(
        rows.kind[row] == Kind.RESPONSE
        and rows.check[row]
        and rows.length[row] == due
        and rows.unit[row] == exchanges.unit[i]
        and rows.function[row] == exchanges.function[i]
        for row in stretch.rows_of(i)
    )
