"""Units that never answer and seem to: the master's request once more reads like their answer, where that echoes it."""

from __future__ import annotations

from typing import Final

from ..tables.transactions import ECHOED
from .bits import strays
from .evidence import Evidence
from .exchanges import Ending
from .unitledger import UnitLedger

_LEAST: Final = 5  # requests
_HARDLY: Final = 0.1  # of what seems to be answered
_AS_LATE: Final = 0.95
_SILENT_FOR_ECHO: Final = 5
_NEARLY_ALL_SILENT: Final = 0.8  # the rest is what a tap hands over in pieces
_TIMER: Final = 0.2  # of a time, by which a timer and the pause behind it stray
_ONE_TIMER: Final = 0.02  # and one and the same timer
_FAR_LONGER: Final = 4.0


def only_repeats(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether what reads like its answers is the master's own requests once more: echoes, and as late as its repeats."""
    if unit.answered != unit.echoes or unit.loose != unit.echo_strays:
        return False
    if unit.count(Ending.SILENT) < _HARDLY * unit.answered:
        return _waits_behind_as_before(evidence, unit)
    delay, wait = unit.echo_delays.quantile(0.1), unit.waits.quantile(0.1)
    told = [
        poll for poll in evidence.polls_of(unit.unit) if not ECHOED[poll.function]
    ]  # no request reads like an answer
    silent, asked = sum(poll.count(Ending.SILENT) for poll in told), sum(poll.asked for poll in told)
    mostly = silent >= max(_LEAST, _NEARLY_ALL_SILENT * asked) and not any(poll.count(Ending.OK) for poll in told)
    mostly = mostly or unit.count(Ending.SILENT) >= _SILENT_FOR_ECHO * (unit.answered + unit.loose)
    off = evidence.verdict.wait_ns
    if delay is None or wait is None or off > wait:
        return mostly
    latest, longest = unit.echo_delays.quantile(0.9) or delay, unit.waits.quantile(0.9) or wait
    return delay + off > _AS_LATE * wait and (mostly or latest * _AS_LATE < longest)


def _waits_behind_as_before(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether the master waits behind what reads like a unit's answers as long as before them, by its timer, and behind
    those of others far shorter: it had no answer."""
    delay, pause = unit.echo_delays.quantile(0.5), unit.pauses.quantile(0.5)
    others = [other.pauses.quantile(0.5) for other in evidence.units if other is not unit and other.answered]
    known = sorted(each for each in others if each is not None)
    if delay is None or pause is None or not known or evidence.verdict.wait_ns > _TIMER * delay:
        return False
    by_timer = max(strays(unit.echo_delays.numbers), abs(pause - delay))
    if delay > _FAR_LONGER * known[-1]:
        return by_timer < _TIMER * delay
    return delay > _FAR_LONGER * known[len(known) // 2] and by_timer < _ONE_TIMER * delay  # behind one the master rests


def in_vain(evidence: Evidence, unit: UnitLedger) -> tuple[int, int]:
    """Requests to a unit that stayed without an answer, of how many: those among them that read like its answers."""
    if not only_repeats(evidence, unit):
        return evidence.silent(unit), unit.asked
    taken = unit.answered + unit.loose  # for answers, the first of a pair each time
    return unit.count(Ending.SILENT) + unit.answered + taken, unit.asked + taken
