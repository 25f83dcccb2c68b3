"""Traffic that looks odd: long transfers, other protocols, frames too soon after each other, a tap that eats 11 and "
"13."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from dissectors.declaration import USER_DEFINED
from dissectors.foreign import TALKERS
from dissectors.functions import function
from dissectors.length_rules import Role

from ...diagnosis.damage.case import DamagedFrame
from ...diagnosis.damage.causes import autopsy
from ...diagnosis.damage.flow_control import divided
from ...tables.findings import Severity
from ..bits import surplus_bits
from ..evidence import Evidence
from ..exchanges import Ending
from ..flatmemory import Thinned
from ..registry import Suspicion, Symptom, suspect
from ..signatures import Signature, is_like_request

_FRAMES: Final = 20
_FRAMES_MOVED: Final = 8  # right by their check values, of a function that its user has defined
_BYTES: Final = 0.2
_BITS: Final = 14.0  # a frame of another protocol, its check value right
_ODD: Final = 0.6
_RIGHT: Final = 0.5  # of all bytes, in frames: of others a few frames with a right check value are chance


@suspect(
    "vendor-transfer",
    Severity.NOTE,
    blame="nobody",
    text="A transfer by function {function}[ ({name})][ with {units:unit|units}]: {frames:,} frames, {part:.0%} of all "
    "bytes; nothing is "
    "wrong with it",
    share="{part:.0%} of the bytes",
    deciding_test="Ask whether firmware, a recipe or a log is being moved",
    remedy="Nothing to fix; polls are slower while it lasts",
)
def vendor_transfer(evidence: Evidence) -> Iterator[Suspicion]:
    """Long traffic of a user-defined function."""
    ledger = evidence.ledger
    for code in sorted(USER_DEFINED):
        frames, part = (
            int(ledger.functions[code]),
            int(ledger.function_bytes[code]) / max(ledger.bytes, 1),
        )
        if frames < _FRAMES_MOVED or part < _BYTES:
            continue
        polls = [poll for poll in evidence.polls if poll.function == code]
        units = sorted({poll.unit for poll in polls}, key=lambda u: -sum(p.asked for p in polls if p.unit == u))
        declared = function(code)
        numbers = {
            "function": code,
            "name": declared.name if declared else "",
            "units": tuple(units[:4]),
            "frames": frames,
            "part": part,
        }
        yield Suspicion(tuple(units), 100 + part * 20, frozenset({(Symptom.REQUESTS, None)}), numbers)


@suspect(
    "other-protocol",
    Severity.NOTE,
    blame="nobody",
    text="Other traffic is on the pair: {protocol}, {frames:,} of its frames among the bytes examined; this is neither "
    "noise nor a wiring fault",
    share="[{foreign:,} of {bytes:,} bytes are in no Modbus frame]",
    deciding_test="Ask what else is connected to the pair, and look for its own address and speed settings",
    remedy="Give the other protocol a pair of its own if Modbus devices mind it; many take its frames for their own",
)
def other_protocol(evidence: Evidence) -> Iterator[Suspicion]:
    """Frames of another protocol; a lone talker that no one asks is a line of its own, not a bus with something "
    "wrong."""
    ledger = evidence.ledger
    name, frames = evidence.foreign
    if name in TALKERS and not ledger.frames:
        return
    odd = evidence.odd >= max(_FRAMES, _ODD * ledger.frames) and ledger.right_bytes >= _RIGHT * ledger.bytes
    if not frames and odd:
        name, frames = "a protocol with the CRC of Modbus (meters use it so)", evidence.odd
    if frames:
        looked_at = sum(len(octets) for _, _, octets in ledger.noise)
        kinds = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.SILENCE, Symptom.LATENESS, Symptom.REFUSAL, Symptom.DOUBLES)
        explains: set[tuple[Symptom, int | None]] = {(kind, unit) for unit in ledger.units for kind in kinds}
        explains |= {(Symptom.FRAMING, None), (Symptom.REQUESTS, None), (Symptom.REQUESTS, 0)}
        numbers = {"protocol": name, "frames": frames, "foreign": ledger.noise_bytes, "bytes": ledger.bytes}
        bits = _BITS * frames * max(1.0, ledger.noise_bytes / max(looked_at, 1))
        shared = Severity.WARNING if ledger.answered >= _FRAMES else None  # a pair of its own is well
        yield Suspicion((), bits, frozenset(explains), numbers, ledger.begin, ledger.end, severity=shared)


