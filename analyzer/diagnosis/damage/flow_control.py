"""flow-control-loss: the capturing port has XON/XOFF on, and eats every 11 and every 13.

Up to three lost bytes are solved: put in where they make length and CRC right. What gives this away beyond doubt is
the port's whole stream, which then holds neither of them (`Case.flow_free`): from that on, frames that miss more are
explained by it too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import comb, inf, log2
from typing import Final, NamedTuple

import numpy as np

from dissectors.crc import byte_between, stepped
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length
from dissectors.limits import MAX_ADU, MIN_ADU, OVERHEAD

from .case import BYTE, FRAME, ByteRepair, DamagedFrame, Explanation, likelihood, predicted_length

XON_XOFF: Final = frozenset((0x11, 0x13))
IS_FLOW: Final = np.isin(np.arange(256), sorted(XON_XOFF))
_PRIOR: Final = -4.0
_NONE_YET: Final = 1.5  # bits: it has not let one through so far
_A_BYTE: Final = 0.0085  # bits that each byte says which is neither: one in 170 should be
_MOST: Final = 10.0  # bits that their absence is worth
_ENOUGH: Final = 400  # bytes, to go by their absence alone
_RARE: Final = 7.0  # bits: one byte in 128
_REACH: Final = {1: MAX_ADU, 2: 64, 3: 14}  # lost bytes: the longest stretch that is searched for so many
_MOST_LOST: Final = 24

Fit = tuple[float, tuple[ByteRepair, ...], bytes]


def swallowed(case: DamagedFrame) -> Iterator[Explanation]:
    """The frame with its 11 and 13 bytes put back."""
    if case.flow_free == 0 or XON_XOFF.intersection(case.data) or len(case.data) >= MAX_ADU:
        return  # a port that lets one through eats none
    prior = _PRIOR
    if case.flow_free is not None:
        prior += min(_NONE_YET + _A_BYTE * case.flow_free, _MOST)
    fits = [fit for lost, reach in _REACH.items() if len(case.data) <= reach for fit in _solved(case, lost)]
    if fits:
        best = max(fits)
        bits = best[0] + log2(sum(2.0 ** (bits - best[0]) for bits, _, _ in fits))
        yield Explanation("flow-control-loss", prior + bits, repaired=best[2], places=best[1], lost=len(best[1]))
    elif (case.flow_free or 0) >= _ENOUGH:
        yield from _supposed(case, prior)


def _solved(case: DamagedFrame, lost: int) -> Iterator[Fit]:
    """All ways to put in `lost` bytes that make a frame which could have been sent."""
    for repairs in _insertions(case, 0, case.before[0], lost):
        frame = bytearray(case.data)
        for repair in repairs:
            frame.insert(repair.first, repair.value)
        bits = 16.0 - BYTE * lost + likelihood(bytes(frame), case)
        if bits > -inf:
            yield bits, repairs, bytes(frame)


def _insertions(
    case: DamagedFrame, start: int, register: int, lost: int, inserted: int = 0
) -> Iterator[tuple[ByteRepair, ...]]:
    """Ways to put in `lost` more bytes from `start` on, where the CRC has come to `register`, so that it ends in 0."""
    data, needed = case.data, case.needed
    for at in range(start, len(data) + 1):
        if lost == 1:
            value = byte_between(register, needed[at])
            if value in XON_XOFF and value is not None:
                yield (ByteRepair(at + inserted, at + inserted, value),)
        else:
            for value in XON_XOFF:
                for rest in _insertions(case, at, stepped(register, value), lost - 1, inserted + 1):
                    yield (ByteRepair(at + inserted, at + inserted, value), *rest)
        if at < len(data):
            register = stepped(register, data[at])


def _supposed(case: DamagedFrame, prior: float) -> Iterator[Explanation]:
    """More bytes lost than can be solved: the length that is due, and the header without them, must do."""
    data = case.data
    passed = bytes(byte for byte in case.header if byte not in XON_XOFF)
    if case.due is not None and data.startswith(passed):
        length, bits = case.due, BYTE * len(case.header)
    else:
        predicted = pdu_length(data[1:], Role.RESPONSE if case.role is None else case.role)
        if predicted is None or predicted < 0:
            return
        length, bits = predicted + OVERHEAD, 0.0
    lost = length - len(data)
    searched = len(data) <= _REACH.get(lost, 0)  # and no place found for them
    if 1 <= lost <= _most_lost(length) and not searched:
        yield Explanation(
            "flow-control-loss", prior + bits + log2(comb(length, lost)) - _RARE * lost, length=length, lost=lost
        )


def _most_lost(length: int) -> int:
    """How many bytes a frame of this length may have lost and still be known."""
    return min(_MOST_LOST, length // 4)


# A stretch of noise that is several frames in a row, all robbed of their 11 and 13 bytes by the port's flow control.
#
# A unit 17 or 19 never shows its address then, so that a deframer recognises none of its frames, and without silences
# to go by they run together. From the left, each frame is looked for at the few lengths that its header can tell, with
# and without a byte put back into it; a request that was mended tells what its answer is. All of the stretch must come
# out.


_HEADER: Final = 7  # bytes that lengths hang on
_LOST: Final = 3
_LOST_OF_HEADER: Final = 2  # at most, where the port's whole stream gives it away


class DividedFrame(NamedTuple):
    """One of the frames: where it begins in the stretch, how many bytes of it there are, what happened to it.

    `start` is negative where the stretch is but the rest of a frame that began in the row before.
    """

    start: int
    length: int
    verdict: Explanation


def divided(case: DamagedFrame) -> list[DividedFrame]:
    """The frames of a stretch, if flow control explains all of it as two or more; else nothing."""
    for lost in range(1, _LOST_OF_HEADER + 1 if (case.flow_free or 0) >= _ENOUGH else 2):
        parts = _divided(case, 0, case.request, lost)
        solved = any(part.verdict.repaired is not None for part in parts)
        if len(parts) > 1 and solved:
            return parts
    return []


def _divided(case: DamagedFrame, at: int, pending: bytes | None, lost: int) -> list[DividedFrame]:
    """The frames from one place on; none where not all of it comes out. `lost`: bytes of a header, at most."""
    for part in _first_parts(case, at, pending, lost):
        end = part.start + part.length
        if end == len(case.data):
            return [part]
        if rest := _divided(case, end, asked_by(part.verdict, pending), lost):
            return [part, *rest]
    return []


def _first_parts(case: DamagedFrame, at: int, pending: bytes | None, lost: int) -> Iterator[DividedFrame]:
    """What may stand first: the likeliest that a check value proves; then, where an answer is due, lengths of it that
    may be left, of which only what comes behind can tell one."""
    rest = replace(case, data=case.data[at:], role=None, request=pending, errors=())
    found = [
        DividedFrame(at, length, verdict)
        for length in _lengths(rest, lost)
        for verdict in swallowed(replace(rest, data=rest.data[:length]))
        if verdict.bits >= FRAME and (verdict.repaired is not None or verdict.length == rest.due)
    ]
    solved = [part for part in found if part.verdict.repaired is not None]
    if solved:
        yield max(solved, key=lambda part: part.verdict.bits)
    yield from (part for part in found if part.verdict.repaired is None)


def asked_by(verdict: Explanation, pending: bytes | None) -> bytes | None:
    """The request that a frame was before flow control robbed it: the tap alone did not hear it, and its unit answers.

    `pending` is the request that waited for its answer before it. None where the frame is an answer, or not known.
    """
    if verdict.code != "flow-control-loss" or verdict.repaired is None:
        return None
    length = predicted_length(verdict.repaired, Role.REQUEST)
    expected = DamagedFrame(b"", request=pending).expected
    answers = expected is not None and expected.fits(verdict.repaired)
    return verdict.repaired if not answers and length is not None and length.length == len(verdict.repaired) else None


def _lengths(case: DamagedFrame, most: int) -> list[int]:
    """How many bytes the first frame may have left, the shortest first."""
    lengths = set()
    due = case.due or 0
    left = {due - lost for lost in range(1, _most_lost(due) + 1)}
    for header in _headers(case.data[:_HEADER], most):
        for role in Role:
            length = predicted_length(header, role)
            if length is not None and not length.least:
                lengths.add(length.length)
    left.update(length - lost for length in lengths for lost in range(1, _LOST + 1))
    return sorted(length for length in left if MIN_ADU - 1 <= length <= len(case.data))


def _headers(data: bytes, most: int) -> Iterator[bytes]:
    """A header as it stands, and with up to so many bytes put back at places before its end."""
    yield data
    for at in range(len(data)) if most else ():
        for value in XON_XOFF:
            for rest in _headers(data[at:], most - 1):
                yield data[:at] + bytes((value,)) + rest
