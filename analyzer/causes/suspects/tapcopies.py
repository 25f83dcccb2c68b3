"""Bytes that a tap hands over twice: what it hears is right but for a stretch that comes once more at once."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

from dissectors.crc import crc16

from ...deframing.tap_clock import UNKNOWN
from ...tables.findings import Severity
from ..bits import surplus_bits
from ..evidence import HEALTHY, Evidence
from ..foretold import of_all
from ..registry import Suspicion, Symptom, suspect
from ..samples import READ_REQUEST, Sample, Samples
from .structure import TAP_TAKES

_LEAST: Final = 2  # bytes: one may be anybody's,
_BOTH: Final = 2  # and copies of requests and of answers: no sender sends both
_SHARE: Final = 0.2  # of what was looked at; one stretch may fall into the next
_HALF: Final = 0.5
_AGAIN_NS: Final = 75e6  # nobody gives up sooner
_BITS: Final = 12.0  # a check value that is right without the copy, less the places where it may stand


def copied(sample: Sample) -> tuple[bool, bool]:
    """Whether the bytes of an exchange are right but for a stretch of them that comes twice, of the request, of an
    answer; what is a whole frame may have been sent twice."""
    request, due = sample.request, sample.due
    heard = request + b"".join(piece.data for piece in sample.pieces)
    base = len(request) + due
    for more in (0, READ_REQUEST):
        size = len(heard) - base - more
        if due and _LEAST <= size < min(due, base + more - len(request)):
            for at in range(max(len(request) - size, 1), len(heard) - 2 * size + 1):
                if heard[at : at + size] == heard[at + size : at + 2 * size] and _are_right(
                    heard[:at] + heard[at + size :], len(request), base
                ):
                    return at < len(request) or at + size > base, len(request) < at + size <= base
    return False, False


def _are_right(frames: bytes, asked: int, base: int) -> bool:
    """Whether a request, its answer and what is asked next, if it is there, have right check values."""
    return not (crc16(frames[:asked]) or crc16(frames[asked:base]) or crc16(frames[base:]) * (len(frames) > base))


def _come_too_soon(sample: Sample, char_ns: float) -> bool:
    """Whether what ends an answer comes once more sooner than anybody can send it."""
    return any(
        before.answers
        and before.data.endswith(piece.data)
        and piece.t_start < before.t_end - _HALF * len(piece.data) * char_ns
        for before, piece in pairwise(sample.pieces)
    )


def _sent_ns(evidence: Evidence) -> float:
    """How long a character takes to be sent; infinite where the tap does not tell what a client asks again when it has given
    up from what cannot have been sent again so soon."""
    ledger = evidence.ledger
    told = len(ledger.ports) < 2 and not ledger.echoing and evidence.verdict.wait_ns <= _AGAIN_NS
    return ledger.char_ns if told else UNKNOWN


def _counted(samples: Samples, char_ns: float) -> tuple[float, float]:
    """About how many of these exchanges have a copy in a request, and in an answer."""
    found = [(False, True) if _come_too_soon(sample, char_ns) else copied(sample) for sample in samples.kept]
    return samples.weight * sum(asked for asked, _ in found), samples.weight * sum(answered for _, answered in found)


@suspect(
    "tap-repeats",
    Severity.WARNING,
    blame="tap",
    text="The tap hands bytes over twice, the bus does not: {copies:,} frames are right without a stretch that comes once "
    "more, in requests ({requests:,}) as in answers",
    share="{copies:,} of {damaged:,} disturbed exchanges",
    deciding_test="Record with another adapter or driver: the copies must be gone, and the client's own error counters "
    "must not rise with them",
    remedy="Update the driver or the firmware of the adapter that listens, or take another one; check a program between "
    "the port and the recorder that reads again what it has read",
)
def tap_repeats(evidence: Evidence) -> Iterator[Suspicion]:
    """Copies in what the client sends, and in what units do."""
    char_ns, waits, answers = _sent_ns(evidence), evidence.ledger.repeat_waits, 0.0
    requests = damaged = len(waits) * waits.below(-_HALF * READ_REQUEST * char_ns)  # before they can be sent once more
    for unit in evidence.units:
        for samples, symptom in ((unit.samples, Symptom.DAMAGE), (unit.followed, Symptom.BEHIND)):
            if evidence.is_open(symptom, unit.unit):
                asked, answered = _counted(samples, char_ns)
                requests, answers, damaged = requests + asked, answers + answered, damaged + samples.offered
    copies = requests + answers
    if min(requests, answers) < _BOTH or copies < _SHARE * damaged:
        return
    asked = sum(unit.asked for unit in evidence.units)
    yield Suspicion(
        (),
        surplus_bits(min(round(damaged), asked), asked, HEALTHY) + _BITS * copies,
        of_all(evidence, TAP_TAKES),
        {"copies": round(copies), "requests": round(requests), "damaged": round(damaged)},
        since=evidence.ledger.begin,
        until=evidence.ledger.end,
        lost_answers=0,
    )
