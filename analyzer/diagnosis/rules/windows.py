"""Windows with a right CRC that are no frames: chance, a payload that holds whole frames, a beginning that checks.

Worth a note, since a tool that looks for right CRCs takes them for frames. Only frames about which the deframer had to
weigh other explanations can hold any; those are searched again, all at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from ...deframing.candidates import search_candidates
from ...deframing.crc_windows import crc_windows
from ...languages import counted, phrase
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ..view import DiagnosisStep, where

_LEAST: Final = 4  # bytes of a frame

COLLISION: Final = Rule(
    "crc-collision",
    Severity.NOTE,
    About.FRAME,
    when="a window of bytes has a right CRC, but a better explanation covers it",
    clause="[2] 2.5.1.2",
    numbers=("window_start", "window_length", "windows"),
    text=lambda numbers: phrase(
        "{bytes} from byte {window_start:.0f} on have a right CRC, but are part of this frame"
        if numbers["window_start"]
        else "the first {bytes} have a right CRC, but are part of this frame",
        numbers,
        bytes=counted(int(numbers["window_length"]), "byte", "bytes"),
    ),
    cause="chance, 1 window in 65,536, or registers that hold a whole frame",
    remedy="nothing: it only misleads tools that look for right CRCs alone",
)


@looks_for(COLLISION)
def inner_windows(view: DiagnosisStep) -> Iterator[Findings]:
    """Frames with such a window inside them."""
    rows, contested = view.rows, view.right(where(view.rows.contested))
    if not len(contested):
        return
    lengths = rows.length[contested]
    ends = np.cumsum(lengths)
    begins = ends - lengths
    data = view.batch.data[np.repeat(rows.at[contested] - begins, lengths) + np.arange(int(ends[-1]))]
    crc = crc_windows(data)
    candidates = search_candidates(data, crc)
    heads = np.repeat(begins, lengths)
    early = where(crc.heads.take(heads) == crc.tails[1:]) + 1  # ends of windows that begin where their frame does
    start, end = np.concatenate((candidates.start, heads[early - 1])), np.concatenate((candidates.end, early))
    start, end = np.unique(np.stack((start, end)), axis=1)
    owner = np.searchsorted(ends, start, side="right")
    inside = (end <= ends[owner]) & (end - start < lengths[owner]) & (end - start >= _LEAST)
    inside[inside] = [data[s:e].any() for s, e in zip(start[inside], end[inside], strict=True)]
    frames, first, counts = np.unique(owner[inside], return_index=True, return_counts=True)
    if len(frames):
        first_start, first_end = start[inside][first], end[inside][first]
        yield COLLISION.on(rows[contested[frames]], first_start - begins[frames], first_end - first_start, counts)
