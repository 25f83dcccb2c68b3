"""What tools say twice, and bytes that come a line each.

A buffer and its JSON, `recv` and `Processing`, a packet with and without its check value are one frame each.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from operator import attrgetter
from typing import Final

from .columns import COLUMN_SHAPE
from .loglines import LogLine
from .runs import ByteRun, Experience
from .weighing import reads_of

_REMEMBERED: Final = 4  # entries of which one may be said again
_NAMED_ALIKE: Final = 8  # characters
_ENTRY_LINES: Final = 16  # between two reports of the same bytes
_BETWEEN: Final = 2  # other whole frames, after which, in a text without times, a frame is there again
_ENTRY_FINE_NS: Final = 60_000_000
_ENTRY_COARSE_NS: Final = 1_000_000_000
_HANDLERS_NS: Final = 2_000_000  # between two handlers of one event


@dataclass(slots=True)
class _Entry:
    """The bytes of one read, over one line or several; whether they are right, behind which words, by whom."""

    parts: list[tuple[LogLine, ByteRun]]
    data: bytes = field(init=False)
    checked: bool = field(init=False)
    template: tuple[str, str] = field(init=False)
    mark: int = field(init=False)

    def __post_init__(self) -> None:
        first = self.parts[0][1]
        self.data = b"".join(run.data for _, run in self.parts)
        self.checked = any(run.checked or run.joined for _, run in self.parts)
        self.template, self.mark = (first.label or first.heading, first.shape), first.mark

    @property
    def first(self) -> LogLine:
        return self.parts[0][0]

    @property
    def last(self) -> LogLine:
        return self.parts[-1][0]

    def is_against(self, other: _Entry) -> bool:
        """Whether marks say that two speak to one another."""
        return 0 != self.mark != other.mark != 0

    @property
    def repeats(self) -> bool:
        """Whether an answer may be the same bytes, or the first of them."""
        return any(run.echoed or any(span.repeats for span in run.checked) for _, run in self.parts)

    @property
    def decoded(self) -> bytes:
        """The bytes that an ASCII-mode frame's characters stand for."""
        with suppress(ValueError):
            return bytes.fromhex(self.data.partition(b":")[2].decode("ascii").strip())
        return b""


def settle_copies(lines: Sequence[LogLine], experience: Experience) -> None:
    """Leave out what was said before: by another handler of the same event, or in other words."""
    _leave_out_doubles(lines, experience)
    entries = [_Entry(parts) for parts in reads_of(lines)]
    _note_voices(entries, experience)
    recent: list[_Entry] = []
    for entry in entries:
        turned, others = False, 0  # the other side spoke in between; whole frames that stand there
        for earlier in reversed(recent):
            near = _one_report(earlier, entry) and others < _BETWEEN
            drop = _copy_of_two(earlier, entry, experience, turned=turned) if near else None
            if drop is None:
                turned = turned or earlier.is_against(entry)
                others += earlier.checked and earlier.last is not entry.first
            elif drop is earlier:
                _leave_out_copy(earlier, entry)
                recent.remove(earlier)
            else:
                _leave_out_copy(entry, earlier)
                for one in [one for one in recent if _has_grown(one, entry, experience)]:
                    _leave_out_copy(one, entry)
                    recent.remove(one)
                break
        else:
            recent.append(entry)
        del recent[:-_REMEMBERED]


def leave_out_buffers(lines: Sequence[LogLine], experience: Experience) -> None:
    """`data: 04 d0, buffer: 01 0f 04 d0`: a buffer with all that has come, shown behind each piece, says nothing new.

    That a log shows one is known where it was not empty before a piece.
    """
    before, repeats = b"", []
    for line in lines:
        for piece, buffer in pairwise(line.runs[-2:]):
            if piece.label != buffer.label and buffer.data in (piece.data, before + piece.data):
                experience.gathers |= buffer.data != piece.data
                repeats.append((line, buffer))
            before = buffer.data
    for line, buffer in repeats if experience.gathers else ():
        line.runs.remove(buffer)


def _note_voices(entries: Sequence[_Entry], experience: Experience) -> None:
    """Who says right frames that nobody has just said: what they say again are answers that repeat a request."""
    said: deque[bytes] = deque(maxlen=_REMEMBERED)
    for entry in entries:
        if entry.checked and entry.template[0] and not any(entry.data in data for data in said):
            experience.of(*entry.template).voice = True
        said.append(entry.data)


def _leave_out_doubles(lines: Sequence[LogLine], experience: Experience) -> None:
    """Of lines of which each stands there several times at one time, as handlers print them, the first of each."""
    for kind, alike in _lines_alike(lines).items():
        if len(alike) > 1 and all(len(same) > 1 for same in alike):
            experience.of(*kind).doubled = True
        for first, *more in alike if experience.of(*kind).doubled else ():
            for run in (run for line in more for run in line.runs):
                run.taken, run.why = False, f"the same bytes as in line {first.number}"


