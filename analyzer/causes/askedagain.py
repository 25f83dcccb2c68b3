"""A request that comes once more while its answer does, or right behind it: the master had given up."""

from __future__ import annotations

from statistics import median_low
from typing import Final

import numpy as np

from .asciireading import is_in_ascii
from .bits import strays
from .evidence import Evidence
from .knownrequests import ENDING
from .registry import Symptom
from .signatures import Behind, Signature
from .unitledger import UnitLedger

_HEADER: Final = 3  # of an answer
_LEAST: Final = 3
_STRAYS_CHARS: Final = 2.0  # a master's timer
_REQUEST_CHARS: Final = 8
_LONGER: Final = 1.5
_TOLD: Final = 0.5  # of a time: by so much it may be wrong and tell something
_SELDOM: Final = 0.5  # of the good answers


def asked_again_into(evidence: Evidence, unit: UnitLedger) -> list[Signature]:
    """Damaged answers of a unit that go on when its request comes once more: it ends some of them, always as long behind
    the first one. No other master asks for the same at just that time."""
    char_ns, off = evidence.ledger.char_ns, evidence.verdict.wait_ns
    readings = [each for each in evidence.readings(unit) if each.delay >= 0 and not _ends_alike(each)]
    again: list[float] = []
    for each in readings:
        at = each.heard.rfind(each.request[-ENDING:])
        if at > _HEADER and not each.heard.startswith(each.request[:_HEADER]):
            again.append(each.delay + (at + ENDING - len(each.request)) * char_ns)
    if len(again) < _LEAST or strays(again) > off + _STRAYS_CHARS * char_ns:
        return []
    begun = float(np.median(again))
    if off > _TOLD * begun:
        return []  # what a tap holds back and hands over at once comes always as long behind, too
    reach = off + _STRAYS_CHARS * char_ns
    return [each for each in readings if each.delay - reach < begun < each.delay + each.length * char_ns + reach]


def asked_again_behind(evidence: Evidence, unit: UnitLedger) -> int:
    """About how many good answers have their own request right behind them once more, damaged, though what is well
    answered is seldom asked again: known again in some, and in others by the time."""
    if not evidence.is_open(Symptom.BEHIND, unit.unit) or len(unit.redundant) > _SELDOM * len(unit.delays):
        return 0
    readings = evidence.followed(unit)
    begun = [
        (each.t_behind - sample.t_asked, each.heard.endswith(each.request[-ENDING:]))
        for sample, each in zip(unit.followed.kept, readings, strict=True)
        if each.behind in (Behind.REQUEST, Behind.NOISE) and not _ends_alike(each)
    ]
    known = [t for t, is_known in begun if is_known]
    if len(known) < _LEAST:
        return 0
    reach = evidence.verdict.wait_ns + _REQUEST_CHARS * evidence.ledger.char_ns
    again = sum(abs(t - float(np.median(known))) <= reach for t, _ in begun)
    return round(unit.followed.offered * again / len(readings))


def waits_longer(evidence: Evidence, unit: UnitLedger, times: float = _LONGER) -> bool:
    """Whether the master waits longer behind a unit's answers, before it repeats what it asked, than nearly ever behind
    others': it had not given up when they came. The last unit of a round, behind which it rests, tells nothing."""
    found = [other.pauses.quantile(0.9) for other in evidence.units if other is not unit]
    usual, waited = [pause for pause in found if pause is not None], unit.redundant_pauses.quantile(0.1)
    if not usual or waited is None:
        return False
    return waited > times * max(median_low(usual), evidence.ledger.char_ns)


def _ends_alike(reading: Signature) -> bool:
    """Whether its answer ends as the request does: an echo, and every line in ASCII."""
    return len(reading.request) == reading.due or is_in_ascii(reading.request)
