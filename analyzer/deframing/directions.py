"""Which way a port's frames go: said with the capture, or settled by frames that cannot be taken for the other kind."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings
from dissectors.length_rules import Role

from ..tables.schema import Kind, Rows
from .rules import Bytes, length_tables

DIRECTIONS_NOTE: Final = "directions"  # of a line: the direction of each port, in order: `request,response`
_ROLES: Final = {"request": Role.REQUEST, "response": Role.RESPONSE}
_SHARE: Final = 8  # certain frames of one kind, for each of the other, on a port that carries one direction
_FEW: Final = 2  # certain frames are no chance; pairs of like frames by which the times tell


def port_role(line: LineSettings, port: int) -> Role | None:
    """The only role that frames of a port have; None where it hears both directions."""
    words = line.notes.get(DIRECTIONS_NOTE, "").split(",")
    return _ROLES.get(words[port].strip()) if port < len(words) else None


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
    """The same where every frame looks like its echo: an echo follows soon, the next request later."""
    frames = rows[either_way(rows)]
    texts = [data[at : at + length].tobytes() for at, length in zip(frames.at, frames.length, strict=True)]
    waits: dict[int, list[int]] = {port: [] for port in ports}
    for i in range(1, len(frames)):
        port = int(frames.port[i - 1])
        if port != frames.port[i] and texts[i - 1] == texts[i] and port in waits:
            waits[port].append(int(frames.t_start_ns[i]) - int(frames.t_end_ns[i - 1]))
    first, second = (waits[port] for port in ports)
    if len(first) > max(_FEW - 1, _SHARE * len(second)):
        return ports
    if len(second) > max(_FEW - 1, _SHARE * len(first)):
        return ports[::-1]
    if min(len(first), len(second)) < _FEW:
        return None
    return ports if float(np.median(first)) <= float(np.median(second)) else ports[::-1]
