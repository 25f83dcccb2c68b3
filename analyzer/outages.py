"""What a recording says besides bytes, and when it heard nothing.

While an adapter is unplugged or a disk is full, answers are missing from the record, not from the bus; so are those
that were due when the capture ended. So a request whose answer may have fallen into such a time is neither answered nor
unanswered but not heard, and no unit is blamed for it, nor for a frame that was cut off when such a time began.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from captures.recording.notekinds import CLOSED
from dissectors.values import harmless

from .languages import page_words, retold
from .tables.transactions import NEVER, Status, TransactionRows
from .words import duration, moment

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from captures.chunks import Capture
    from captures.recording.notes import Note

    from .tables.findings import Findings


_WAIT_NS: Final = 10_000_000_000  # for an answer, at the most
NOTICED_NS: Final = 500_000_000  # that a frame takes, and the loss of an adapter to be noticed
_CUT: Final = ("truncated", "byte-missing")
_OF_TWO: Final = (
    "unexpected-response",
    "response-mismatch",
    "retry",
)  # what hangs on a frame that is not there


@dataclass(frozen=True, slots=True)
class Deaf:
    """A time in which nothing could be heard, ns; `to_ns` is None where it lasts to the end of the recording."""

    from_ns: int
    to_ns: int | None
    text: str


def notes_of(capture: Capture) -> list[Note]:
    """What is noted in a recording, in order of time; nothing where a capture is no recording."""
    return capture.notes()


@dataclass(slots=True)
class Deafness:
    """Times in which nothing was received, note by note: from the loss of an adapter to its return, and lost bytes."""

    over: list[Deaf] = field(default_factory=list)
    away: dict[str, Note] = field(default_factory=dict)  # since when, by the port, which a note begins with

    def feed(self, note: Note) -> None:
        """The next note."""
        port = note.text.partition(": ")[0]
        if note.kind == "lost":
            self.away.setdefault(port, note)
        elif note.kind == "opened" and port in self.away:
            lost = self.away.pop(port)
            self.over.append(Deaf(lost.t_ns, note.t_ns, lost.text))
        elif note.kind == "gap":
            self.over.append(Deaf(note.t_ns, note.t_ns, note.text))

    @property
    def times(self) -> list[Deaf]:
        """All that is known, in order of time."""
        away = [Deaf(lost.t_ns, None, lost.text) for lost in self.away.values()]
        return sorted([*self.over, *away], key=lambda time: time.from_ns)


def deaf_times(notes: Iterable[Note]) -> list[Deaf]:
    """The times of these notes, in order."""
    deafness = Deafness()
    for note in notes:
        deafness.feed(note)
    return deafness.times


def listened_until(notes: Iterable[Note]) -> int:
    """When listening ended, ns, as a recording that was closed notes it; NEVER elsewhere."""
    return max((note.t_ns for note in notes if note.kind == CLOSED), default=NEVER)


def with_unheard(settled: TransactionRows, times: Sequence[Deaf], *, last: bool = False) -> TransactionRows:
    """Transactions, with those UNHEARD that wait for an answer which may have come while nothing was received.

    `last`: the recording is over; else a wait of which no request shows the end was over when it was settled.
    """
    silent = np.flatnonzero(settled.status == Status.UNANSWERED) if times else ()
    if not len(silent):
        return settled
    asked, end = settled.t_request_ns[silent], settled.t_next_ns[silent]
    end = np.where(end == NEVER, asked + _WAIT_NS * last, np.minimum(end, asked + _WAIT_NS))
    settled.status[silent[_meets(asked, end, times)]] = Status.UNHEARD
    return settled


def with_cut_off(last: TransactionRows, end_ns: int, patience_ns: int, cut: int) -> TransactionRows:
    """The transactions that the end of a capture settles, with those UNHEARD whose answer was still due: nothing was
    asked behind them, and the client waits for `patience_ns`. `end_ns`: when the capture was heard last; `cut`: the
    index of a frame that its end cut off, -1 for none."""
    is_due = (last.status == Status.UNANSWERED) & (end_ns < last.t_request_ns + patience_ns)
    is_cut = (last.status == Status.DAMAGED) & (last.response == cut)
    last.status[(is_due | is_cut) & (last.t_next_ns == NEVER)] = Status.UNHEARD
    return last


def excusable(findings: Findings) -> NDArray[np.bool_]:
    """Which findings speak of frames whose end may have been cut off when the recorder went deaf."""
    return _are(findings, _CUT)


def _are(findings: Findings, named: Sequence[str]) -> NDArray[np.bool_]:
    from .tables.findings import codes

    found: NDArray[np.bool_] = np.isin(findings.rule, [codes().index(code) for code in named])
    return found


def excused(findings: Findings, times: Sequence[Deaf]) -> Findings:
    """Findings without those of frames whose end was cut off so, or whose request or answer was not heard: no device
    did that."""
    if not times or not len(findings):
        return findings
    cut = np.flatnonzero(excusable(findings))
    begun = findings.t_ns[cut]
    stays = np.ones(len(findings), np.bool_)
    stays[cut[_meets(begun, begun + NOTICED_NS, times)]] = False
    alone = np.flatnonzero(_are(findings, _OF_TWO))
    stays[alone[_meets(findings.t_ns[alone], findings.t_ns[alone], times)]] = False
    return findings[stays]


def _meets(begin: NDArray[np.int64], end: NDArray[np.int64], times: Sequence[Deaf]) -> NDArray[np.bool_]:
    """Which of these spans, ns, have a moment in common with a time in which nothing was received."""
    meets = np.zeros(len(begin), np.bool_)
    for time in times:
        meets |= time.from_ns <= end if time.to_ns is None else (time.from_ns <= end) & (begin <= time.to_ns)
    return meets


def unheard(time: Deaf) -> str:
    """A time without ears, in words."""
    text = harmless(retold(time.text))
    if time.to_ns is None:
        return page_words("nothing heard from {moment} to the end: {text}", moment=moment(time.from_ns), text=text)
    if time.to_ns == time.from_ns:
        return page_words("at {moment}: {text}", moment=moment(time.from_ns), text=text)
    return page_words(
        "nothing heard for {time} from {moment}: {text}",
        time=duration(time.to_ns - time.from_ns), moment=moment(time.from_ns), text=text,
    )  # fmt: skip
