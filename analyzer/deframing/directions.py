"""Which way a port's frames go: said with the capture, or settled by frames that cannot be taken for the other kind."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.line import BY_MARKS, DIRECTIONS_NOTE, LineSettings
from dissectors.length_rules import Role

from ..tables.schema import Kind, Rows
from .rules import Bytes, length_tables

_ROLES: Final = {"request": Role.REQUEST, "response": Role.RESPONSE}
_SHARE: Final = 8  # certain frames of one kind, for each of the other, on a port that carries one direction
_FEW: Final = 2  # certain frames are no chance, nor are pairs of like frames


def port_role(line: LineSettings, port: int) -> Role | None:
    """The only role that frames of a port have; None where it hears both directions."""
    return _ROLES.get(_said(line, port))


def told_by_marks(line: LineSettings, port: int) -> bool:
    """Whether the marks of a port's bytes say who asks and who answers, as those of a network's packets do."""
    return _said(line, port) == BY_MARKS


def _said(line: LineSettings, port: int) -> str:
    words = line.notes.get(DIRECTIONS_NOTE, "").split(",")
    return words[port].strip() if port < len(words) else ""


def said_directions(line: LineSettings) -> tuple[int, int] | None:
    """The port of requests and the port of answers, where the capture tells of one each."""
    ports = {port_role(line, port): port for port in range(line.notes.get(DIRECTIONS_NOTE, "").count(",") + 1)}
    if Role.REQUEST in ports and Role.RESPONSE in ports:
        return ports[Role.REQUEST], ports[Role.RESPONSE]
    return None


def certain_frames(rows: Rows) -> NDArray[np.bool_]:
    """Which rows are whole frames of declared functions that do not look like one of the other kind."""
    found: NDArray[np.bool_] = (rows.kind != Kind.NOISE) & rows.check
    found &= length_tables().certain.take(rows.function)
    return found


def either_way(rows: Rows) -> NDArray[np.bool_]:
    """Which rows are whole frames that read alike in both directions, as a write and its echo do."""
    tables = length_tables()
    alike = (tables.known & ~tables.certain).take(rows.function)
    found: NDArray[np.bool_] = (rows.kind != Kind.NOISE) & rows.check & alike & (rows.exception == 0)
    return found


def settled_directions(rows: Rows, data: Bytes, ports: tuple[int, int]) -> tuple[int, int] | None:
    """The port that carries requests and the one that carries answers, where each carries one direction.

    `rows`: the first ones of both, as they were heard.
    """
    certain, kind, port = certain_frames(rows), rows.kind, rows.port
    counts = [[int((certain & (port == p) & (kind == k)).sum()) for k in (Kind.REQUEST, Kind.RESPONSE)] for p in ports]
    (asked, answered), (others_asked, others_answered) = counts
    first = asked - _SHARE * answered, answered - _SHARE * asked
    second = others_asked - _SHARE * others_answered, others_answered - _SHARE * others_asked
    for (asks, answers), (other_asks, other_answers), found in (
        (first, second, ports),
        (second, first, ports[::-1]),
    ):
        contrary = answers > 0 or other_asks > 0
        if not contrary and min(asks, other_answers) >= 0 and max(asks, other_answers) >= _FEW:
            return found
    if any(map(any, counts)):
        return None
    return _by_echoes(rows, data, ports)


def _by_echoes(rows: Rows, data: Bytes, ports: tuple[int, int]) -> tuple[int, int] | None:
    """The same where every frame looks like its echo: an echo follows soon, the next request later.

    Clocks and late reads may swap a pair, so most of those that are each other's nearest decide.
    """
    frames = rows[either_way(rows)]
    ends: list[dict[bytes, list[int]]] = [{}, {}]
    for at, length, port, t_end_ns in zip(frames.at, frames.length, frames.port, frames.t_end_ns, strict=True):
        if port in ports:
            ends[ports.index(port)].setdefault(data[at : at + length].tobytes(), []).append(int(t_end_ns))
    behind = []  # ns by which a frame of the second port comes behind its like on the first
    for text in ends[0].keys() & ends[1].keys():
        first, second = ends[0][text], ends[1][text]
        nearest = [_nearest(second, t_ns) for t_ns in first]
        behind += [other - t_ns for t_ns, other in zip(first, nearest, strict=True) if _nearest(first, other) == t_ns]
    if len(behind) < _FEW:
        return None
    return ports if float(np.median(behind)) >= 0 else ports[::-1]


def _nearest(times: list[int], t_ns: int) -> int:
    return min(times, key=lambda other: abs(other - t_ns))
