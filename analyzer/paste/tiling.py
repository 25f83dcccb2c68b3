"""Frames of RTU, end to end, in a small paste: plain Python, no arrays.

A window is a frame if its CRC is right and its length is the one that its header predicts, or the one that the paste
itself delimits (a line of a log) where the function has none. If the windows tile the paste in exactly one way, that is
its reading and nothing else need be asked; if not, the deframer has to weigh.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from dissectors.adu import CRC_SIZE, EXCEPTION, MAX_ADU, MIN_ADU, OVERHEAD
from dissectors.crc import crc_ok
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length, plausibility, rule

LIMIT: Final = 1024  # bytes; a longer paste is the deframer's


class Window(NamedTuple):
    """Bytes [start, end) whose CRC is right, and the roles that they can have."""

    start: int
    end: int
    roles: tuple[Role, ...]


def predicted(data: bytes, role: Role) -> int | None:
    """Length of the ADU that begins with `data`: None while the header is not whole, -1 where there is none to tell."""
    declared = rule(data[1], role) if len(data) > 1 else None
    if len(data) > 1 and declared is None:
        return -1
    length = pdu_length(data[1:], role) if len(data) > 1 else None
    if length is None:
        return None
    return length + OVERHEAD if length >= 0 else -1


def windows(data: bytes, cuts: Iterable[int], roles: Sequence[Role]) -> list[Window]:
    """All windows that can be frames; `cuts` are the offsets at which the paste itself is divided.

    Over a cut none is a frame that breaks a limit, nor over the end of one that breaks none: a right answer and the 00
    behind it have a right CRC together.
    """
    edges = sorted({0, len(data), *cuts})
    candidates: dict[tuple[int, int], list[Role]] = {}
    for start in range(len(data) - MIN_ADU + 1):
        head = data[start : start + MAX_ADU]
        right: list[tuple[int, Role, bool]] = []
        for role in roles:
            length = predicted(head, role)
            if length is None or not MIN_ADU <= length <= len(data) - start:
                continue
            end = start + length
            if crc_ok(data[start:end]):
                right.append((end, role, not plausibility(data[start + 1 : end - CRC_SIZE], role)))
        limit = min((end for end, _, legal in right if legal), default=edges[bisect_right(edges, start)])
        for end, role, legal in right:
            if legal or end <= limit:
                candidates.setdefault((start, end), []).append(role)
    for start, end in pairwise(edges):
        if (
            MIN_ADU <= end - start <= MAX_ADU
            and crc_ok(data[start:end])
            and not any(start <= w[0] and w[1] <= end for w in candidates)
        ):
            candidates[start, end] = [role for role in roles if role is Role.RESPONSE or data[start + 1] < EXCEPTION]
    return [Window(start, end, tuple(roles)) for (start, end), roles in sorted(candidates.items()) if roles]


def tiling(windows: Sequence[Window], length: int) -> list[Window] | None:
    """The one way to tile [0, length) with windows; None where there is none, or several."""
    ways = {length: 1}
    following: dict[int, Window] = {}
    for window in sorted(windows, reverse=True):
        if onward := ways.get(window.end, 0):
            ways[window.start] = ways.get(window.start, 0) + onward
            following[window.start] = window
    if ways.get(0, 0) != 1 or not length:
        return None
    path = []
    at = 0
    while at < length:
        path.append(following[at])
        at = following[at].end
    return path
