"""How much speaks for a run of characters that they are bytes: one sum in bits, a row of a table for each reason.

What its writing costs says the first row of `LOOKS` that holds; what beside it supports it is the sum of those of
`SUPPORT`. A text has a `floor`: what looks better is taken. Where there is something plainer, or right, a run has to be
as much above the floor as that asks for: words of a stack, a session's number, a hash beside frames look like bytes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import chain, groupby, pairwise
from typing import Final, NamedTuple

from .candidates import LEFT_OUT, HexWindow, Writing, is_ruler
from .choosing import MOST_JUDGED
from .columns import COLUMN_SHAPE
from .judging import ByteJudge
from .loglines import LogLine
from .runs import ByteRun, Experience, covered, is_whole

_SUPPORTED: Final = (8.0, 4.0)  # above the floor, where others are right, or look more like bytes
_RIGHT: Final = 16.0
NEVER: Final = -99.0
_HEADED: Final = 6  # bytes for which a header speaks
_SHORT: Final = 3  # bytes: no more where text stands behind them
_NUMBER: Final = 2  # bytes that may be one number
_MAC: Final = 6  # bytes
_NEAR: Final = 24  # characters
_PRIOR: Final = {"words": -3.0, "pairs": 1.0, "base64": -6.0, "swapped words": -3.0, "pairs:": -1.0, "pairs-": -1.0}
_ASCII: Final = -3.0  # a frame of ASCII mode whose LRC is wrong: a colon stands before many numbers
_SIGNED: Final = 4.0  # a writing with signs of its own
_LEAST_ROWS: Final = 4  # of one byte each that can be a frame
_NOT_BUT: Final = ("!=", "<>")
_RECORD_AROUND: Final = 5  # bytes of a record of Intel HEX: how many it carries, two of an address, a type, a sum
_RECORD_TYPES: Final = 6
_TOKEN, _COMPUTED, _COUNT, _SIZE, _UNIT = (
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r"\w+",
        r"\b(?:expect\w*|actual|calculat\w*|comput\w*|should be)\b\W{0,5}(?:0x)?$",
        r"(?<![\w.])(?:(\d{1,4}) ?|(?:single|one)[ -])(?:bytes?|байта?|字节)\b(?: frame)?\)?[\s:=]{1,3}(?:0x)?$",
        r"(?:(?<![\w.])(\d{1,4})\W{1,4})?$",
        r"\.\d|\s?(?:[muµ]s|ns|мк?с|сек|m[VA]|kWh?|k?Hz|°|%|bar|baud|bps|[kM]B|RUB|EUR|USD|руб|шт|times|retries)(?!\w)",
    )
)


class LinesAround:
    """Lines that are weighed together: what all of them tell of one run."""

    def __init__(self, lines: Sequence[LogLine], judge: ByteJudge) -> None:
        self.judge = judge
        self._lines = lines

    @cached_property
    def are_records(self) -> bool:
        """Whether all lines that begin with a colon are of a program in Intel HEX, whose sum is that of ASCII mode.

        A request may look like one (`:020300000002F9`), so that one at least must be right, and no frame.
        """
        colons = [line for line in self._lines if line.clean.lstrip()[:1] == ":"]
        other = any(run.ascii and not run.checked for line in colons for run in line.runs)
        return other and all(_is_record(line.clean.strip()) for line in colons)

    @cached_property
    def bytewise(self) -> frozenset[int]:
        """Numbers of the lines that show a byte each, alike and one below the other: `RX: 03`, `RX: 56`."""
        alike = groupby(self._lines, single_byte)
        groups = [[line.number for line in same] for key, same in alike if key is not None and key.mark]
        return frozenset(chain.from_iterable(group for group in groups if len(group) >= _LEAST_ROWS))

    @cached_property
    def sized(self) -> frozenset[int]:
        """Numbers of the lines whose last run has the size that stands right before it, as all have that are right."""
        last = [(line, line.runs[-1]) for line in self._lines if line.runs]
        told = frozenset(line.number for line, run in last if _size_before(line, run) == str(len(run.data)))
        right = {line.number for line, run in last if is_whole(run)}
        return told if _LEAST_ROWS <= len(right & told) == len(right) else frozenset()

    @cached_property
    def below(self) -> dict[int, LogLine]:
        """The next line that shows what looks like bytes, by the numbers of lines."""
        shown = (line for line in self._lines if any(run.is_likely for run in line.runs))
        return {one.number: other for one, other in pairwise(shown)}


def _size_before(line: LogLine, run: ByteRun) -> str:
    """The number right before a run; empty where there is none."""
    sizes: list[str] = _SIZE.findall(line.clean[max(run.start - _NEAR, 0) : run.start])
    return sizes[0].lstrip("0")


class SingleByte(NamedTuple):
    """How a line shows the only byte that it has."""

    label: str
    shape: str
    mark: int
    t_ns: int | None


def single_byte(line: LogLine) -> SingleByte | None:
    """How a line shows its only byte; None of other lines."""
    if len(line.runs) != 1 or len((run := line.runs[0]).data) != 1:
        return None
    return SingleByte(run.label, run.shape, run.mark, line.t_ns)


def _is_record(text: str) -> bool:
    try:
        record = bytes.fromhex(text[1:])
    except ValueError:
        return False
    fits = len(record) >= _RECORD_AROUND and record[0] == len(record) - _RECORD_AROUND
    return fits and sum(record) & 0xFF == 0 and record[3] < _RECORD_TYPES


class SeenRun(NamedTuple):
    """A run in its line, what has been learnt of the text, the lines around, and the run before it."""

    run: ByteRun
    line: LogLine
    learnt: Experience
    around: LinesAround
    before: ByteRun | None = None

    @property
    def between(self) -> str:
        """The characters between the run before, which is bytes, and this one."""
        before = self.before
        return self.line.clean[before.end : self.run.start] if before is not None and before.taken else ""

    @property
    def shown(self) -> str:
        """Its characters."""
        return self.line.clean[self.run.start : self.run.end]

    @property
    def is_numbers(self) -> bool:
        """Whether it is what people write in decimals, too short for a frame: `40001 -> 1234`, `16 25 30`."""
        if self.run.shape == "words":
            return self.shown.isdigit()
        tokens = _TOKEN.findall(self.shown)
        return 1 < len(tokens) <= _SHORT and all(token.isdigit() and token[0] != "0" for token in tokens)


class Feature(NamedTuple):
    """What speaks for bytes, or against them, with its weight; `holds` may give the way in which the run is read then.

    `why` is what is told of a run that is left out, `quiet` that its line holds no bytes.
    """

    name: str
    bits: float
    holds: Callable[[SeenRun], bool | ByteRun | HexWindow | None]
    why: str | None = None
    quiet: bool = False


def _is_counted(span: SeenRun) -> bool:
    """Whether the words before say that just so many bytes follow."""
    count = _COUNT.search(span.line.clean[max(span.run.start - _NEAR, 0) : span.run.start])
    return count is not None and int(count[1] or 1) == len(span.run.data)


def _is_measured(span: SeenRun) -> bool:
    """Whether a few digits are a number with a unit or a fraction, or one that a sentence has in parentheses."""
    run, text = span.run, span.line.clean
    aside = text[: run.start].endswith(" (") and text.startswith(")", run.end)
    if aside and len(run.data) <= _NUMBER and run.level is Writing.NUMBER:
        return True
    return len(run.data) < _HEADED and _UNIT.match(text, run.end) is not None


def _is_hardware_address(span: SeenRun) -> bool:
    """Whether six bytes are written as addresses of networks are, where frames are written otherwise."""
    shape, right = span.run.shape, span.learnt.shapes
    return shape in ("pairs:", "pairs-") and len(span.run.data) == _MAC and bool(right) and shape not in right


def _as_tail(span: SeenRun) -> ByteRun | HexWindow | None:
    """It read as a check value, where those of frames above stand behind its words."""
    run, learnt = span.run, span.learnt
    ways = run.readings().values() if run.label and learnt.tails else ()
    return next((one for one in ways if learnt.of(run.label, one.shape).tail), None)


def _as_announced(span: SeenRun) -> ByteRun | HexWindow | None:
    """A frame with a wrong check value, or without one, in a writing in which others of the text are right."""
    run = span.run
    if run.halved or span.line.quiet or len(run.data) < _HEADED or (run.level, run.shape) == (Writing.NUMBER, "pairs"):
        return None
    ways: tuple[ByteRun | HexWindow, ...] = (run, *run.others)
    known = (one for one in ways if one.shape in span.learnt.shapes)
    return next((one for one in known if covered(span.around.judge(one.data, damaged=True)) == len(one.data)), None)


def _is_instead(span: SeenRun) -> bool:
    """Whether the text says it to be something else than what it received."""
    return span.between.removesuffix("0x").rstrip(" [('\"").endswith(_NOT_BUT)


def _is_size(span: SeenRun) -> bool:
    """`WRITE: 8B` above eight bytes says how many they are."""
    below = span.around.below.get(span.line.number)
    if below is None or span.run is not span.line.runs[-1]:
        return False
    size = sum(len(run.data) for run in below.runs if run.is_likely)
    return size > 1 and span.shown.upper() == f"{size}B"


def _is_behind_cut(span: SeenRun) -> bool:
    """`01 03 14 00 … C4 20`: bytes behind a sign that some between are left out."""
    cut = span.before is not None and span.before.cut
    return cut and span.between.strip(" \t,") in LEFT_OUT and len(span.run.data) > 1


def _is_trusted(span: SeenRun) -> bool:
    """Whether others in its writing behind its words are right, and nothing around says that it is something else."""
    run, line = span.run, span.line
    if not span.learnt.trust(run.label, run.shape, direct=run.direct and not span.is_numbers):
        return False
    if run.label:
        return len(run.data) > _SHORT or line.ends_with(run)
    word = span.shown.istitle() and not any(map(str.isdigit, line.clean))  # `Be Ad`
    return run.offset is not None or (line.is_all(run) and not word)


def _is_decimal(span: SeenRun) -> bool:
    """Whether it is a list of decimals, and no address of a network."""
    shown = span.shown
    long = any(len(number) == 3 for number in _TOKEN.findall(shown))
    return span.run.shape == "decimal" and long and shown.count(".") != 3


LOOKS: Final = (  # the first that holds
    Feature("instead", NEVER, _is_instead, "the bytes expected in place of those before"),
    Feature(
        "record",
        NEVER,
        lambda s: s.line.clean.lstrip()[:1] == ":" and s.around.are_records,
        "records of a program in Intel HEX",
    ),
    Feature("right", _RIGHT, lambda s: bool(s.run.checked) or s.run.sure),
    Feature("size", NEVER, _is_size, quiet=True),
    Feature("byte by byte", 0.0, lambda s: s.line.number in s.around.bytewise),
    Feature("behind a cut", 0.0, _is_behind_cut),
    Feature("counted", _RIGHT, _is_counted),
    Feature("counted above", _RIGHT, lambda s: s.run.counted),
    Feature("sized", _RIGHT, lambda s: s.run is s.line.runs[-1] and s.line.number in s.around.sized),
    Feature("ruler", NEVER, lambda s: s.run.level is Writing.NUMBER and is_ruler(_TOKEN.findall(s.shown))),
    Feature("half a byte", NEVER, lambda s: s.run.halved and not s.learnt.other),
    Feature("measured", NEVER, _is_measured),
    Feature("hardware address", NEVER, _is_hardware_address),
    Feature("bytes", 0.0, lambda s: s.run.level is Writing.BYTES),
    Feature("marked", 0.0, lambda s: s.run.level is Writing.LIKELY and s.run.mark != 0 and not s.is_numbers),
    Feature("tail", 0.0, _as_tail),
    Feature("trusted", 0.0, _is_trusted),
    Feature("announced", 0.0, _as_announced),
    Feature("likely", -12.0, lambda s: s.run.level is Writing.LIKELY),
    Feature("decimals", -24.0, _is_decimal),
    Feature("nothing like bytes", NEVER, lambda _: True),
)
SUPPORT: Final = (  # the sum of those that hold
    Feature("written as what is right", 4.0, lambda s: s.run.build in s.learnt.builds),
    Feature("in words as wide as nothing that is right", -2.0,
            lambda s: s.run.width > 0 and s.run.build not in s.learnt.builds),
    Feature("behind a mark", 4.0, lambda s: s.run.mark != 0),
    Feature("behind words behind which others are right", 4.0,
            lambda s: bool(s.run.label) and s.learnt.of(s.run.label, s.run.shape).proven),
)  # fmt: skip


def propose(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Take what looks better than the floor of its text."""
    around = LinesAround(lines, judge)
    for line in lines:
        for before, run in zip((None, *line.runs), line.runs, strict=False):
            seen = SeenRun(run, line, experience, around, before)
            row, reading = next((row, held) for row in LOOKS if (held := row.holds(seen)))
            if not isinstance(reading, bool):
                run.take(reading)
            run.looks, run.taken = row.bits, row.bits > experience.floor
            run.why = run.why or row.why
            line.quiet = line.quiet or row.quiet


