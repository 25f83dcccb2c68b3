"""collision: garbage where an answer was due, because two transmitters spoke at once.

Three signatures, all against the answer that the pending request asked for: it is longer than that answer can be;
its first bytes, which are known beforehand, lack 1 bits and gained none (either driver's 0 wins); or they are just
not those of an answer.
"""

from __future__ import annotations

from collections.abc import Iterator

from .case import Case
from .sent import BYTE
from .verdict import Verdict

_PRIOR = -2.0
_LONGER = -2.0  # the answer's own start survived
_SHORTER = -6.0  # two that overlap don't shorten each other
_GLITCHES = frozenset((0x00, 0xFE, 0xFF))  # what drivers leave on the line when they switch
_SHORTEST = 3  # bytes: less is a glitch


def collided(case: Case) -> Iterator[Verdict]:
    """Whether this looks like two answers, or an answer and something else, at once."""
    header, data = case.header, case.data
    if not header or len(data) < _SHORTEST:
        return
    bits = 0.0
    pairs = list(zip(header, data, strict=False))
    lacking = all(got & ~due == 0 for due, got in pairs) and not _GLITCHES.issuperset(data[: len(header)])
    if lacking and data[: len(header)] != header[: len(data)]:
        bits = BYTE * len(pairs) - sum(due.bit_count() for due, _ in pairs)
        bits += _SHORTER if case.due is not None and len(data) < case.due else 0.0
    if case.due is not None and len(data) > case.due + 1 and data.startswith(case.header[:2]):
        bits = max(bits, BYTE * sum(due == got for due, got in pairs) + _LONGER)
    yield Verdict("collision", _PRIOR + bits, length=case.due)
