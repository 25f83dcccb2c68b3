"""What a recording says besides bytes, and when it heard nothing.

While an adapter is unplugged or a disk is full, answers are missing from the record, not from the bus. So no unit is
blamed for an answer that fell into such a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from analyzer.findings.model import Findings
    from captures.chunks import Capture
    from captures.recording.notes import Note

_NEVER: Final = (1 << 63) - 1
_WAIT_MS: Final = 10_000.0  # for an answer, where no request follows that ends the wait


@dataclass(frozen=True, slots=True)
class Deaf:
    """A time in which nothing could be heard, ns; `to_ns` is None where it lasts to the end of the recording."""

    from_ns: int
    to_ns: int | None
    text: str


def notes_of(capture: Capture) -> list[Note]:
    """What is noted in a recording, in order of time; nothing where a capture is no recording."""
    if capture.format != "mcap" or capture.path is None:
        return []
    from captures.recording.notes import read

    return read(capture.path)


def deaf_times(notes: Iterable[Note]) -> list[Deaf]:
    """From the loss of an adapter to its return, and moments at which bytes were lost, in order of time."""
    times: list[Deaf] = []
    away: dict[str, Note] = {}  # by the port, which a note begins with
    for note in notes:
        port = note.text.partition(": ")[0]
        if note.kind == "lost":
            away.setdefault(port, note)
        elif note.kind == "opened" and port in away:
            lost = away.pop(port)
            times.append(Deaf(lost.t_ns, note.t_ns, lost.text))
        elif note.kind == "gap":
            times.append(Deaf(note.t_ns, note.t_ns, note.text))
    times += [Deaf(lost.t_ns, None, lost.text) for lost in away.values()]
    return sorted(times, key=lambda time: time.from_ns)


def excused(findings: Findings, times: Sequence[Deaf]) -> Findings:
    """Findings without those that miss an answer which may have come while nothing was heard."""
    if not len(times) or not len(findings):
        return findings
    from analyzer.findings.registry import codes, rules

    number = codes().index("no-response")
    missed = np.flatnonzero(findings["rule"] == number)
    waited_ms = findings["numbers"][missed, rules()[number].numbers.index("waited_ms")]
    begin = findings["t"][missed]
    end = begin + (np.where(np.isnan(waited_ms), _WAIT_MS, waited_ms) * 1e6).astype(np.int64)
    meets = np.zeros(len(missed), np.bool_)
    for time in times:
        meets |= (time.from_ns <= end) & (begin <= (_NEVER if time.to_ns is None else time.to_ns))
    kept = np.ones(len(findings), np.bool_)
    kept[missed[meets]] = False
    return findings[kept]
