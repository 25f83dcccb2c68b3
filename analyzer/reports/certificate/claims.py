"""Claims about a line and its units, each with its bounds and what they carry.

`pass`: the upper bound is not above what passes. `fail`: the lower bound is above what fails. Between these a claim is
`marginal`, or `unknown` where even faultless exchanges, as many as were seen, could not have passed it, or where what
speaks against it may be the tap's own doing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

from ...causes.registry import Cause
from ...tables.bins import Histogram
from ...tables.schema import bounds_of
from ..model import Counts, Report
from .bounds import quantile_ranks, share_bounds, trials_for_quantile, trials_for_share
from .limits import AcceptanceLimits, ClaimLimit
from .tally import AcceptanceTally

PASS: Final = "pass"
MARGINAL: Final = "marginal"
FAIL: Final = "fail"
UNKNOWN: Final = "unknown"
WORST_FIRST: Final = (FAIL, MARGINAL, UNKNOWN, PASS)
_LIKELY: Final = 0.5
_OF_A_TAP: Final = "lost", "damaged"  # claims that a tap's own faults can spoil
_BIN: Final = 0.005  # by which a time that is read from a histogram may be wrong


@dataclass(frozen=True, slots=True)
class Claim:
    """What is claimed of a unit (None: of the line): a share from 0 to 1, or ns.

    `value` lies between `low` and `high`; None where it is not known, or by the tap's clock known between these alone.
    `seen`: exchanges, frames or seconds that it rests on; `needed`: the fewest that can pass it; `hits`: those of a
    share that were counted.
    """

    claim: str
    unit: int | None
    limit: ClaimLimit
    value: float | None
    low: float | None
    high: float | None
    needed: int
    seen: int
    hits: int | None = None
    tap_at_fault: bool = False  # so that nothing that is missing or damaged tells of the line

    @property
    def verdict(self) -> str:
        """One of `WORST_FIRST`."""
        verdict = self._of_the_bounds()
        return UNKNOWN if self.tap_at_fault and verdict != PASS else verdict

    def _of_the_bounds(self) -> str:
        if self.low is not None and self.low > self.limit.fails:
            return FAIL
        if self.high is not None and self.high <= self.limit.passes:
            return PASS
        exceeded = self.low is not None and self.low > self.limit.passes
        return MARGINAL if exceeded or self.seen >= self.needed else UNKNOWN

    def to_json(self) -> dict[str, Any]:
        """As plain values; `pass` and `fail` are its limits."""
        return {
            "claim": self.claim,
            "unit": self.unit,
            "measure": "ns" if self.limit.timed else "share",
            "quantile": self.limit.quantile,
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "pass": self.limit.passes,
            "fail": self.limit.fails,
            "needed": self.needed,
            "seen": self.seen,
            "hits": self.hits,
            "verdict": self.verdict,
        }


def worst(verdicts: Iterable[str]) -> str:
    """The verdict of all together; unknown where there are none."""
    return min(verdicts, key=WORST_FIRST.index, default=UNKNOWN)


def claims_of(report: Report, tally: AcceptanceTally, limits: AcceptanceLimits) -> tuple[Claim, ...]:
    """All claims: those about the line first, then unit by unit."""
    garbage = {card.unit: card.garbage for card in report.cards}
    units = [
        (row.unit, _heard(row.counts, tally.open_unit == row.unit), garbage.get(row.unit, 0))
        for row in report.units
        if row.counts.requests > row.counts.broadcasts
    ]
    all_garbage = sum(each for _, _, each in units)
    total = _sum(counts for _, counts, _ in units)
    sent = total.requests + tally.damaged_requests
    damaged = all_garbage + tally.damaged_requests
    made = [
        *_shares(None, total, limits),
        _share("damaged", None, damaged, sent + total.answered + total.exceptions + all_garbage, limits),
        _response(None, tally.all_times, report, limits),
        _load(report, tally, limits),
    ]
    for unit, counts, own in units:
        made += _shares(unit, counts, limits)
        made.append(_share("damaged", unit, own, counts.answered + counts.exceptions + own, limits))
        made.append(_response(unit, tally.times.get(unit), report, limits))
    tap_at_fault = fault_of_tap(report) is not None
    return tuple(replace(claim, tap_at_fault=tap_at_fault and claim.claim in _OF_A_TAP) for claim in made)


def fault_of_tap(report: Report) -> Cause | None:
    """What a tap did to the capture, where that is more likely than not."""
    return next((each for each in report.causes if each.cause.startswith("tap-") and each.confidence >= _LIKELY), None)


def _heard(counts: Counts, last_open: bool) -> Counts:
    """Those of which something can be said: a request that the capture ends behind is not among them."""
    open_ones = int(last_open and counts.unanswered > 0)
    unanswered = counts.unanswered - open_ones
    asked = counts.answered + counts.exceptions + unanswered + counts.damaged
    return replace(counts, requests=asked, unanswered=unanswered)


def _sum(each: Iterable[Counts]) -> Counts:
    rows = list(each)
    names = ("requests", "answered", "exceptions", "unanswered", "damaged", "retries", "late")
    return Counts(**{name: sum(getattr(row, name) for row in rows) for name in names})


def _shares(unit: int | None, counts: Counts, limits: AcceptanceLimits) -> Iterator[Claim]:
    lost = counts.unanswered + counts.damaged + counts.late
    yield _share("lost", unit, lost, counts.requests, limits)
    yield _share("exceptions", unit, counts.exceptions, counts.answered + counts.exceptions, limits)
    yield _share("retries", unit, counts.retries, counts.requests, limits)


def _share(claim: str, unit: int | None, hits: int, of: int, limits: AcceptanceLimits) -> Claim:
    limit, hits = limits.of(claim, unit), min(hits, of)
    needed = trials_for_share(limit.passes, limits.confidence)
    if not of:
        return Claim(claim, unit, limit, None, None, None, needed, 0, 0)
    low, high = share_bounds(hits, of, limits.confidence)
    return Claim(claim, unit, limit, hits / of, low, high, needed, of, hits)


def _response(unit: int | None, times: Histogram | None, report: Report, limits: AcceptanceLimits) -> Claim:
    limit, off_ns = limits.of("response", unit), report.times.off_ns
    assert limit.quantile is not None
    needed = trials_for_quantile(limit.quantile, limits.confidence)
    if not times or not report.timed or off_ns is None:
        return Claim("response", unit, limit, None, None, None, needed, 0)
    count = len(times)
    ranks = quantile_ranks(count, limit.quantile, limits.confidence)
    low, high = (None if rank is None else times.quantiles((rank - 0.5) / count)[0] for rank in ranks)
    value = times.quantiles(limit.quantile)[0]
    exact = bounds_of(value, off_ns) == (value, value)
    low = None if low is None else _bounded(round(low * (1 - _BIN)), off_ns)[0]
    high = None if high is None else _bounded(round(high * (1 + _BIN)), off_ns)[1]
    return Claim("response", unit, limit, value if exact else None, low, high, needed, count)


def _bounded(ns: int, off_ns: int) -> tuple[int, int]:
    return bounds_of(ns, off_ns) or (ns, ns)


def _load(report: Report, tally: AcceptanceTally, limits: AcceptanceLimits) -> Claim:
    limit = limits.of("load", None)
    assert limit.quantile is not None
    needed = trials_for_quantile(limit.quantile, limits.confidence)
    loads = sorted(tally.loads()) if report.timed else []
    if not loads:
        return Claim("load", None, limit, None, None, None, needed, 0)
    ranks = quantile_ranks(len(loads), limit.quantile, limits.confidence)
    low, high = (None if rank is None else loads[rank - 1] for rank in ranks)
    value = loads[math.ceil(limit.quantile * len(loads)) - 1]
    return Claim("load", None, limit, value, low, high, needed, len(loads))
