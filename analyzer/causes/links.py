"""From a finding to the cause that explains it: what a finding's code is a symptom of, and of whom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from .model import Cause
from .registry import Symptom

SYMPTOMS: Final[Mapping[Symptom, tuple[str, ...]]] = {
    Symptom.SILENCE: ("no-response", "retry"),
    Symptom.DAMAGE: (
        "bit-flip", "byte-extra", "byte-missing", "byte-count-mismatch", "bytes-repeated", "collision", "crc-error",
        "crc-variant", "flow-control-loss", "frame-too-long", "lrc-error", "response-mismatch", "truncated",
    ),
    Symptom.LATENESS: ("late-response", "slow-device", "unexpected-response"),
    Symptom.DOUBLES: ("duplicate-response", "broadcast-answered"),
    Symptom.MARKS: ("parity-error",),
    Symptom.REFUSAL: ("exception",),
    Symptom.TIMING: ("gap-in-frame", "gap-too-short", "turnaround-short"),
    Symptom.REQUESTS: ("broadcast-read", "bus-saturated", "echo", "poll-waste"),
    Symptom.FRAMING: ("noise", "other-protocol"),
}  # fmt: skip
SYMPTOM_OF: Final = {code: symptom for symptom, codes in SYMPTOMS.items() for code in codes}


def cause_of(code: str, unit: int | None, causes: Sequence[Cause]) -> int | None:
    """The number of the cause that explains findings of a code about a unit (None: no unit); None where none does."""
    symptom = SYMPTOM_OF.get(code)
    if symptom is None:
        return None
    whom = {(symptom, unit), (symptom, None)}
    return next((i for i, cause in enumerate(causes) if whom & cause.explains), None)
