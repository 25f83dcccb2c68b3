"""flow-control-loss: the capturing port has XON/XOFF on, and eats every 11 and every 13.

Up to three lost bytes are solved: put in where they make length and CRC right. What gives this away beyond doubt is
the port's whole stream, which then holds neither of them (`Case.flow_free`): from that on, frames that miss more are
explained by it too.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import comb, inf, log2
from typing import Final

from dissectors.lengths import Role, pdu_length
from dissectors.syndromes import byte_between, stepped

from .case import MAX_ADU, OVERHEAD, Case
from .sent import BYTE, likelihood
from .verdict import Place, Verdict

XON_XOFF: Final = frozenset((0x11, 0x13))
_PRIOR: Final = -4.0
_SEEN: Final = -16.0  # bits: this port does let them through
_NONE_YET: Final = 1.5  # bits: it has not let one through so far
_A_BYTE: Final = 0.0085  # bits that each byte says which is neither: one in 170 should be
_MOST: Final = 10.0  # bits that their absence is worth
_ENOUGH: Final = 400  # bytes, to go by their absence alone
_RARE: Final = 7.0  # bits: one byte in 128
_REACH: Final = {1: MAX_ADU, 2: 64, 3: 14}  # lost bytes: the longest stretch that is searched for so many
_MOST_LOST: Final = 24

Fit = tuple[float, tuple[Place, ...], bytes]


def swallowed(case: Case) -> Iterator[Verdict]:
    """The frame with its 11 and 13 bytes put back."""
    if XON_XOFF.intersection(case.data) or len(case.data) >= MAX_ADU:
        return
    prior = _PRIOR
    if case.flow_free is not None:
        prior += min(_NONE_YET + _A_BYTE * case.flow_free, _MOST) if case.flow_free else _SEEN
    fits = [fit for lost, reach in _REACH.items() if len(case.data) <= reach for fit in _solved(case, lost)]
    if fits:
        best = max(fits)
        bits = best[0] + log2(sum(2.0 ** (bits - best[0]) for bits, _, _ in fits))
        yield Verdict("flow-control-loss", prior + bits, repaired=best[2], places=best[1], lost=len(best[1]))
    elif (case.flow_free or 0) >= _ENOUGH:
        yield from _supposed(case, prior)


def _solved(case: Case, lost: int) -> Iterator[Fit]:
    """All ways to put in `lost` bytes that make a frame which could have been sent."""
    for places in _insertions(case, 0, case.before[0], lost):
        frame = bytearray(case.data)
        for place in places:
            frame.insert(place.first, place.value)
        bits = 16.0 - BYTE * lost + likelihood(bytes(frame), case)
        if bits > -inf:
            yield bits, places, bytes(frame)


def _insertions(case: Case, start: int, register: int, lost: int, done: int = 0) -> Iterator[tuple[Place, ...]]:
    """Ways to put in `lost` more bytes from `start` on, where the CRC has come to `register`, so that it ends in 0."""
    data, needed = case.data, case.needed
    for at in range(start, len(data) + 1):
        if lost == 1:
            value = byte_between(register, needed[at])
            if value in XON_XOFF and value is not None:
                yield (Place(at + done, at + done, value),)
        else:
            for value in XON_XOFF:
                for rest in _insertions(case, at, stepped(register, value), lost - 1, done + 1):
                    yield (Place(at + done, at + done, value), *rest)
        if at < len(data):
            register = stepped(register, data[at])


def _supposed(case: Case, prior: float) -> Iterator[Verdict]:
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
    if 1 <= lost <= min(_MOST_LOST, length // 4) and not searched:
        yield Verdict(
            "flow-control-loss", prior + bits + log2(comb(length, lost)) - _RARE * lost, length=length, lost=lost
        )
