"""Masters that do not wait: their next request runs into an answer, meets one to a broadcast, or reads like one."""

from __future__ import annotations

from collections.abc import Set
from statistics import median_low
from typing import Final, NamedTuple

import numpy as np

from ..deframing.tap_clock import UNKNOWN
from ..tables.transactions import ECHOED
from .bits import strays, surplus_bits
from .evidence import Evidence, usual_rate
from .exchanges import Ending
from .rawbytes import ENDING, is_in_ascii
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
_PAUSES: Final = 0.97  # of the client's rests behind good answers,
_IN_VAIN: Final = 2.0  # times which it waits where there is none


def asked_again_into(evidence: Evidence, unit: UnitLedger) -> list[Signature]:
    """Damaged answers of a unit that go on when its request comes once more: it ends some of them, always as long behind
    the first one. No other master asks for the same at just that time."""
    char_ns, off = evidence.ledger.char_ns, evidence.verdict.wait_ns
    readings = [each for each in evidence.readings(unit) if each.delay >= 0 and not _ends_alike(each)]
    ends = [(each, each.heard.rfind(each.request[-ENDING:]) + ENDING) for each in readings]
    again = [
        each.delay + (end - len(each.request)) * char_ns
        for each, end in ends
        if end > _HEADER + ENDING and not each.heard.startswith(each.request[:_HEADER])
    ]
    begun, reach = float(np.median(again or [0.0])), off + _STRAYS_CHARS * char_ns
    if len(again) < _LEAST or strays(again) > reach or off > _TOLD * begun:
        return []  # what a tap holds back and hands over at once comes always as long behind, too
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
    usual, reach = np.median(known), evidence.verdict.wait_ns + _REQUEST_CHARS * evidence.ledger.char_ns
    return round(unit.followed.offered * sum(abs(t - usual) <= reach for t, _ in begun) / len(readings))


def waits_longer(evidence: Evidence, unit: UnitLedger, times: float = _LONGER) -> bool:
    """Whether the master waits longer behind a unit's answers, before it repeats what it asked, than nearly ever behind
    others': it had not given up when they came. The last unit of a round, behind which it rests, tells nothing."""
    found = (other.pauses.quantile(0.9) for other in evidence.others(unit))
    usual, waited = [pause for pause in found if pause is not None], unit.redundant_pauses.quantile(0.1) or 0.0
    return waited > times * max(median_low(usual or [UNKNOWN]), evidence.ledger.char_ns)


def _ends_alike(reading: Signature) -> bool:
    """Whether its answer ends as the request does: an echo, and every line in ASCII."""
    return len(reading.request) == reading.due or is_in_ascii(reading.request)


_OFTEN: Final = 0.3  # of the broadcasts
_FEW: Final = 3
_HITS_LEAST: Final = 5  # exchanges that are hit
_CONTRAST: Final = 8  # exchanges of a unit behind something else
_ELSEWHERE: Final = 0.1  # of its hits
_HALF: Final = 0.5
_BITS: Final = 10.0
_SURE_BITS: Final = 30.0
_TO_ALL: Final = 0


class CalledBack(NamedTuple):
    """How many exchanges right behind broadcasts were hit, of how many, by how much that is likelier as their doing
    (bits), and the units that are hit behind broadcasts, or behind each other, and next to never else."""

    met: int = 0
    met_of: int = 0
    bits: float = 0.0
    units: frozenset[int] = frozenset()


def called_back(evidence: Evidence) -> CalledBack:
    """Of the exchanges that nothing explains yet; nothing where it may be chance."""
    if not evidence.ledger.broadcasts or not evidence.ordered:
        return CalledBack()
    units = [unit.unit for unit in evidence.units]
    direct = {unit: found for unit in units if (found := _behind(evidence, unit, {_TO_ALL})).bits > _BITS}
    met, met_of = sum(each.met for each in direct.values()), sum(each.met_of for each in direct.values())
    bits = sum(each.bits for each in direct.values())
    if met < _HITS_LEAST or bits < _SURE_BITS:
        return CalledBack()
    hit = more = set(direct)
    while more:
        more = {unit for unit in set(units) - hit if _is_behind(evidence, unit, hit | {_TO_ALL})}
        hit = hit | more
    return CalledBack(met, met_of, bits, frozenset(hit))


def broadcasts_answered(evidence: Evidence) -> bool:
    """Whether many broadcasts are, for what answers them runs into requests as a second master's would."""
    ledger = evidence.ledger
    often = ledger.broadcasts_answered >= _FEW and ledger.broadcasts_answered > _OFTEN * ledger.broadcasts
    return often or called_back(evidence).met > _OFTEN * ledger.broadcasts


class _HitBehind(NamedTuple):
    """Exchanges of a unit right behind some units that were hit, of how many, and how much likelier that is than wherever
    it is asked (bits); 0 where it is hit else."""

    met: int
    met_of: int
    bits: float
    elsewhere: int  # exchanges of it