def _lines_alike(lines: Sequence[LogLine]) -> dict[tuple[str, str], list[list[LogLine]]]:
    """Lines at fine times by labels and writings, those that are the same and below one another together."""
    kinds: dict[tuple[str, str], list[list[LogLine]]] = {}
    for _, same in groupby(lines, attrgetter("text", "fine")):
        group = list(same)
        for run in [run for run in group[0].runs if run.taken and group[0].fine][:1]:
            kinds.setdefault((run.label, run.shape), []).append(group)
    return kinds


def _leave_out_copy(drop: _Entry, other: _Entry) -> None:
    for _, run in drop.parts:
        run.taken, run.why = False, f"the same bytes as in line {other.first.number}"


def _one_report(earlier: _Entry, entry: _Entry) -> bool:
    """Whether two runs can be of one log entry: near in the text and in time, of one direction."""
    if entry.first.number - earlier.last.number > _ENTRY_LINES or earlier.is_against(entry):
        return False
    first, second = earlier.last.t_ns, entry.first.t_ns
    if first is None or second is None:
        return True
    fine = earlier.last.fine and entry.first.fine
    return abs(second - first) <= (_ENTRY_FINE_NS if fine else _ENTRY_COARSE_NS)


def _copy_of_two(earlier: _Entry, entry: _Entry, experience: Experience, *, turned: bool) -> _Entry | None:
    """The one of two that only repeats bytes of the other; None where both are of their own.

    `turned`: the other side spoke between them, which ends what comes in pieces.
    """
    if not turned and _has_grown(earlier, entry, experience):
        return earlier
    if earlier.template == entry.template:
        return entry if _is_logged_twice(earlier, entry) else None
    if _is_own_voice(earlier, entry, experience) or (turned and earlier.last is entry.first):
        return None  # several turns in one line
    pair = (*earlier.template, *entry.template)
    if entry.data in (earlier.data, earlier.decoded):
        return entry if _is_said_again(earlier, entry, pair, experience) else None
    part = _part_of_two(earlier, entry, turned=turned)
    if part is not None:
        experience.reports.add(pair)
    return part


def _part_of_two(earlier: _Entry, entry: _Entry, *, turned: bool) -> _Entry | None:
    """The one of two that is a part of the other, and is no frame itself."""
    if min(len(earlier.data), len(entry.data)) == 1:
        return None  # which is in many a frame
    if entry.data in earlier.data:
        return None if entry.checked else entry
    begun = entry.checked and not earlier.checked and not turned
    return earlier if begun and earlier.data in entry.data else None


def _is_own_voice(earlier: _Entry, entry: _Entry, experience: Experience) -> bool:
    """Whether an answer repeats the request above, all of it or as far as it came: both speak for themselves."""
    heard = experience.of(*earlier.template).voice and experience.of(*entry.template).voice
    return heard and not earlier.mark == entry.mark != 0


def _is_said_again(earlier: _Entry, entry: _Entry, pair: tuple[str, ...], experience: Experience) -> bool:
    """Whether the same bytes behind other words are one report more of the same."""
    marked = earlier.mark == entry.mark != 0
    if entry.template[1] == COLUMN_SHAPE:
        return True  # field by field what the line above says
    if not marked and entry.parts[0][1].heading:
        return False  # only the words above them differ: somebody shows the same frame again
    if earlier.checked and not earlier.repeats:
        experience.reports.add(pair)
        return True
    elsewise = earlier.template[1] != entry.template[1]  # the same bytes, written in another way
    if earlier.last is entry.first:
        return elsewise or (entry.template[1] == "\\x" and not earlier.checked)  # one string, said twice
    names = {one.template[0][:_NAMED_ALIKE] for one in (earlier, entry)}  # `port data`, `port buffer`
    known = pair in experience.reports or (elsewise and earlier.parts[0][1].sure)
    return known or marked or (len(names) == 1 and names != {""})


def _is_logged_twice(earlier: _Entry, entry: _Entry) -> bool:
    """Whether two lines are one event, which two handlers of a log have written: no frame is sent in no time.

    Handlers that write in ways of their own may read the clock one after the other.
    """
    first, second = earlier.first, entry.first
    if earlier.data != entry.data or not earlier.mark == entry.mark != 0 or not (first.fine and second.fine):
        return False
    return abs((second.t_ns or 0) - (first.t_ns or 0)) <= _HANDLERS_NS


def _has_grown(earlier: _Entry, entry: _Entry, experience: Experience) -> bool:
    """Whether a buffer is shown once more with what has come since.

    That a log does so is known where bytes without a right check value are the beginning of a frame behind them.
    """
    begins = entry.data[:-1].startswith(earlier.data)
    if not begins or earlier.checked or earlier.template != entry.template or not earlier.template[0]:
        return False
    if entry.checked:
        experience.of(*entry.template).growing = True
    return experience.of(*entry.template).growing
