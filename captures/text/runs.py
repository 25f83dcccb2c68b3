"""Runs of characters that may be bytes, and what is learnt of them while a text is read."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Final

from ..checked import Checked
from .candidates import HexWindow, Writing
from .headings import ClockHabits
from .writings import LOOK_ALIKES

_MARKED: Final = "\0marked"  # in place of the label, for all runs behind direction marks
FLOORS: Final = (-8.0, -20.0, -32.0, -44.0)  # of plain bytes, likely ones, lists of decimals, numbers with a meaning
_PATIENCE: Final = {  # how many places are searched in vain
    "digits run together": 2000,  # ways to part them
    "pieces": 600,  # behind the same words
    "columns": 3000,  # rows of numbers
}


@dataclass(slots=True)
class ByteRun:
    """Bytes that a line may hold: what was chosen of several readings of the same characters, and what became of it.

    `label` is the text before it without its numbers, by which runs of one kind are known again, `heading` that of the
    words above where none are before it; `direct`: a direction mark stands right before it. `checked` are the stretches
    with right check values, in this run alone or together with its neighbours; `rivals` the shapes of other readings
    that are as right.
    """

    data: bytes
    start: int
    end: int
    shape: str
    level: Writing
    label: str = ""
    mark: int = 0
    direct: bool = False
    heading: str = ""
    ascii: bool = False
    cut: bool = False
    offset: str | None = None
    halved: bool = False
    sure: bool = False  # a tool's own layout says so
    counted: bool = False  # the line above says that just so many bytes follow
    padded: bool = False  # the dump's end says that there is a byte less
    checked: Sequence[Checked] = ()
    taken: bool = False
    why: str | None = None  # it was not taken
    arrow: bool = False  # its mark is no word: `->` may join who asks to who answers
    others: Sequence[HexWindow] = ()  # the same characters read otherwise
    rivals: Sequence[str] = ()
    width: int = 0  # digits of each word, where it is several
    joined: int = 0  # the number of the frame with a right check value of which it is a part, with other runs
    echoed: bool = False  # the answer to that may be the same bytes again
    looks: float = 0.0  # bits that it has for its looks; none, where something else than they had it taken

    @property
    def is_likely(self) -> bool:
        """Whether it looks like bytes, or is some."""
        return bool(self.level or self.checked)

    @property
    def build(self) -> str:
        """Its shape, and how wide its words are."""
        return f"{self.shape} of {self.width}" if self.width else self.shape

    def take(self, candidate: HexWindow | ByteRun) -> None:
        """Read it otherwise."""
        self.data, self.shape, self.start, self.end = candidate.data, candidate.shape, candidate.start, candidate.end

    def __copy__(self) -> ByteRun:
        """As `copy` would, in a fifth of the time: a text repeats its lines."""
        return ByteRun(*_FIELDS_OF(self))

    def accept(self, reading: HexWindow | ByteRun) -> None:
        """It is bytes, read so, whatever it looks like."""
        self.take(reading)
        self.taken, self.looks = True, 0.0

    def readings(self) -> dict[str, ByteRun | HexWindow]:
        """It in each of its shapes."""
        readings: dict[str, ByteRun | HexWindow] = {self.shape: self}
        for candidate in self.others:
            if abs(candidate.end - self.end) < 2:
                readings.setdefault(candidate.shape, candidate)
        return readings


_FIELDS_OF: Final = attrgetter(*ByteRun.__slots__)


@dataclass(slots=True)
class LabelRecord:
    """What has been learnt of runs behind one label in one shape: how often they were met, and how often right.

    Right is one with a right check value, or one behind words that is plainly bytes.
    """

    met: int = 0
    right: int = 0
    proven: bool = False  # a check value was right
    tail: bool = False  # they are the check values of frames above them
    growing: bool = False  # they are buffers that are shown at each arrival
    voice: bool = False  # they say what none above them has said
    doubled: bool = False  # their lines each stand there several times


_UNMET: Final = LabelRecord()


class Patience:
    """What is looked for in a text: whatever was not found for long is looked for no more."""

    def __init__(self) -> None:
        self._spent = dict.fromkeys(_PATIENCE, 0)

    def ends(self, search: str) -> bool:
        """Whether a search was in vain for too long."""
        return self._spent[search] > _PATIENCE[search]

    def spend(self, search: str, count: int, *, found: bool) -> None:
        """Note that so many places were searched."""
        self._spent[search] = 0 if found else self._spent[search] + count


@dataclass(slots=True)
class Experience:
    """What has been learnt of a text."""

    # as a whole: how times are written; `damaged`: no check value is right, what has the length that its header says is
    # as good
    habits: ClockHabits = field(default_factory=ClockHabits)
    damaged: bool = False
    # bits that bytes have for their looks at least, those of what looks most like bytes, and whether any are taken
    floor: float = FLOORS[0]
    plainest: float = -99.0
    other: bool = False
    # writings, and those with the width of words, in which check values are right
    shapes: set[str] = field(default_factory=set)
    builds: set[str] = field(default_factory=set)
    # by labels and writings; `taught`: how many of these records know of something right
    records: defaultdict[tuple[str, str], LabelRecord] = field(default_factory=lambda: defaultdict(LabelRecord))
    taught: int = 0
    reports: set[tuple[str, ...]] = field(default_factory=set)  # labels and writings of two reports of the same bytes
    tails: bool = False  # check values stand apart from their frames
    gathers: bool = False  # behind what has come stands all that is in the buffer
    frames: int = 0  # that several runs are together
    # of lines alike: which of their numbers is a byte of a column, read how; which are a frame field by field
    columns: dict[str, tuple[int, str]] = field(default_factory=dict)
    fields: dict[str, int] = field(default_factory=dict)
    # by how many cells they have: the newest line of a column, and which of its numbers is the byte
    shown: dict[int, tuple[str, tuple[int, str] | None]] = field(default_factory=dict)
    patience: Patience = field(default_factory=Patience)

    def of(self, label: str, shape: str) -> LabelRecord:
        """The record of runs behind a label in a shape."""
        return self.records[label, shape]

    def note(self, run: ByteRun) -> None:
        """One more run."""
        if run.checked:
            self.shapes.update((run.shape, *run.rivals))
            self.builds.update((run.build, *run.rivals))
            self.of(run.label, run.shape).proven = True
            if run.shape.startswith("pairs"):
                self.shapes.add(LOOK_ALIKES)  # pairs, too, of letters that are typed in their place
        right = run.checked or (run.level is Writing.BYTES and run.label)
        for label in (run.label, _MARKED) if run.direct else (run.label,):
            self.of(label, run.shape).met += 1
            for shape in (run.shape, *run.rivals) if right else ():
                self._count_right(label, shape)

    def confirm(self, run: ByteRun) -> None:
        """A run in whose writing, behind its label, a check value is right."""
        self._count_right(run.label, run.shape)
        self.shapes.add(run.shape)

    def _count_right(self, label: str, shape: str) -> None:
        record = self.of(label, shape)
        self.taught += not record.right
        record.right += 1

    def support(self, run: ByteRun, span: Checked) -> None:
        """A run is of the newest frame whose check value is right, though it does not hold all of it."""
        run.joined, run.echoed = self.frames, span.repeats
        self.builds.add(run.build)
        self.of(run.label, run.shape).proven = True

    def trust(self, label: str, shape: str, *, direct: bool) -> int:
        """How often what stands behind this label, or mark, in this shape was right; 0 where it mostly was not."""
        names = (label, _MARKED) if direct else (label,)
        records = (self.records.get((name, shape), _UNMET) for name in names)
        return max((record.right for record in records if 4 * record.right >= record.met), default=0)


def covered(checked: Sequence[Checked]) -> int:
    """How many bytes these stretches are."""
    return sum(span.end - span.start for span in checked)


def is_whole(run: ByteRun) -> bool:
    """Whether all of a run has right check values."""
    return bool(run.checked) and covered(run.checked) == len(run.data)
