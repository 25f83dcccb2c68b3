"""A line that is held: nobody gets through for far longer than the client ever rests, each time behind stray bytes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from ...tables.findings import Severity
from ...tables.schema import Bools
from ..bits import mean_period_s, surplus_bits
from ..evidence import Evidence
from ..exchanges import Ending
from ..exchangetable import AskedRows
from ..ledger import STRAY
from ..registry import Suspicion, Symptom, suspect
from ..samples import READ_REQUEST

_LEAST: Final = 3  # times
_FAR: Final = 5.0  # times the longest rest that is usual
_USUAL: Final = 0.98
_TIMEOUTS: Final = 2.5  # of the client
_SELDOM: Final = 0.03  # of the exchanges
_LEAST_NS: Final = 400_000_000
_HARDLY: Final = 0.01  # of the exchanges with nothing behind them
_MOSTLY: Final = 0.5
_CUT: Final = 0.7  # of the times


@suspect(
    "line-held",
    Severity.ERROR,
    blame="line",
    text="Something holds the line, {times:time|times}: after stray bytes nothing gets through for about {length:sec}, "
    "while the "
    "longest usual rest is {usual:sec}",
    share="{times:,} of {strays:,} exchanges with stray bytes, {spared:,} of {spared_of:,} other exchanges",
    deciding_test="Measure A against B when it happens: a line that is held low or high has a transmitter that is on",
    remedy="Find out which unit restarts then: one whose driver is on while its processor starts holds the line; its "
    "transceiver or the resistor at its enable pin is at fault. Disconnect units one by one only with the operator's "
    "consent",
)
def line_held(evidence: Evidence) -> Iterator[Suspicion]:
    """Long silences that hang on stray bytes before."""
    ledger, rows = evidence.ledger, evidence.ledger.table.rows
    if not ledger.timed or evidence.verdict.wait_ns > _LEAST_NS / 4 or not evidence.is_open(Symptom.FRAMING, None):
        return
    known = rows.wait >= 0
    wait, heard = rows.wait[known], rows.heard[known]
    stray, clean = heard > 0, heard == 0
    if np.count_nonzero(stray) < _LEAST or not clean.any():
        return
    usual = float(np.quantile(wait[clean], _USUAL))
    long = wait > max(_FAR * usual, _TIMEOUTS * (evidence.timeout_ns or 0.0), _LEAST_NS)
    times, strays = int(np.count_nonzero(long & stray)), int(np.count_nonzero(stray))
    others, others_of = int(np.count_nonzero(long & clean)), int(np.count_nonzero(clean))
    if times < max(_LEAST, _MOSTLY * strays) or others > _HARDLY * others_of or times > _SELDOM * len(wait):
        return  # a client that waits in vain behind each damaged answer is not held
    if np.count_nonzero(_is_cut(rows[known][long & stray])) < _CUT * times:
        return  # nor is one that gets whole answers, if damaged
    begins = rows.time[known][long & stray].tolist()
    yield Suspicion(
        (),
        surplus_bits(times, strays, max((others + 0.5) / (others_of + 1), 1e-3)),
        frozenset({(Symptom.FRAMING, None)} | {(Symptom.BEHIND, unit.unit) for unit in evidence.units}),
        {
            "times": times,
            "strays": strays,
            "spared": others,
            "spared_of": others_of,
            "length": float(np.median(wait[long & stray])) / 1e9,
            "usual": usual / 1e9,
        },
        since=begins[0],
        until=begins[-1],
        period_s=mean_period_s(begins),
    )


def _is_cut(rows: AskedRows) -> Bools:
    """Where no more was heard than strays, or what the line was held in: less than the answer that was due, or behind a
    good one a request."""
    most = np.where(rows.outcome == Ending.GARBAGE, rows.due - 1, READ_REQUEST)
    found: Bools = rows.heard <= np.maximum(most, 0) + STRAY * (rows.outcome != Ending.GARBAGE)
    return found | (rows.heard <= STRAY)
