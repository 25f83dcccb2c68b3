"""Two readings of one place, and which of them is plain without the lattice.

Zeros behind a right CRC leave it right, so a request whose check value ends in 00 reads as a shorter answer too, and an
answer followed by a stray 00 as a longer one. Almost always the frames around tell: the one that begins where one of
the two ends, and answers it; the request before, that one of the two answers. As in `runs`, what is taken here the
lattice would take as well.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role, relations

from .conversation import fitting
from .lattice import FITS, FITS_BARE, FITS_EXCEPTION, HALF, LATE, LEAD, UNASKED
from .rules import Bytes
from .runs import Runs
from .silence import Trust, Turn

_UNIT: Final = 4.0  # bits that a unit may be worth
_ENOUGH: Final = 12.0  # bits over the other one


def plain_one(
    runs: Runs, i: int, data: Bytes, silences: NDArray[np.uint8], trust: Trust, asked: int | None
) -> tuple[int, float] | None:
    """Of the two intervals from i on, the one that is plain, and by how many bits; None where neither is.

    `asked` is where the request begins that has just been asked; None: nothing waits for an answer.
    """
    start, end = runs.start, runs.end
    if i + 2 >= len(start) or start[i + 1] != start[i] or runs.either[i] or runs.either[i + 1]:
        return None
    for mine, other in ((i, i + 1), (i + 1, i)):
        after = int(np.searchsorted(start, end[mine]))
        if after >= len(start) or start[after] != end[mine] or not runs.clean[after] or runs.either[after]:
            continue
        if after > i + 2 or runs.role[mine] == runs.role[other]:
            continue
        more = float(runs.structure[mine]) - float(runs.structure[other])
        before, behind = int(silences[start[i]]), int(silences[start[after]])
        tables = trust.evidence
        if asked is None and runs.role[mine] == Role.REQUEST and runs.role[after] == Role.RESPONSE:
            if fitting(data, start[mine : mine + 1], start[after : after + 1])[0]:
                more += _worth(data, int(start[after])) - (FITS + LATE) - UNASKED
                more += tables[Turn.REQUEST][before] - tables[Turn.RESPONSE][before]
                return (mine, more) if more >= _ENOUGH else None
        elif asked is not None and runs.role[mine] == Role.RESPONSE and runs.role[after] == Role.REQUEST:
            request = data[asked : start[i]].tobytes()
            again = data[start[i] : end[other]].tobytes() == request
            if not again and fitting(data, np.array([asked], np.intp), start[mine : mine + 1])[0]:
                more += _worth(data, int(start[mine])) - _UNIT
                more += tables[Turn.RESPONSE][before] - tables[Turn.AGAIN][before]
                more += min(0.0, tables[Turn.REQUEST][behind] - tables[Turn.AGAIN][behind])
                return (mine, more) if more >= _ENOUGH else None
    return None


def echoed(runs: Runs, i: int, last: int, silences: NDArray[np.uint8], trust: Trust) -> NDArray[np.float64]:
    """By how many bits intervals from i on, before `last`, that read alike are requests and echoes in turn.

    Nothing is asked before them. One number a pair, as long as it is plain that they are.
    """
    table = trust.table
    before, between = silences.take(runs.start[i:last:2]), silences.take(runs.start[i + 1 : last : 2])
    first = table[Turn.REQUEST][before] - table[Turn.RESPONSE][before] - UNASKED
    again = table[Turn.RESPONSE][between] - table[Turn.AGAIN][between] - (trust.unanswered_bits + HALF)
    bits = np.minimum(first[: len(again)], again)
    few: NDArray[np.float64] = bits[: int(np.argmin(np.append(bits, -np.inf) >= LEAD))]
    return few


def _worth(data: Bytes, response: int) -> float:
    """Bits of an answer that fits."""
    function = int(data[response + 1])
    if function & 0x80:
        return FITS_EXCEPTION
    return FITS if relations(function) else FITS_BARE
