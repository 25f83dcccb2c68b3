"""A paste of several envelopes: which part of it is in which, and those of each read as one stream.

A request may stand in one line, its answer behind lines of another envelope; a frame never does: what would reach over
bytes of another envelope is no frame, and the stretches between them are read each alone.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import accumulate, groupby, pairwise
from typing import Final, Literal, NamedTuple

from .model import Paste, PastedFrame, PastedNoise, PastePart, Piece

Envelope = Literal["auto", "rtu", "ascii", "tcp", "pdu"]
Reading = Callable[[Sequence[PastePart], Envelope], Paste]
_REASONS: Final = 3  # of the readings of stretches that are told


class _EnvelopeStretch(NamedTuple):
    """Parts of one envelope that follow one another: where they begin in their envelope's stream, and in the paste."""

    parts: Sequence[PastePart]
    begin: int
    start: int


def kinds_of(parts: Sequence[PastePart]) -> list[Envelope]:
    """The envelope of each part by its own check values; a part that has none is of that before it, or behind."""
    from .evidence import envelope_of

    own = [envelope_of(part.data) for part in parts]
    latest: Envelope = next((kind for kind in own if kind is not None), "auto")
    kinds: list[Envelope] = []
    for kind in own:
        latest = kind or latest
        kinds.append(latest)
    return kinds


def mixed(parts: Sequence[PastePart], kinds: Sequence[Envelope], read: Reading) -> Paste:
    """Parts of several envelopes, those of each read by `read`."""
    pieces: list[Piece] = []
    why = []
    for kind in dict.fromkeys(kinds):
        stretches = list(_stretches(parts, kinds, kind))
        paste = read([part for stretch in stretches for part in stretch.parts], kind)
        if _undivided(paste.pieces, stretches):
            why.append(paste.why)
            pieces += _placed(paste.pieces, stretches)
            continue
        alone = [read(stretch.parts, kind) for stretch in stretches]
        why += list(dict.fromkeys(paste.why for paste in alone))[:_REASONS]
        for stretch, paste in zip(stretches, alone, strict=True):
            pieces += _placed(paste.pieces, [stretch._replace(begin=0)])
    first = max(dict.fromkeys(kinds), key=kinds.count)
    return Paste(
        "rtu" if first == "auto" else first, "; ".join(why), tuple(sorted(pieces, key=lambda piece: piece.start))
    )


def _stretches(parts: Sequence[PastePart], kinds: Sequence[Envelope], kind: Envelope) -> Iterator[_EnvelopeStretch]:
    starts = [0, *accumulate(len(part.data) for part in parts)]
    begin = 0
    for own, group in groupby(range(len(parts)), lambda i: kinds[i] == kind):
        if own:
            mine = list(group)
            yield _EnvelopeStretch([parts[i] for i in mine], begin, starts[mine[0]])
            begin += starts[mine[-1] + 1] - starts[mine[0]]


def _undivided(pieces: Sequence[Piece], stretches: Sequence[_EnvelopeStretch]) -> bool:
    """Whether each frame lies in one stretch."""
    begins = [stretch.begin for stretch in stretches]
    return all(
        bisect_right(begins, piece.start) == bisect_right(begins, piece.start + piece.length - 1)
        for piece in pieces
        if isinstance(piece, PastedFrame)
    )


def _placed(pieces: Sequence[Piece], stretches: Sequence[_EnvelopeStretch]) -> Iterator[Piece]:
    """Pieces of an envelope's stream in the bytes of all; noise is divided where bytes of others lie between."""
    begins = [stretch.begin for stretch in stretches]

    def moved(at: int) -> int:
        stretch = stretches[bisect_right(begins, at) - 1]
        return stretch.start + at - stretch.begin

    for piece in pieces:
        start = moved(piece.start)
        if isinstance(piece, PastedFrame):
            request_at = None if piece.request_start is None else moved(piece.request_start)
            yield replace(piece, start=start, adu=replace(piece.adu, start=start), request_start=request_at)
            continue
        end = piece.start + piece.length
        inner = begins[bisect_right(begins, piece.start) : bisect_left(begins, end)]
        for first, last in pairwise([piece.start, *inner, end]):
            yield PastedNoise(moved(first), piece.data[first - piece.start : last - piece.start])