_GAPS_LEAST: Final = 5
_TOO_SOON: Final = 0.9  # of t3.5
_HASTY_MOSTLY: Final = 0.5
_STRAYS: Final = 0.3  # of t3.5, at the most
_LATENCY_NS: Final = 25e6  # of an adapter: of what comes later than that nobody knows what was between
_TOLD: Final = 0.2  # of the pauses
_PAUSES_LEAST: Final = 20
_HALF: Final = 0.5  # of a character, by which the last byte of a read came before it


def _told_t35(evidence: Evidence) -> float | None:
    """The line's t3.5 (ns); None where the clock cannot tell less from as much."""
    due, verdict = evidence.t35_ns, evidence.verdict
    carried = due is not None and verdict.fine and verdict.jitter_ns <= _STRAYS * due
    return due if carried and len(evidence.ledger.ports) <= 1 else None


_AT_MOST: Final = "at most"


class _Pauses(NamedTuple):
    """The line's t3.5 (ns; 0 where it cannot be held against anything), pauses before requests and by how much they may be
    wrong (ns); `bound`: what they are to the times shown."""

    due: float
    times: Thinned
    off: float
    bound: str


def _pauses(evidence: Evidence) -> _Pauses:
    """The pauses before requests; where the clock does not carry them, what those have at the most that come in one read with
    the end of the answer before, behind the read that brought its middle: its last byte was on time."""
    due, ledger, verdict = _told_t35(evidence), evidence.ledger, evidence.verdict
    if due is not None:
        return _Pauses(due, ledger.request_gaps, verdict.jitter_ns, "")
    due, most = evidence.t35_ns or 0.0, ledger.pauses_most
    told = len(most) >= _TOLD * (ledger.joined + len(ledger.request_gaps)) and len(ledger.ports) < 2
    fit = told and verdict.wait_ns <= _LATENCY_NS and verdict.step_ns <= _STRAYS * due
    return _Pauses(due * fit, most, _HALF * ledger.char_ns, _AT_MOST)


@suspect(
    "master-too-fast",
    Severity.WARNING,
    blame="master",
    text="The client sends its next request [{bound} ]{gap:ms} after an answer (median) instead of {due:ms}: "
    "{short:,} of {requests:,} requests",
    share="{short:,} of {requests:,} requests",
    deciding_test="Look at the client's delay between polls; with 5 ms before each request the units that lost "
    "requests must answer",
    remedy="Set the client's inter-frame delay to at least {due:ms}: 3.5 characters, above 19200 bit/s always 1.75 ms",
)
def master_too_fast(evidence: Evidence) -> Iterator[Suspicion]:
    """Less than t3.5 before requests, where the clock carries it, or what they have at the most."""
    due, gaps, off, bound = _pauses(evidence)
    share, median = 1 - gaps.above(_TOO_SOON * due - off), gaps.quantile(0.5)
    if len(gaps) < _PAUSES_LEAST or share < _HASTY_MOSTLY:
        return
    assert median is not None
    yield Suspicion(
        (),
        surplus_bits(share * len(gaps), len(gaps), 0.05),
        frozenset({(Symptom.TIMING, None)}),
        {
            "bound": bound,
            "gap": median / 1e6,
            "short": round(share * len(gaps)),
            "requests": len(gaps),
            "due": due / 1e6,
        },
    )


