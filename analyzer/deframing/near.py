"""Frames so near to the newest byte that a longer one could still come, taken together where silence says no.

Live, most frames are. The lattice would decide each at its end, once a silence stands there and the bits for it are
enough. Here that is worked out for frames end to end that nothing overlaps, in turns of request and answer, with the
least bits that the lattice could give; the first one that is not plain ends them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from dissectors.lengths import Role

from .candidates import CRC_BITS
from .contest import AGAINST, ALONE
from .conversation import fitting
from .lattice import FITS_BARE, FITS_EXCEPTION, Said
from .rules import Bytes
from .runs import Runs
from .silence import Trust

_UNIT: Final = 4.0  # bits that a unit may cost
STILL: Final = -1  # for a class: the line is silent, and for how long is to be seen
_MOST: Final = 64  # frames at once


def plain_frames(data: Bytes, silences: Sequence[int], runs: Runs, i: int, limit: int, trust: Trust, said: Said) -> int:
    """The first interval from i on that is not plain, or that ends behind `limit`.

    `silences` are the classes before the bytes of `data`, and behind the last one. `said`: the conversation before.
    """
    some = slice(i, i + _MOST)
    starts, ends, roles = runs.start[some].tolist(), runs.end[some].tolist(), runs.role[some].tolist()
    if len(said.pending) != (roles[0] == Role.RESPONSE):  # others that are asked may be answered by more than this
        return i
    if said.pending and (said.answered or said.answers(data[starts[0] : ends[0]].tobytes()) is None):
        return i
    tables = trust.evidence
    n = 0
    for start, end, role, either, structure in zip(
        starts, ends, roles, runs.either[some].tolist(), runs.structure[some].tolist(), strict=True
    ):
        behind = silences[end]
        bits = CRC_BITS + structure + tables[role][silences[start]]
        if role == Role.RESPONSE:
            bits += FITS_EXCEPTION if data[start + 1] & 0x80 else FITS_BARE
        elif data[start]:
            bits -= _UNIT
        else:  # a broadcast, which some answer
            break
        if n and (start != ends[n - 1] or role == roles[n - 1]):
            break
        if either or end > limit or bits < ALONE:
            break
        if not behind or (behind != STILL and all(turn[behind] < AGAINST for turn in tables)):
            break
        n += 1
    if n and n < len(starts) and starts[n] < ends[n - 1]:
        n -= 1  # something overlaps the last one
    first = 1 + (roles[0] == Role.RESPONSE)  # of the answers to a request that is here, too
    answers = np.arange(i + first, i + n, 2)
    if len(answers):
        fits = fitting(data, runs.start[answers - 1], runs.start[answers])
        n = n if fits.all() else first + 2 * int(fits.argmin())
    return i + n
