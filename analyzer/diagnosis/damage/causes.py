"""All explanations tried against each other: the likeliest is the verdict.

Each says how likely it makes the captured bytes, as log2 of a probability over bytes that nothing predicts: the price
of the damage (how often it happens, in how many ways it could have), and what is gained by the frame that it takes to
have been sent (`sent.likelihood`) with its two bytes of CRC, which then are no accident. "Nothing simple explains it"
(crc-error) is one of them and must be beaten. A new explanation is a file and an entry in `_EXPLANATIONS`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import inf, log2
from typing import Final, NamedTuple

from dissectors.crc import VARIANTS, byte_between, crc_bytes, flipped_bit, matching
from dissectors.length_rules import Role
from dissectors.limits import EXCEPTION, EXCEPTION_ADU, MAX_ADU

from ...tables.schema import GLITCHES
from .case import (
    BYTE,
    LENGTH_TOLD,
    RECURS,
    REFUSED,
    ByteRepair,
    DamagedFrame,
    Explanation,
    Length,
    agrees,
    answer_length,
    has_count,
    likelihood,
    opening,
    predicted_length,
)
from .flow_control import swallowed

# Several places that explain the same bytes: one verdict, all of them said, the likeliest first.


_EQUAL = 6.0  # bits below the likeliest, within which a place is still named


def gathered(code: str, fits: Sequence[tuple[float, ByteRepair, bytes]]) -> Iterator[Explanation]:
    """The verdict over all places that fit, as (bits, place, repaired frame); none where nothing fits."""
    if not fits:
        return
    ranked = sorted(fits, key=lambda fit: -fit[0])
    best, _, frame = ranked[0]
    near = [fit for fit in ranked if fit[0] >= best - _EQUAL]
    bits = best + log2(sum(2.0 ** (fit[0] - best) for fit in near))
    yield Explanation(code, bits, repaired=frame, places=tuple(repair for _, repair, _ in near))


# bit-flip: one bit, named by the CRC's syndrome, was not received as sent; it may be one of the CRC's own.


_MARKED = 6.0  # bits: the UART complained of that very byte


def flipped(case: DamagedFrame) -> Iterator[Explanation]:
    """The one bit that makes the CRC right, if there is one and the frame could have been sent."""
    data = case.data
    if len(data) > MAX_ADU or (flip := flipped_bit(case.before[-1], len(data))) is None:
        return
    byte, bit = flip
    sent = bytearray(data)
    sent[byte] ^= 1 << bit
    frame = bytes(sent)
    bits = 16.0 + likelihood(frame, case) - log2(8 * len(data)) + (_MARKED if byte in case.errors else 0.0)
    yield Explanation("bit-flip", bits, repaired=frame, byte=byte, bit=bit)


# byte-missing: one byte was lost; the CRC, being linear, tells its value for each place where it could have stood.
#
# At one place in 256 a value exists at all, so that in a long frame a few places fit by chance: those that would make
# a frame which nobody sends fall away, and the rest are all said. In a run of equal bytes every place gives the same
# frame.


def missing(case: DamagedFrame) -> Iterator[Explanation]:
    """One byte put in, wherever that makes length and CRC match."""
    data = case.data
    if len(data) >= MAX_ADU:
        return
    fits: list[tuple[float, ByteRepair, bytes]] = []
    for at, (before, after) in enumerate(zip(case.before, case.needed, strict=True)):
        value = byte_between(before, after)
        if value is None or (at and data[at - 1] == value):
            continue  # none here, or the same run as the place before
        last = at
        while last < len(data) and data[last] == value:
            last += 1
        frame = data[:at] + bytes((value,)) + data[at:]
        bits = 8.0 + likelihood(frame, case) + log2(last - at + 1) - log2(len(frame))
        if bits > -inf:
            fits.append((bits, ByteRepair(at, last, value), frame))
    yield from gathered("byte-missing", fits)


# byte-extra: one byte too many, and the frame is right without it.


_PRIOR_BYTE_EXTRA = -1.0


def extra(case: DamagedFrame) -> Iterator[Explanation]:
    """One byte taken out, wherever that makes length and CRC match."""
    data, before, needed = case.data, case.before, case.needed
    if len(data) > MAX_ADU + 1:
        return
    fits: list[tuple[float, ByteRepair, bytes]] = []
    for at, value in enumerate(data):
        if before[at] != needed[at + 1] or (at and data[at - 1] == value):
            continue  # not right without it, or the same run as the place before
        last = at
        while last + 1 < len(data) and data[last + 1] == value:
            last += 1
        frame = data[:at] + data[at + 1 :]
        bits = _PRIOR_BYTE_EXTRA + 16.0 + likelihood(frame, case) + log2(last - at + 1) - log2(len(data))
        if bits > -inf:
            fits.append((bits, ByteRepair(at, last, value), frame))
    yield from gathered("byte-extra", fits)


# bytes-repeated: a slice of the frame came twice in a row (a buffer bug in a converter), and it is right with one.


_PRIOR_REPEATED = -2.0
_SLICE_LENGTH_BITS = 6.0  # bits: how long the slice is
_SHORTEST_SLICE = 2


def repeated(case: DamagedFrame) -> Iterator[Explanation]:
    """One copy of a doubled slice taken out, wherever that makes length and CRC right; the likeliest."""
    data = case.data
    if len(data) > 2 * MAX_ADU:
        return
    ends: defaultdict[int, list[int]] = defaultdict(list)
    for offset, register in enumerate(case.needed):
        ends[register].append(offset)
    best: Explanation | None = None
    for start, register in enumerate(case.before):
        for end in ends.get(register, ()):
            length = end - start
            if length < _SHORTEST_SLICE or data[start:end] != data[end : end + length]:
                continue
            frame = data[:start] + data[end:]
            bits = _PRIOR_REPEATED - _SLICE_LENGTH_BITS + 8.0 * (length + 2) + likelihood(frame, case) - log2(len(data))
            if bits > -inf and (best is None or bits > best.bits):
                best = Explanation("bytes-repeated", bits, repaired=frame, byte=start, length=length)
    if best is not None:
        yield best


# crc-variant: the check value is correct under another convention: the device's firmware is wrong, the line is not.


_PRIOR_VARIANT = -3.0


def other_conventions(case: DamagedFrame) -> Iterator[Explanation]:
    """The conventions by which the last two bytes are right."""
    data = case.data
    if len(data) > MAX_ADU:
        return
    frame = data[:-2] + crc_bytes(data[:-2])
    bits = _PRIOR_VARIANT + 16.0 + likelihood(frame, case) - log2(len(VARIANTS))
    if bits == -inf:  # nobody sends such a frame, whatever its check value
        return
    for variant in matching(data):
        yield Explanation("crc-variant", bits, repaired=frame, variant=variant.name)


# truncated: it starts like a frame of N bytes and ends after M.
#
# N is what the pending request asked for, what the header predicts, or the length of a frame that was seen before and
# began so. One byte short is byte-missing's as well, which says more where a byte makes it right.


_PRIOR_TRUNCATED = -1.0
_ONE_SHORT = -3.0  # and no byte makes it right: then more than its end is wrong
_LEAST = 2  # bytes, to be known by


def truncated(case: DamagedFrame) -> Iterator[Explanation]:
    """The frame that these bytes begin."""
    data = case.data
    if len(data) < _LEAST:
        return
    candidates = [(bits, length) for bits, length in _beginnings(case) if len(data) < length.length <= MAX_ADU]
    if candidates:
        bits, length = max(candidates)
        bits += _PRIOR_TRUNCATED - log2(length.length) + (_ONE_SHORT if length.length == len(data) + 1 else 0.0)
        yield Explanation("truncated", bits, length=length.length, at_least=length.least)


def _beginnings(case: DamagedFrame) -> Iterator[tuple[float, Length]]:
    """What these bytes may begin, with the bits for it."""
    data = case.data
    due = answer_length(case)
    if due is not None and case.header[: len(data)] == data[: len(case.header)]:
        yield BYTE * min(len(case.header), len(data)), due
    for role in Role:
        length = predicted_length(data, role)
        if length is not None:
            yield opening(data, role, case), length
    same = [frame for frame in case.known if frame.startswith(data) and len(frame) > len(data)]
    if same:
        longest = max(same, key=len)
        yield BYTE * len(data) + log2(len(same) / len(case.known)) + RECURS, Length(len(longest))


# collision: garbage where an answer was due, because two transmitters spoke at once.
#
# Three signatures, all against the answer that the pending request asked for: it is longer than that answer can be;
# its first bytes, which are known beforehand, lack 1 bits and gained none (either driver's 0 wins); or they are just
# not those of an answer.


_PRIOR_COLLISION = -2.0
_LONGER = -2.0  # the answer's own start survived
_SHORTER = -6.0  # two that overlap don't shorten each other
_SHORTEST_GARBAGE = 3  # bytes: less is a glitch


def collided(case: DamagedFrame) -> Iterator[Explanation]:
    """Whether this looks like two answers, or an answer and something else, at once."""
    header, data = case.header, case.data
    if not header or len(data) < _SHORTEST_GARBAGE:
        return
    bits = 0.0
    pairs = list(zip(header, data, strict=False))
    lacking = all(got & ~due == 0 for due, got in pairs) and not GLITCHES.issuperset(data[: len(header)])
    if lacking and data[: len(header)] != header[: len(data)]:
        bits = BYTE * len(pairs) - sum(due.bit_count() for due, _ in pairs)
        bits += _SHORTER if case.due is not None and len(data) < case.due else 0.0
    if case.due is not None and len(data) > case.due + 1 and data.startswith(case.header[:2]):
        bits = max(bits, BYTE * sum(due == got for due, got in pairs) + _LONGER)
    yield Explanation("collision", _PRIOR_COLLISION + bits, length=case.due)


# crc-error: a frame is there, its CRC is wrong, and nothing simple explains it.
#
# The other explanations have to beat this one: several bits flipped, a burst, a check value that is merely wrong. What
# the header should have been is known where an answer was due; each bit of it that differs has to be one of the few
# that flipped.


_PRIOR_UNEXPLAINED = -1.0
_NO_HEADER = -3.0  # bytes that don't begin like anything
_WRONG_LENGTH = -10.0  # damage of no simple kind seldom changes how long a frame is


def unexplained(case: DamagedFrame) -> Iterator[Explanation]:
    """The verdict that is always possible."""
    yield Explanation("crc-error", _PRIOR_UNEXPLAINED + max(_answer(case), _any_frame(case)))


def _answer(case: DamagedFrame) -> float:
    """log2 of how likely this is the answer that was due, or an exception, some bits of it flipped."""
    if case.expected is None:
        return -inf
    refused = bytes((case.expected.unit, case.expected.function | EXCEPTION))
    return max(
        _flips(case.header, case.data) + (0.0 if agrees(answer_length(case), case.data) else _WRONG_LENGTH),
        _flips(refused, case.data) + REFUSED + (0.0 if len(case.data) == EXCEPTION_ADU else _WRONG_LENGTH),
    )


def _flips(due: bytes, data: bytes) -> float:
    """log2 of how likely bits flipped to make these bytes of ones that begin so."""
    flipped = sum((a ^ b).bit_count() for a, b in zip(due, data, strict=False))
    if flipped < 2 and len(due) >= len(data):
        flipped += 2  # nothing else of it can differ, and one bit would have been found
    return BYTE * min(len(due), len(data)) - flipped * log2(8 * len(data))


def _any_frame(case: DamagedFrame) -> float:
    """log2 of how likely any frame that was sent here begins, and is as long, as these bytes."""
    data, best = case.data, _NO_HEADER
    for role in Role:
        bits = opening(data, role, case)
        length = predicted_length(data, role)
        if not agrees(length, data):
            bits += _WRONG_LENGTH
        elif length is not None and has_count(data[1], role):
            bits += LENGTH_TOLD
        best = max(best, bits)
    return best


# Where does the damaged frame begin and end? Damage moves its boundaries, and a deframer can't always follow.
#
# A byte too many leaves the last one over as noise; a flipped byte count cuts a frame short or long. So the noise that
# touches a damaged frame is tried as part of it: an explanation of more bytes is worth more, bytes left over cost a
# little, being noise.


_LEFT_OVER: Final = -3.0  # bits, for each stretch that stays noise


class Joined(NamedTuple):
    """A verdict on more than the bytes of the case: with so many of the noise before, and of the noise after them."""

    verdict: Explanation
    before: int
    after: int


def joined(case: DamagedFrame, before: bytes = b"", after: bytes = b"") -> Joined:
    """The likeliest explanation of a damaged frame alone, or with the noise before it, after it, or both.

    Offsets in the verdict count from the first byte that it speaks of.
    """
    candidates = []
    for head in dict.fromkeys((b"", before)):
        for tail in dict.fromkeys((b"", after)):
            errors = tuple(at + len(head) for at in case.errors)
            verdict = autopsy(replace(case, data=head + case.data + tail, errors=errors))
            left = (head != before) + (tail != after)
            candidates.append((verdict.bits + left * _LEFT_OVER, -left, Joined(verdict, len(head), len(tail))))
    return max(candidates, key=lambda one: one[:2])[2]


_EXPLANATIONS: Final[tuple[Callable[[DamagedFrame], Iterator[Explanation]], ...]] = (
    unexplained,
    flipped,
    missing,
    extra,
    repeated,
    swallowed,
    truncated,
    other_conventions,
    collided,
)
_NEAR: Final = 10.0  # bits below the verdict: further ones are not worth telling


def autopsy(case: DamagedFrame) -> Explanation:
    """The likeliest explanation, with its `certainty` and the `rivals` that come near, the nearest first.

    For bytes whose CRC is wrong; what is right needs no autopsy and comes out as crc-error with certainty 0.
    """
    if not case.data or not case.before[-1]:
        return Explanation("crc-error", -inf)
    verdicts = [verdict for explain in _EXPLANATIONS for verdict in explain(case) if verdict.bits > -inf]
    verdicts.sort(key=lambda verdict: -verdict.bits)
    best = verdicts[0]
    weights = [2.0 ** (verdict.bits - best.bits) for verdict in verdicts]
    total = sum(weights)
    near = [
        replace(verdict, certainty=weight / total)
        for verdict, weight in zip(verdicts[1:], weights[1:], strict=True)
        if verdict.bits >= best.bits - _NEAR
    ]
    return replace(best, certainty=weights[0] / total, rivals=tuple(near))
