"""A text as its bytes: the one reader of pasted text and of logs in files.

Lines come in one after the other; those of a stretch are settled together, so that memory stays flat whatever the size.
What a text is like (which labels stand before bytes, whether there is anything but decimals) is learnt from its
beginning before anything of it is given.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from datetime import tzinfo
from itertools import groupby, islice
from math import inf
from typing import Final

from .candidates import Writing, halves, is_named_otherwise, shortened
from .choosing import MOST_JUDGED
from .dumps import payload_of, with_repeats
from .entries import ITEM, LETTER, OBJECT, NumberedLine, joined_lines, parts_of
from .headings import habits_of
from .judging import ByteJudge, lenient, no_judge, remembered
from .loglines import LineMemory, LineReader, LogLine
from .plain import quoted
from .runs import FLOORS, ByteRun, Experience
from .settling import only_bytes, settle
from .wraps import Unwrapper

LOOKED_FOR: Final = "such as 11 03 00 6B or :1103006B…"  # behind "no hex bytes"
_LEARNT_LINES: Final = 800  # of a text's beginning,
_LEARNT: Final = 1 << 16  # and characters
_PLAIN_PAIRS: Final = ("pairs", "pairs-", "pairs:", "pairs,")
_STRETCH: Final = 512  # lines that are settled together
_MOST: Final = 1 << 18  # characters of a line that is searched at once
_SETTLED: Final = (*FLOORS[:2], FLOORS[-1])  # where a text is settled even if nothing looks better
_CRC: Final = 2  # bytes
_WORDS: Final = (None, 1)  # that are looked at: between bytes, behind the last
_TYPED: Final = 3  # characters of a byte with one too many
_POINTS: Final = 3  # in the address of a network
_NUMBERS: Final = re.compile(r"(?:0|[1-9]\d*)(?:[ \t,;/:-]+(?:0|[1-9]\d*))*")
_PORTION: Final = re.compile(rf"[^\n]{{1,{_MOST}}}(?=[\s,;\\]|$)|[^\n]{{1,{_MOST}}}")


@dataclass(frozen=True, slots=True)
class Piece:
    """Bytes of a log with what is known of them; `t_ns` counts on past midnight where the log has times of day.

    `continues` says that these bytes belong to the same read, or dump, as the piece before. `port` names who speaks,
    `envelope` the protocol that check values say these bytes are of. `either_way`: whole frames, each of which reads as
    its own answer, too.
    """

    data: bytes
    line: int
    text: str
    ascii: bool = False
    mark: int = 0
    t_ns: int | None = None
    port: str = ""
    continues: bool = False
    envelope: str = ""
    either_way: bool = False
    stamped: bool = False  # its line has a stamp of its own


@dataclass(frozen=True, slots=True)
class UnreadLine:
    """A line of which not all was read, and why.

    `empty`: it does not look as if there were any bytes in it.
    """

    line: int
    text: str
    why: str
    empty: bool = False


class LogReader:
    """Reads a text: `feed` its lines, then `close`.

    `zone` is that of dates without one (None: this machine's), `sample_rate` that of logs that count samples, in Hz.
    `experience` is what another reader learnt of the same text, in place of `learn`.
    """

    def __init__(
        self,
        judge: ByteJudge = no_judge,
        zone: tzinfo | None = None,
        sample_rate: float | None = None,
        experience: Experience | None = None,
    ) -> None:
        self._judge, self._zone, self._sample_rate = remembered(judge), zone, sample_rate
        self._experience = Experience() if experience is None else experience
        self._memory: LineMemory = {}
        self._lines = self._line_reader()
        self._waiting: list[LogLine] = []

    @property
    def experience(self) -> Experience:
        """What was learnt, for another reader of the same text (a copy: it goes on learning)."""
        return deepcopy(self._experience)

    @property
    def notices(self) -> Iterator[str]:
        """What the order of times says of how they are written."""
        return self._experience.habits.notices

    @property
    def zoneless(self) -> bool:
        """Whether dates without a zone were met."""
        return self._lines.zoneless

    def learn(self, lines: Iterable[str]) -> list[Piece | UnreadLine]:
        """Look at the beginning of a text, which is given again with `feed`; gives what it holds."""
        beginning = list(_beginning(lines))
        read = self._learnt(beginning, Experience())
        if not self._is_any_right(read):
            strict = self._experience, self._lines
            again = self._learnt(beginning, Experience(damaged=True))
            if any(run.checked for line in again for run in line.runs if run.taken):
                read = again
            else:
                self._experience, self._lines = strict
        return [content for line in read for content in _contents(line, self._experience)]

    def _is_any_right(self, lines: Sequence[LogLine]) -> bool:
        """Whether a check value of these lines is right, in a run of its own or with others."""
        taken = [run for line in lines for run in line.runs if run.taken]
        if self._experience.tails or any(run.checked or self._judge(run.data[:MOST_JUDGED]) for run in taken):
            return True
        return bool(self._judge(b"".join(run.data for run in taken)[:MOST_JUDGED]))

    def _learnt(self, beginning: Sequence[str], experience: Experience) -> list[LogLine]:
        """The beginning of a text, settled."""
        self._experience = experience
        self._memory = {}
        reader = self._line_reader()
        read = self._parts(reader, beginning)
        experience.habits = habits_of(reader.stamps)
        if any(experience.habits[:-1]):
            reader = self._line_reader()
            read = self._parts(reader, beginning)
        for run in (run for line in read for run in line.runs):
            experience.note(run)
        for experience.floor in FLOORS[only_bytes(read) :]:  # lower as far as a text has nothing plainer
            if experience.floor in _SETTLED or any(run.looks > experience.floor for line in read for run in line.runs):
                experience.other = self._settle_all(read)
            if experience.other:
                break
        else:
            experience.floor = FLOORS[0]
        self._lines = self._line_reader()
        self._lines.zoneless = reader.zoneless
        return read

    def _settle_all(self, read: Sequence[LogLine]) -> bool:
        """Settle these lines; whether any bytes are taken."""
        settle(read, self._settler(), self._experience)
        return any(run.taken for line in read for run in line.runs)

    def _parts(self, reader: LineReader, beginning: Sequence[str]) -> list[LogLine]:
        whole = self._whole(enumerate(beginning, 1), reader)
        return [part for number, line in whole for part in _read(reader, line, number)]

    def feed(self, lines: Iterable[NumberedLine]) -> Iterator[Piece | UnreadLine]:
        """Lines with their numbers; gives what has been settled."""
        for number, line in self._whole(lines, self._lines):
            for part in _read(self._lines, line, number):
                self._waiting.append(part)
                for run in part.runs:
                    self._experience.note(run)
            if len(self._waiting) >= _STRETCH:
                yield from self._settled(_safe_cut(self._waiting))

    def close(self) -> Iterator[Piece | UnreadLine]:
        """No more lines come; gives the rest."""
        yield from self._settled(len(self._waiting))

    def _whole(self, lines: Iterable[NumberedLine], reader: LineReader) -> Iterator[NumberedLine]:
        """The lines, each as the one entry that it is of, or that it has."""
        unwrapped = Unwrapper(reader.runs_of).lines(joined_lines(lines, LETTER))
        entries = joined_lines(joined_lines(unwrapped, OBJECT), ITEM)
        return with_repeats((number, part) for number, line in entries for part in parts_of(line))

    def _line_reader(self) -> LineReader:
        return LineReader(self._settler(), self._zone, self._sample_rate, self._experience, memory=self._memory)

    def _settler(self) -> ByteJudge:
        return lenient(self._judge) if self._experience.damaged else self._judge

    def _settled(self, count: int) -> Iterator[Piece | UnreadLine]:
        lines, self._waiting = self._waiting[:count], self._waiting[count:]
        settle(lines, self._settler(), self._experience)
        for line in lines:
            yield from _contents(line, self._experience)


def read_lines(
    lines: Sequence[str], judge: ByteJudge = no_judge, zone: tzinfo | None = None, sample_rate: float | None = None
) -> list[Piece | UnreadLine]:
    """All of a text at once."""
    reader = LogReader(judge, zone, sample_rate)
    reader.learn(lines)
    return [*reader.feed(enumerate(lines, 1)), *reader.close()]


def _beginning(lines: Iterable[str]) -> Iterator[str]:
    size = 0
    for line in islice(lines, _LEARNT_LINES):
        size += len(line) + 1
        if size > _LEARNT:
            cut = line[: max(len(line) - (size - _LEARNT), 0) & ~1]
            yield cut[: cut.rfind(" ") + 1] or cut
            return
        yield line


def _read(reader: LineReader, line: str, number: int) -> Iterator[LogLine]:
    if len(line) <= _MOST or line[:_MOST].isalnum():  # nothing to cut at
        yield reader.read(line, number)
        return
    for match in _PORTION.finditer(line):
        yield reader.read(match[0], number)


def _safe_cut(lines: Sequence[LogLine]) -> int:
    """How many of these lines can be settled without those to come: up to one without any runs, if there is one."""
    least = len(lines) // 2
    return next(
        (i for i in range(len(lines) - 1, least, -1) if not lines[i].runs and not lines[i].continues), len(lines)
    )


def _contents(line: LogLine, experience: Experience) -> Iterator[Piece | UnreadLine]:
    """What a line gives: its bytes, then what of it was not read."""
    chosen = [run for run in line.runs if run.taken]
    text = shortened(line.text, 200)
    for i, run in enumerate(chosen):
        repeats = bool(run.checked) and all(span.repeats for span in run.checked)
        yield Piece(
            run.data, line.number, text, run.ascii, run.mark, line.t_ns, line.port, line.continues and not i,
            run.checked[0].envelope if run.checked else "", repeats, line.stamped,
        )  # fmt: skip
    for why in _left_out(line, chosen):
        yield UnreadLine(line.number, text, why, empty=why.startswith("no bytes"))
    if not chosen and line.problem is None and line.runs and not line.quiet:
        yield UnreadLine(line.number, text, *_why(line, experience))


def _left_out(line: LogLine, chosen: Sequence[ByteRun]) -> Iterator[str]:
    """Why a line is not read whole, of which something is."""
    if line.problem is not None:
        yield line.problem
    for cut, same in groupby(chosen, lambda run: run.cut):
        run = next(same)
        if cut:
            why = "shows the first {} bytes only" if run is chosen[-1] else "omits bytes after the first {}"
            yield f"the text {why.format(len(run.data))}"
    if any(run.halved for run in chosen):
        yield halves(line.clean) or "half a byte"
    elif line.problem is None:
        beside = [run for run in line.runs if chosen and _is_left(run) and not _is_check_value(run, chosen)]
        left = ", ".join(quoted(line.clean[run.start : run.end]) for run in beside)
        yield from [f"{left} beside the bytes may also be bytes"] * bool(left)
    for word in _spoilt(line, chosen):
        yield f"{quoted(word)} among the bytes is not a byte"


def _spoilt(line: LogLine, chosen: Sequence[ByteRun]) -> Iterator[str]:
    """Words that part bytes without a right check value, or touch their end, as a byte that is mistyped does."""
    runs = [] if any(run.checked for run in chosen) else chosen
    ends = [run.start for run in runs[1:]] + [None]
    for run, end in zip(runs, ends, strict=False):
        words = line.clean[run.end : end].split()[: _WORDS[end is None]]
        if all(map(_is_mistyped, words)):
            yield from words


def _is_mistyped(word: str) -> bool:
    """Whether a letter and a digit are where two hex digits may have been."""
    return word.isalnum() and 0 < sum(map(str.isdigit, word)) < len(word) <= _TYPED


def _is_left(run: ByteRun) -> bool:
    """Whether a run beside others looks like bytes and was not read, and no word was said of it."""
    pairs = run.shape in _PLAIN_PAIRS and len(run.data) > 1
    return not run.taken and run.why is None and (run.level > Writing.NUMBER or pairs)


def _is_check_value(run: ByteRun, chosen: Sequence[ByteRun]) -> bool:
    """Whether it is the check value of a frame in its line, said once more."""
    ways = (run.data, run.data[::-1])
    return len(run.data) == _CRC and any(one.checked and one.data[-_CRC:] in ways for one in chosen)


def _why(line: LogLine, experience: Experience) -> tuple[str, bool]:
    """Why nothing of a line was read, and whether it does not look like bytes at all."""
    reason = next(filter(None, (run.why for run in line.runs)), None) or halves(line.clean)
    if reason:
        return reason, False
    run = max(line.runs, key=lambda run: (run.level, len(run.data)))
    shown = line.clean[run.start : run.end]
    few = len(run.data) < 3 or (_NUMBERS.fullmatch(shown) and (len(run.data) == 3 or experience.shapes))
    other = shown.isalpha() or run.shape == "base64" or shown.count(".") == _POINTS
    if run.level is Writing.NUMBER and (few or other or is_named_otherwise(line.clean[: run.start])):
        return f"no bytes found in {quoted(line.text)}", True
    return f"{quoted(shown)} may be anything: no check value confirms that these are bytes", False


def joined(reads: Iterable[Piece | UnreadLine], limit: float = inf) -> Iterator[Piece | UnreadLine]:
    """The same with pieces that continue one put together, up to about `limit` bytes each.

    Of a packet with its headers, what it carries.
    """
    parts: list[Piece] = []
    size = 0
    for read in reads:
        if isinstance(read, UnreadLine):
            yield read
            continue
        if parts and not (size < limit and _goes_on(parts[0], read)):
            yield _whole_read(parts)
            parts, size = [], 0
        parts.append(read)
        size += len(read.data)
    if parts:
        yield _whole_read(parts)


def _goes_on(first: Piece, read: Piece) -> bool:
    """Whether a piece is of the read of another. With a stamp of its own only a byte in a table's row, at its time."""
    return read.continues and not (read.stamped and (len(read.data) > 1 or read.t_ns != first.t_ns))


def _whole_read(parts: Sequence[Piece]) -> Piece | UnreadLine:
    data, first = b"".join(part.data for part in parts), parts[0]
    payload = payload_of(data)
    if payload is None:
        return replace(first, data=data)
    if not payload.data:
        return UnreadLine(first.line, first.text, "a packet that carries nothing")
    return replace(first, data=payload.data, mark=first.mark or payload.mark, envelope="")