@suspect(
    "unit-too-fast",
    Severity.WARNING,
    blame="unit",
    text="Answers of {units:unit|units} come {gap:ms} after the request (median) instead of {due:ms}: {short:,} "
    "of {answers:,}",
    share="{short:,} of {answers:,} answers of {units:unit|units}",
    deciding_test="Check whether the client or listening units lose frames right after requests to {units:unit|units}",
    remedy="Set the unit's response delay to at least {due:ms}: 3.5 characters, above 19200 bit/s always 1.75 ms",
)
def unit_too_fast(evidence: Evidence) -> Iterator[Suspicion]:
    """Less than t3.5 before the answers of some units."""
    due = _told_t35(evidence)
    if due is None:
        return
    found = []
    for unit in evidence.units:
        share = 1 - unit.gaps.above(_TOO_SOON * due - evidence.verdict.jitter_ns)
        if len(unit.gaps) >= _GAPS_LEAST and share >= _HASTY_MOSTLY and evidence.is_open(Symptom.TIMING, unit.unit):
            found.append((surplus_bits(share * len(unit.gaps), len(unit.gaps), 0.05), unit, share))
    if not found:
        return
    found.sort(key=lambda one: -one[0])
    yield Suspicion(
        tuple(unit.unit for _, unit, _ in found),
        sum(bits for bits, _, _ in found),
        frozenset((Symptom.TIMING, unit.unit) for _, unit, _ in found),
        {
            "units": tuple(unit.unit for _, unit, _ in found),
            "gap": float(np.median(np.concatenate([unit.gaps.numbers for _, unit, _ in found]))) / 1e6,
            "short": round(sum(share * len(unit.gaps) for _, unit, share in found)),
            "answers": sum(len(unit.gaps) for _, unit, _ in found),
            "due": due / 1e6,
        },
    )


_BYTES_LEAST: Final = 400  # none of which is 11 or 13: one in 170 should be
_ROBBED_LEAST: Final = 3  # answers that are whole with those put back
_ROBBED_MOSTLY: Final = 0.6
_LEFT: Final = 10.0  # bits: what damage as such makes right by one or two bytes of these two values
_ROBBED: Final = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.DOUBLES, Symptom.LATENESS, Symptom.SILENCE, Symptom.MARKS)


@suspect(
    "tap-flow-control",
    Severity.ERROR,
    blame="tap",
    text="The tap's port swallows every byte 11 and 13 (hex), XON and XOFF of software flow control: none of {bytes:,} "
    "bytes is "
    "one, and {robbed:,} of {damaged:,} damaged frames are whole with them put back; the bus itself may be well",
    share="{robbed:,} of {damaged:,} damaged frames",
    deciding_test="Switch software flow control off on the port that listens (`stty -F PORT -ixon -ixoff`) and listen "
    "again",
    remedy="Switch XON/XOFF off: on the port, in the program that records and in the converter",
)
def tap_flow_control(evidence: Evidence) -> Iterator[Suspicion]:
    """No 11 and no 13 in all that was heard, and damaged answers that only lack those."""
    ledger = evidence.ledger
    if ledger.flow_bytes or ledger.bytes < _BYTES_LEAST:
        return
    robbed = damaged = 0.0
    solved = 0
    explains: set[tuple[Symptom, int | None]] = {(Symptom.FRAMING, None), (Symptom.REQUESTS, None)}
    units = frozenset(unit.unit for unit in evidence.units)
    for unit in evidence.units:
        explains |= {(kind, unit.unit) for kind in _ROBBED}
        behind = [each for each in evidence.followed(unit) if is_like_request(each)]  # with no answer known as such
        for readings, count in (
            (evidence.readings(unit), unit.count(Ending.GARBAGE)),
            ([replace(each, request=b"") for each in behind], evidence.requests_behind(unit)),
        ):
            whole = sum(_is_robbed(reading, units, ledger.bytes) for reading in readings)
            solved += whole
            damaged += count if readings else 0
            robbed += count * whole / max(len(readings), 1)
    if solved < _ROBBED_LEAST or robbed < _ROBBED_MOSTLY * damaged:
        return
    numbers = {"bytes": ledger.bytes, "robbed": round(robbed), "damaged": round(damaged)}
    yield Suspicion((), _LEFT * robbed, frozenset(explains), numbers, ledger.begin, ledger.end)


def _is_robbed(reading: Signature, units: frozenset[int], flow_free: int) -> bool:
    """Whether an answer or a request lacks bytes 11 and 13, and nothing else; alone, or before frames of units 17 and 19,
    which say no number then."""
    role = Role.RESPONSE if reading.request else Role.REQUEST
    case = DamagedFrame(reading.heard, role, reading.request or None, units=units, flow_free=flow_free)
    return autopsy(case).code == "flow-control-loss" or bool(divided(replace(case, role=None)))
