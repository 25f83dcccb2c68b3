"""Windows that could be frames of functions whose length nobody has declared.

Nothing predicts where such a frame ends, and one window in 65,536 checks by chance, so only windows between places
where frames are known to begin or end count: a silence, another candidate, the end of the bytes. Two such frames
back to back (a request and its answer, one unit, one function) may share an end that nothing else marks.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence, Set
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.declaration import USER_DEFINED
from dissectors.lengths import Role, rule

from .candidates import GLITCHES, ZERO_BITS
from .lattice import Candidate
from .places import Places, next_byte
from .prefix import Windows
from .rules import MAX_ADU, MIN_ADU, Mask

_UNHEARD: Final = -8.0  # bits: functions that nobody declared are rare
_HEARD: Final = 2.0  # this one was on this bus before
_USER: Final = re.compile(b"[%s]" % re.escape(bytes(sorted(USER_DEFINED))), re.DOTALL)
_USER_BITS: Final = 3.0


def open_length(function: int, role: Role) -> bool:
    """Whether nothing says how long a frame of this function is."""
    declared = rule(function, role)
    return declared is None or declared.variable or (declared.base is None and declared.walk is None)


def unknown_windows(
    data: bytes,
    crc: Windows,
    at: int,
    places: Places,
    candidates: Sequence[Candidate],
    heard: Set[int],
    may: Mask,
) -> list[Candidate]:
    """Candidates of undeclared length in `data`, which begins at index `at` of the windows.

    `heard` are such functions that this bus has used before, `may` tells where windows may check (`prefix.opening`).
    """
    n = len(data)
    begins, ends = places.begins, places.ends
    loose = {i - 1 for i in map(re.Match.start, _USER.finditer(data, 1))}
    for function in heard - USER_DEFINED:
        loose.update(i for i in range(n - 1) if data[i + 1] == function)
    taken = {c.start for c in candidates}
    tails, heads = crc.tails[at : at + n + 1], crc.heads[at : at + n]
    some = {i for i in begins | loose if i + MIN_ADU <= n and may[i]}
    windows = _checking(tails, heads, sorted(some))
    found: dict[tuple[int, int], None] = {}
    for begin in sorted(some - taken):
        function = data[begin + 1]
        if function & 0x80 or not function or not any(open_length(function, role) for role in Role):
            continue
        for end in windows[begin]:
            if (end in ends and begin in begins) or function in heard:
                found[begin, end] = None
                continue
            follow = next_byte(data, end)
            if follow + MIN_ADU <= n and data[follow] == data[begin] and data[follow + 1] == function:
                if follow not in windows:
                    windows |= _checking(tails, heads, [follow])
                for second in windows[follow]:
                    if second in ends:
                        found[begin, end] = found[follow, second] = None
    result = []
    for begin, end in found:
        if GLITCHES.issuperset(data[begin:end]):
            continue
        function = data[begin + 1]
        bits = (_HEARD if function in heard else _UNHEARD) + (_USER_BITS if function in USER_DEFINED else 0.0)
        bits += ZERO_BITS * _zeros(data, begin, end, found)
        result += [Candidate(begin, end, role, bits, declared=False) for role in Role if open_length(function, role)]
    return result


def _checking(tails: NDArray[np.uint16], heads: NDArray[np.uint16], begins: Sequence[int]) -> dict[int, list[int]]:
    """For each place in `begins` the ends of the windows from there whose CRC is right."""
    found: dict[int, list[int]] = {begin: [] for begin in begins}
    if begins:
        ends = np.array(begins)[:, None] + np.arange(MIN_ADU, MAX_ADU + 1)
        right = (tails.take(ends, mode="clip") == heads.take(begins)[:, None]) & (ends < len(tails))
        for row, end in zip(np.nonzero(right)[0].tolist(), ends[right].tolist(), strict=True):
            found[begins[row]].append(end)
    return found


def _zeros(data: bytes, begin: int, end: int, found: Collection[tuple[int, int]]) -> int:
    """How many of the last bytes are zeros behind a window that checks as well: likelier stray bytes than a CRC."""
    count = 0
    while data[end - 1 - count] == 0 and (begin, end - 1 - count) in found:
        count += 1
    return count
