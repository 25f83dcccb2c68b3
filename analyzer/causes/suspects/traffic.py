"""Traffic that is right though it looks odd: long transfers, other protocols."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from dissectors.declaration import USER_DEFINED
from dissectors.foreign import TALKERS
from dissectors.functions import function

from ...tables.findings import Severity
from ..evidence import Evidence
from ..registry import Suspicion, Symptom, suspect

_FRAMES: Final = 20
_FRAMES_MOVED: Final = 8  # right by their check values, of a function that its user has defined
_BYTES: Final = 0.2
_BITS: Final = 14.0  # a frame of another protocol, its check value right
_ODD: Final = 0.6


@suspect(
    "vendor-transfer",
    Severity.NOTE,
    blame="nobody",
    text="A transfer by function {function}[ ({name})][ with {units:unit|units}]: {frames} frames, {part:.0%} of all bytes; nothing is "
    "wrong with it",
    share="{part:.0%} of the bytes",
    deciding_test="Ask whether firmware, a recipe or a log is being moved",
    remedy="Nothing to mend; polls come slower while it lasts",
)
def vendor_transfer(evidence: Evidence) -> Iterator[Suspicion]:
    """Long traffic of a user-defined function."""
    ledger = evidence.ledger
    for code in sorted(USER_DEFINED):
        frames, part = (
            int(ledger.functions[code]),
            int(ledger.function_bytes[code]) / max(ledger.right_bytes, 1),
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
    text="Other traffic is on the pair: {protocol}, {frames} of its frames among the bytes looked at; it is no noise and no "
    "fault of the wiring",
    share="[{foreign:,} of {bytes:,} bytes are in no Modbus frame]",
    deciding_test="Ask what else is connected to the pair, and switch it off for a minute",
    remedy="Give the other protocol a pair of its own if Modbus devices mind it; many take its frames for their own",
)
def other_protocol(evidence: Evidence) -> Iterator[Suspicion]:
    """Frames of another protocol; a lone talker that no one asks is a line of its own, not a bus with something wrong."""
    ledger = evidence.ledger
    name, frames = evidence.foreign
    if name in TALKERS and not ledger.frames:
        return
    if not frames and evidence.odd >= _FRAMES and evidence.odd >= _ODD * max(ledger.frames, 1):
        name, frames = "a protocol with the CRC of Modbus (meters use it so)", evidence.odd
    if frames:
        looked_at = sum(len(octets) for _, _, octets in ledger.noise)
        kinds = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.SILENCE, Symptom.LATENESS, Symptom.REFUSAL, Symptom.DOUBLES)
        explains: set[tuple[Symptom, int | None]] = {(kind, unit) for unit in ledger.units for kind in kinds}
        explains |= {(Symptom.FRAMING, None), (Symptom.REQUESTS, None), (Symptom.REQUESTS, 0)}
        numbers = {"protocol": name, "frames": frames, "foreign": ledger.noise_bytes, "bytes": ledger.bytes}
        bits = _BITS * frames * max(1.0, ledger.noise_bytes / max(looked_at, 1))
        yield Suspicion((), bits, frozenset(explains), numbers, ledger.begin, ledger.end)