def leave_out_unsupported(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Take back what was taken for its looks alone, where others are right, or look more like bytes."""
    groups = [group for read in reads_of(lines) for group in _written_alike(read)]
    columns = (run for group in groups for _, run in group if run.shape == COLUMN_SHAPE and run.checked)
    experience.builds.update(run.build for run in columns)
    around = LinesAround(lines, judge)
    bits = [max(_bits(SeenRun(run, line, experience, around)) for line, run in group) for group in groups]
    experience.plainest = max((experience.plainest, *bits))
    least = experience.floor + _asked_of(experience)
    for group, weight in zip(groups, bits, strict=True):
        if weight <= least and not _is_announced(group, judge):
            for line, run in group:
                run.taken = line.continues = False


def _asked_of(experience: Experience) -> float:
    """How much above its floor a run of a text has to be."""
    right, plainer = _SUPPORTED
    return right if experience.builds else plainer * (experience.plainest > experience.floor + right)


def _is_announced(group: Sequence[tuple[LogLine, ByteRun]], judge: ByteJudge) -> bool:
    """Whether a run is as long as its header says."""
    return any(len(run.data) >= _HEADED and judge(run.data[:MOST_JUDGED], damaged=True) for _, run in group)


def _bits(span: SeenRun) -> float:
    run = span.run
    if run.checked or run.joined or run.sure or run.shape == COLUMN_SHAPE:
        return _RIGHT
    prior = _ASCII if run.ascii else _PRIOR.get(run.shape, _SIGNED if run.level is Writing.BYTES else 0.0)
    return min(run.looks, 0.0) + prior + sum(row.bits for row in SUPPORT if row.holds(span))


def reads_of(lines: Sequence[LogLine]) -> Iterator[list[tuple[LogLine, ByteRun]]]:
    """What was taken, read by read, over one line or several."""
    read: list[tuple[LogLine, ByteRun]] = []
    for line in lines:
        for i, run in enumerate(run for run in line.runs if run.taken):
            above = read[-1][1] if read else run
            same = run.shape == above.shape == COLUMN_SHAPE or 0 < run.joined == above.joined
            if read and (i or not (line.continues or same)):
                yield read
                read = []
            read.append((line, run))
    if read:
        yield read


def _written_alike(read: list[tuple[LogLine, ByteRun]]) -> Iterator[list[tuple[LogLine, ByteRun]]]:
    """A read in parts of which each is written alike; the last row of a dump may be short."""
    rows = enumerate(pairwise([run for _, run in read]), 1)
    begins = [i for i, (above, run) in rows if above.build != run.build and not run.checked and run.offset is None]
    return (read[first:last] for first, last in pairwise([0, *begins, len(read)]))


def is_computed(run: ByteRun, line: LogLine) -> bool:
    """Whether the words before say that somebody has computed or expected it: it was not on the line."""
    return _COMPUTED.search(line.clean[max(run.start - _NEAR, 0) : run.start]) is not None
