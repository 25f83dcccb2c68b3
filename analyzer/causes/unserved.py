"""Why a unit does not serve some requests (`analyzer.requests`), as causes say it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from ..requests.asked import Request, request_of
from ..requests.got import visits_of
from ..requests.reasons import ECHOED, Unserved, unserved
from .evidence import Evidence
from .exchanges import Ending
from .rawbytes import is_in_ascii
from .repeats import answers_like_requests
from .signatures import known_header
from .unitledger import UnitLedger

_LATE: Final = 0.1  # of the silent requests: then answers do come
_MOSTLY: Final = 0.9
_BEGIN: Final = 3  # bytes of an answer that say whose it is, and to what
_SURE: Final = 0.9
SHOWN: Final = 3  # requests that a sentence writes out


def unserved_of(evidence: Evidence, unit: UnitLedger, *, silent: bool) -> Unserved | None:
    """Why requests to a unit fail, those that stay silent or those that are refused; None where nothing tells."""
    polls = evidence.ledger.polls

    def read(number: int) -> Request | None:
        raw = polls.request_of(number)
        if raw is None:
            return None
        if is_in_ascii(raw):
            return request_of(unit.unit, bytes.fromhex(raw[3:-4].decode("ascii")))
        return request_of(unit.unit, raw[1:-2])

    known = evidence.ledger.reasons
    if unit.unit not in known:
        rows = evidence.rows(unit.unit)
        visits = visits_of(rows.poll, rows.got.astype(np.int64), rows.next_same)
        known[unit.unit] = unserved(unit.unit, visits, read)
    found = next((each for each in known[unit.unit] if each.is_silent == silent), None)
    return None if found is not None and silent and _comes_late(evidence, unit, found) else found


def _comes_late(evidence: Evidence, unit: UnitLedger, found: Unserved) -> bool:
    """Whether answers do come, late or where they are doubtful; a retry that reads like the answer tells nothing."""
    silent = unit.count(Ending.SILENT)
    if all(request.function in ECHOED for request in found.requests):
        late = unit.late if _is_nothing_waited_for(evidence, unit) else 0
        return late + answers_like_requests(evidence, unit) + _hit_behind(evidence, unit) > _LATE * silent
    late = max(unit.late, _heard_elsewhere(evidence, found))
    return late > _LATE * silent or evidence.silent(unit) < _SURE * silent


def _is_nothing_waited_for(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether what reads like late answers as well as like requests is followed sooner than the client gives up on one."""
    rows, mine = evidence.ledger.table.rows, evidence.rows(unit.unit)
    waits, in_vain = rows.wait[(rows.late > 0) & (rows.wait >= 0)], mine.wait[mine.outcome == Ending.SILENT]
    return bool(len(waits) and len(in_vain) and np.median(waits) < np.quantile(in_vain, _MOSTLY))


def _heard_elsewhere(evidence: Evidence, found: Unserved) -> int:
    """How many stretches of what is no right answer hold the beginning of an answer to such requests, or all but its first
    byte: it came when something else was sent."""
    begins = {known_header(request.adu)[at : at + _BEGIN] for request in found.requests for at in (0, 1)}
    begins = {begin for begin in begins if len(begin) == _BEGIN}
    readings = (each for unit in evidence.units for each in (*evidence.readings(unit), *evidence.followed(unit)))
    return sum(any(begin in each.heard for begin in begins) for each in readings)


def _hit_behind(evidence: Evidence, unit: UnitLedger) -> float:
    """How many more exchanges right behind silent ones of a unit are hit than else: an answer came when something else was
    sent."""
    successors = evidence.ledger.successors
    rates = (successors.rates(other, unit.unit) for other in successors.behind(unit.unit))
    return sum(then - then_of * other / max(other_of, 1) for then, then_of, other, other_of in rates)


def spaced(request: Request) -> str:
    """Its bytes for people."""
    return request.adu.hex(" ").upper()


def asks(found: Unserved | None) -> Mapping[str, Any]:
    """The numbers by which a cause names the reason, and what to ask instead; people are told of what is not asked yet."""
    if found is None:
        return {"asks": ()}
    return {
        "reason": found.reason,
        "ask_instead": tuple(request.adu.hex() for request in found.ask_instead),
        "asks": tuple(map(spaced, found.untried[:SHOWN])),
    }