def _behind(evidence: Evidence, unit: int, behind: Set[int]) -> _HitBehind:
    successors = evidence.ledger.successors
    met, followed = (sum(of[unit, each] for each in behind) for of in (successors.met, successors.followed))
    hit, asked = successors.met_of(unit) - met, successors.followed_of(unit) - followed
    if asked < _CONTRAST or hit > _ELSEWHERE * met or not evidence.is_open(Symptom.DAMAGE, unit):
        return _HitBehind(met, followed, 0.0, asked)
    bits = surplus_bits(met, followed, usual_rate(hit, asked))
    return _HitBehind(met, followed, bits, asked)


def _is_behind(evidence: Evidence, unit: int, hit: Set[int]) -> bool:
    """Whether a unit is hit behind these and not else; one that always comes behind them no oftener than it may be."""
    found = _behind(evidence, unit, hit)
    if found.elsewhere >= _CONTRAST or not evidence.is_open(Symptom.DAMAGE, unit):
        return found.bits > _BITS
    return 0 < found.met <= min(evidence.ledger.broadcasts, _HALF * found.met_of)


_REQUESTS_LEAST: Final = 5  # requests
_HARDLY: Final = 0.1  # of what seems to be answered
_AS_LATE: Final = 0.95
_SILENT_FOR_ECHO: Final = 5
_NEARLY_ALL_SILENT: Final = 0.8  # the rest is what a tap hands over in pieces


def only_repeats(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether what reads like its answers is the master's own requests once more: echoes, and as late as its repeats."""
    otherwise = unit.answered != unit.echoes or unit.loose != unit.echo_strays
    if otherwise or unit.count(Ending.SILENT) < _HARDLY * unit.answered:
        return False  # the deframer tells these, where anything does
    delay, wait = unit.echo_delays.quantile(0.1), unit.waits.quantile(0.1)
    off, mostly = evidence.verdict.wait_ns, _is_mostly_silent(evidence, unit)
    if delay is None or wait is None or evidence.ledger.echoing:
        return mostly  # what an adapter shows of a request comes at once, as an answer does
    wait = max(wait, evidence.timeout_ns or 0.0)  # of what only seems to be silent the wait may be a pause
    if off > wait:
        return mostly
    patience = max((each.garbage_again.quantile(0.5) or 0.0 for each in evidence.units), default=0.0)
    if delay + off < _TOLD * patience:
        return False  # it was seen to wait longer before it asks again for what came damaged
    latest, longest = unit.echo_delays.quantile(0.9) or delay, unit.waits.quantile(0.9) or wait
    return delay + off > _AS_LATE * wait and (mostly or latest * _AS_LATE < longest)


def _is_mostly_silent(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether next to nothing is answered that reads otherwise, or far more is silent than reads like an answer."""
    told = [poll for poll in evidence.polls_of(unit.unit) if not ECHOED[poll.function]]
    silent, asked = sum(poll.count(Ending.SILENT) for poll in told), sum(poll.asked for poll in told)
    never = silent >= max(_REQUESTS_LEAST, _NEARLY_ALL_SILENT * asked) and not any(p.count(Ending.OK) for p in told)
    return never or unit.count(Ending.SILENT) >= _SILENT_FOR_ECHO * (unit.answered + unit.loose)


def in_vain(evidence: Evidence, unit: UnitLedger) -> tuple[int, int]:
    """Requests to a unit that stayed without an answer, of how many: those among them that read like its answers."""
    if not only_repeats(evidence, unit):
        return evidence.silent(unit), unit.asked
    taken = unit.answered + unit.loose  # for answers, the first of a pair each time
    return unit.count(Ending.SILENT) + unit.answered + taken, unit.asked + taken


def answers_like_requests(evidence: Evidence, unit: UnitLedger) -> int:
    """How many of what seem to be writes without an answer the client goes on behind as soon as behind answers, though it
    waits for others: answers to requests long before, which read like requests."""
    longest, rows = evidence.ledger.pauses.quantile(_PAUSES), evidence.rows(unit.unit)
    waits = rows.wait[(rows.outcome == Ending.SILENT) & ECHOED[rows.function] & ~rows.next_same & (rows.wait >= 0)]
    soon = waits <= (UNKNOWN if longest is None else longest + evidence.verdict.wait_ns)
    if soon.all() or not soon.any() or np.median(waits[~soon]) < _IN_VAIN * np.median(waits[soon]):
        return 0  # nobody knows how long it waits in vain
    return round(int(np.count_nonzero(soon)) * evidence.ledger.table.weight_of(rows))


def only_displaced(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether all late answers of a unit are such as the client took for those to the next request, and the first of them
    came though it had got the one before: nobody gave up, somebody hands answers on one by one too late."""
    shifts = evidence.ledger.shifts.units.get(unit.unit)
    if shifts is None or unit.late > shifts.displaced or unit.strays:
        return False
    rows = evidence.rows(unit.unit)
    displaced = np.flatnonzero((rows.outcome == Ending.SILENT) & (rows.late > 0))
    return bool(len(displaced) and displaced[0] and rows.outcome[displaced[0] - 1] == Ending.OK)
