"""Software flow control on the tap: it eats every 11 and 13."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from dissectors.length_rules import Role

from ...diagnosis.damage.case import DamagedFrame
from ...diagnosis.damage.causes import autopsy
from ...diagnosis.damage.flow_control import divided
from ...tables.findings import Severity
from ..evidence import Evidence
from ..exchanges import Ending
from ..registry import Suspicion, Symptom, suspect
from ..signatures import Signature

_BYTES: Final = 400  # none of which is 11 or 13: one in 170 should be
_LEAST: Final = 3  # answers that are whole with those put back
_MOSTLY: Final = 0.6
_LEFT: Final = 10.0  # bits: what damage as such makes right by one or two bytes of these two values
_ROBBED: Final = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.DOUBLES, Symptom.LATENESS, Symptom.SILENCE, Symptom.MARKS)


@suspect(
    "tap-flow-control",
    Severity.ERROR,
    blame="tap",
    text="The tap's port eats every byte 11 and 13 (hex), XON and XOFF of software flow control: none of {bytes:,} bytes is "
    "one, and {robbed} of {damaged} damaged answers are whole with them put back; the bus itself may be well",
    share="{robbed} of {damaged} damaged answers",
    deciding_test="Switch software flow control off on the port that listens (`stty -F PORT -ixon -ixoff`) and listen again",
    remedy="Switch XON/XOFF off: on the port, in the program that records and in the converter",
)
def tap_flow_control(evidence: Evidence) -> Iterator[Suspicion]:
    """No 11 and no 13 in all that was heard, and damaged answers that only lack those."""
    ledger = evidence.ledger
    if ledger.flow_bytes or ledger.bytes < _BYTES:
        return
    robbed = damaged = 0.0
    solved = 0
    explains: set[tuple[Symptom, int | None]] = {(Symptom.FRAMING, None), (Symptom.REQUESTS, None)}
    units = frozenset(unit.unit for unit in evidence.units)
    for unit in evidence.units:
        explains |= {(kind, unit.unit) for kind in _ROBBED}
        readings = evidence.readings(unit)
        if readings:
            whole = sum(_is_robbed(reading, units, ledger.bytes) for reading in readings)
            solved += whole
            damaged += unit.count(Ending.GARBAGE)
            robbed += unit.count(Ending.GARBAGE) * whole / len(readings)
    if solved < _LEAST or robbed < _MOSTLY * damaged:
        return
    numbers = {"bytes": ledger.bytes, "robbed": round(robbed), "damaged": round(damaged)}
    yield Suspicion((), _LEFT * robbed, frozenset(explains), numbers, ledger.begin, ledger.end)


def _is_robbed(reading: Signature, units: frozenset[int], flow_free: int) -> bool:
    """Whether an answer lacks bytes 11 and 13, and nothing else; alone, or before frames of units 17 and 19, which say no
    number then."""
    case = DamagedFrame(reading.heard, Role.RESPONSE, reading.request or None, units=units, flow_free=flow_free)
    return autopsy(case).code == "flow-control-loss" or bool(divided(replace(case, role=None)))
