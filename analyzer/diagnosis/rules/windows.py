"""Windows with a right CRC that are no frames: chance, or a payload that holds whole frames.

Worth a note, since a tool that looks for right CRCs takes them for frames. Only frames about which the deframer had to
weigh other explanations can hold any; those are searched again, all at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from ...deframing.candidates import search_candidates
from ...deframing.crc_windows import crc_windows
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ..view import DiagnosisStep, where

COLLISION: Final = Rule(
    "crc-collision",
    Severity.NOTE,
    About.FRAME,
    when="a window of bytes has a right CRC, but a better explanation covers it",
    clause="[2] 2.5.1.2",
    numbers=("window_start", "window_length", "windows"),
    text="{window_length:.0f} bytes from byte {window_start:.0f} on have a right CRC, but are part of this frame",
    cause="chance, 1 window in 65,536, or registers that hold a whole frame",
    remedy="nothing: it only misleads tools that look for right CRCs alone",
)


@looks_for(COLLISION)
def inner_windows(view: DiagnosisStep) -> Iterator[Findings]:
    """Frames with such a window inside them."""
    rows, places = view.rows, view.right(where(view.column("contested")))
    if not len(places):
        return
    lengths = rows["length"][places]
    ends = np.cumsum(lengths)
    begins = ends - lengths
    data = view.batch.data[np.repeat(rows["at"][places] - begins, lengths) + np.arange(int(ends[-1]))]
    found = search_candidates(data, crc_windows(data))
    owner = np.searchsorted(ends, found.start, side="right")
    inside = (found.end <= ends[owner]) & (found.start > begins[owner])
    inside &= found.end - found.start < lengths[owner]
    inside[inside] = [data[s:e].any() for s, e in zip(found.start[inside], found.end[inside], strict=True)]
    frames, first, counts = np.unique(owner[inside], return_index=True, return_counts=True)
    if len(frames):
        start = found.start[inside][first] - begins[frames]
        length = (found.end - found.start)[inside][first]
        yield COLLISION.on(rows[places[frames]], start, length, counts)
