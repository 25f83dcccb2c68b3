"""What may still come: a frame that has begun and would explain the end of a stretch better than what is there.

Looked at before a decision: the beginning of a long frame may check by chance, or hold what does.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import Final

from dissectors.adu import MAX_ADU
from dissectors.length_rules import Role
from dissectors.lengths import plausibility

from .candidates import CRC_BITS, KNOWN_BITS, predicted_length
from .lattice import EMBEDDED, FITS, NOISE_BYTE, Lattice
from .paths import PathStep
from .possible_edges import next_byte
from .rules import length_tables

_HEADERS: Final = 8  # beginnings of an awaited answer that are gone through
_ODD: Final = 8  # steps whose beginnings are looked at, the newest


def answer_may_come(
    data: bytes, frames: Sequence[PathStep], steps: Sequence[PathStep], lattice: Lattice, idle_bits: float
) -> bool:
    """Whether an answer that a request asked for has begun in `data`.

    `frames` are those of `steps`, the best path of the lattice; `idle_bits`: what a quiet line says against more.
    """
    best, position = frames[-1].score, len(data)
    for request in lattice.open_after(frames):
        header = request.expects.header
        if len(header) < 2:
            continue
        start = data.find(
            header, max(steps[0].start, request.start + len(request.adu) - lattice.offset, position - MAX_ADU)
        )
        for _ in range(_HEADERS):
            if start < 0:
                break
            length = predicted_length(data, start, Role.RESPONSE)
            if length is not None and start + length > position:
                before = steps[bisect_right(steps, start, key=_end)]
                score = before.before.score if before.before is not None else 0.0
                if start > before.start:
                    score -= lattice.noise_cost + NOISE_BYTE * (start - before.start)
                score += CRC_BITS + KNOWN_BITS + FITS + lattice.gap_bits(start) - idle_bits
                if score + _held(frames, start) > best:
                    return True
            start = data.find(header, start + 1)
    return False


def frame_may_come(
    data: bytes,
    frames: Sequence[PathStep],
    steps: Sequence[PathStep],
    lattice: Lattice,
    idle_bits: float,
    only: Role | None,
) -> bool:
    """Whether a legal frame has begun where the best path has noise, or what limits or conversation speak against.

    `only`: the role that frames here have.
    """
    best, position = frames[-1].score, len(data)
    odd = [
        step
        for step in steps
        if position - MAX_ADU < step.start < frames[-1].end
        and (step.candidate is None or step.conversation_bits < 0 or step.candidate.structure < 0)
    ]
    for step in odd[-_ODD:]:
        before, conversation = lattice.before(step)
        for start in {step.start, next_byte(data, step.start)} if step.candidate is None else {step.start}:
            score = before - (lattice.glitch_cost if start > step.start else 0.0)
            score += _held(frames, start) - idle_bits
            for role in Role if only is None else (only,):
                length = predicted_length(data, start, role)
                if length is None or not position < start + length <= start + MAX_ADU:
                    continue
                checks, head = length_tables().checks[256 * role + data[start + 1]], data[start + 1 :]
                if checks is None or plausibility(head, role):
                    continue
                legal = CRC_BITS + KNOWN_BITS + checks.bits + sum(checks.soft_bits)
                if not idle_bits and step.candidate is not None and step.candidate.structure < 0:
                    return True  # what breaks a limit never stands for what breaks none
                if score + legal + lattice.bits_of_start(start, role, conversation) > best:
                    return True
    return False


def _held(frames: Sequence[PathStep], start: int) -> float:
    """What the frames behind a start would tell of one that holds them."""
    told = 0.0
    for frame in reversed(frames):
        if frame.start <= start:
            break
        if frame.candidate is not None:
            told += max(0.0, CRC_BITS + frame.candidate.structure - EMBEDDED)
    return told


def _end(step: PathStep) -> int:
    return step.end
