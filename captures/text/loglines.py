"""Lines of serial logs: their times, marks and headings, and the runs of characters in them that may be bytes.

Lines whose layout is a tool's own are declared in `captures.text.tools`. Every other line is read by common sense: the
stamp is taken out, marks are looked for, and what can be bytes in any shape is a run. Which runs are bytes is decided
with the lines around, in `captures.text.settling`.

`LineReader` keeps what one line says for the next: a heading (time and mark of the rows below it), the offsets of a
dump, the midnight that a log of times of day passed.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field
from datetime import tzinfo
from typing import TYPE_CHECKING, Final

from captures.text import stamps

from .candidates import WORD, HexWindow, Writing, halves, is_ruler, line_of
from .choosing import label_in, runs_in, with_marks
from .dumps import Dump
from .escapes import unescape
from .headings import FULL_ROW, Heading, TimeColumn, counted, marks_of_cells, of_days, time_column
from .judging import ByteJudge, no_judge
from .plain import plain, quoted
from .runs import ByteRun, Experience, is_whole
from .timeforms import Stamp
from .tools import MARK_WORDS, NONE, SHAPES, LineMark, LineRole, Shape, marks

if TYPE_CHECKING:
    from .tokens import NumberToken

_BARE_LEAST: Final = 4096  # characters of a line that is worth a look whether it is nothing but hex digits
_COMMENT: Final = re.compile(r"^\s*(?:#|//|;|--|/?\*)")
_ANNOUNCED: Final = re.compile(
    r"(?i)(?:\b(\d{1,5}) ?bytes?\b|/(\d{1,5}):?$|\b(?:write|read|length|len|size)[ =:]+(\d{1,5})$)"
)
_JPNEVULATOR: Final = re.compile(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{6}: (?P<label>\S.*?)\s*$")
_SOCAT_BYTES: Final = re.compile(r"^ ((?:[0-9a-f]{2} ){0,8191}[0-9a-f]{2})(?:  .*)?$")
_OCTET: Final = re.compile(r"(?<![0-9A-Za-z])[0-9A-Fa-f]{2}[hH](?![0-9A-Za-z])")
_CODE_SPAN: Final = re.compile(
    r"(?<=[0-9A-Fa-f\]>)}])( ?)`(?=[\[<({]?[0-9A-Fa-f]{2})"
)  # Markdown's marks about a part of a frame, as of its check value
_LABELLED: Final = 56  # characters of a heading that name it
_REMEMBERED: Final = 2048  # lines
_STAMPS: Final = 4096  # times that are looked at


@dataclass(slots=True)
class LogLine:
    """One line: what it holds, and what is known of it.

    `t_ns` counts on past midnight where the log has times of day. `continues`: its first run belongs to the same read,
    or dump, as the bytes before. `stamped`: its time is its own, not that of a line above.
    `quiet`: a line that is known to hold no bytes. `problem` is what it could not give.
    """

    number: int
    text: str
    clean: str = ""
    runs: list[ByteRun] = field(default_factory=list)
    t_ns: int | None = None
    fine: bool = False
    port: str = ""
    continues: bool = False
    quiet: bool = False
    problem: str | None = None
    stamped: bool = False
    numbers: tuple[NumberToken, ...] | None = None  # what of it may be a byte in a column, once somebody asked

    @property
    def is_known(self) -> bool:
        """Whether it is known for what it is: a line without bytes, or a row of a dump behind its offset."""
        if not self.runs:
            return self.quiet
        return self.runs[0].offset is not None and len(self.runs[0].data) >= FULL_ROW

    def is_all(self, run: ByteRun) -> bool:
        """Whether a run of it is all that it has of words and numbers."""
        return not any(map(str.isalnum, self.clean[: run.start] + self.clean[run.end :]))

    def begins_with(self, run: ByteRun) -> bool:
        """Whether no word is before a run of it."""
        return run.offset is not None or not any(map(str.isalnum, self.clean[: run.start]))

    def ends_with(self, run: ByteRun) -> bool:
        """Whether no word is behind a run of it."""
        return run.offset is not None or not any(map(str.isalnum, self.clean[run.end :]))


LineMemory = dict[str, tuple[int, list[LineMark], list[ByteRun]]]  # what was met, and how much was learnt then


@dataclass(slots=True)
class LineReader:
    """Reads a log line by line; bytes of a tool's second report of the same bytes are left out.

    `zone` is that of dates without one (None: this machine's), `sample_rate` of logs that count samples, in Hz.
    """

    judge: ByteJudge = no_judge
    zone: tzinfo | None = None
    sample_rate: float | None = None
    experience: Experience = field(default_factory=Experience)
    zoneless: bool = False  # a date without a zone was met
    stamps: deque[Stamp] = field(default_factory=lambda: deque(maxlen=_STAMPS))
    _heading: Heading | None = None
    _dump: Dump = field(default_factory=Dump)
    _times: TimeColumn | None = None  # of the table that is being read
    _days: int = 0
    _elapsed_ns: int = 0  # by steps
    _newest: int | None = None
    _received: bool = False  # pymodbus reports received bytes by themselves, not only those it processes
    memory: LineMemory = field(default_factory=dict)
    _tools: list[Shape] = field(default_factory=lambda: list(SHAPES))

    def read(self, line: str, number: int) -> LogLine:
        """What a line holds. Never raises."""
        if len(line) > _BARE_LEAST and (bare := self._bare(line, number)) is not None:
            return bare
        text = plain(line)
        if not text.strip(" \t`~"):
            return LogLine(number, line, quiet=True)
        return self._below_header(text, number) or self._tool_line(text, number) or self._any_line(text, number)

    def runs_of(self, text: str) -> list[ByteRun]:
        """The runs of a line by itself."""
        return self._searched(stamps.find(text, self.zone)[1])[1]

    def _bare(self, line: str, number: int) -> LogLine | None:
        """A long line of nothing but pairs of hex digits; None for others."""
        with suppress(ValueError):
            if data := bytes.fromhex(line):
                run = ByteRun(data, 0, len(line), "pairs", Writing.BYTES, checked=self.judge(data[:_BARE_LEAST]))
                return self._placed(LogLine(number, line[:80], runs=[run]), None, 0)
        return None

    def _below_header(self, text: str, number: int) -> LogLine | None:
        """A row of bytes that a tool's header has announced."""
        heading = self._heading
        if heading is None or not heading.left or not heading.exact:
            return None
        if (body := _SOCAT_BYTES.match(text)) is not None:
            data = bytes.fromhex(body[1])[: heading.left]
            run = ByteRun(data, 1, 1 + len(body[1]), "pairs", Writing.BYTES, mark=heading.mark, sure=True)
            left = heading.left - len(data)
            self._heading = heading._replace(left=left) if left else None
            return LogLine(number, text, text, [run], heading.t_ns, heading.fine, heading.port)
        self._heading = None
        parsed = self._tool_line(text, number) or self._any_line(text, number)
        parsed.problem = f"{heading.left} bytes that the line above announces are missing here"
        return parsed

    def _tool_line(self, text: str, number: int) -> LogLine | None:
        for i, shape in enumerate(self._tools):
            if (match := shape.pattern.match(text)) is not None:
                if shape.role is not LineRole.NOTHING:  # a log is of one tool: its shapes first from now on
                    self._tools.insert(0, self._tools.pop(i))
                return self._shaped(shape, match, number, text)
        return None

    def _shaped(self, shape: Shape, match: re.Match[str], number: int, text: str) -> LogLine | None:
        if shape.role is LineRole.NOTHING:
            return self._carries_nothing(text, number)
        groups = match.groupdict("")
        if shape.role is LineRole.HEADER:
            self._heading = self._shaped_heading(shape, groups)
            return LogLine(number, text, quiet=True)
        way = groups.get("mark", "").lower()
        line = LogLine(number, text, text, quiet=True)
        line.t_ns, line.fine = self._shaped_time(groups)
        self._received = self._received or way == "recv"
        if shape.tool == "pymodbus" and way not in ("send", "recv"):
            if self._received:  # what was received, once more
                return line
            if way not in MARK_WORDS:  # it may be a PDU alone
                return self._any_line(text, number)
        return self._with_payload(line, shape, groups, f"{shape.tool} {way}")

    def _with_payload(self, line: LogLine, shape: Shape, groups: Mapping[str, str], label: str) -> LogLine | None:
        """A tool's line with its bytes; None where it turns out to be another one."""
        run, above = self._payload(groups["hex"], shape, label), self._heading
        self._heading = None
        if run is None:
            return line if not WORD.search(groups["hex"]) else None
        if groups.get("cut"):
            line.problem = f"the log shows {len(run.data)} of {groups['length']} bytes only"
        if groups.get("length"):
            run.data = run.data[: max(int(groups["length"]), 0)]
        said = above.mark if shape.mark and above is not None and above.joins else NONE
        way = MARK_WORDS.get(groups.get("mark", "").lower())
        run.mark = way or said or shape.mark  # `Rx` in the line above says more than a layout
        run.sure, run.label = True, label
        if run.data:
            line.runs, line.quiet = [run], False
        return line

    def _shaped_heading(self, shape: Shape, groups: Mapping[str, str]) -> Heading:
        """What a tool's line says of the rows below; its time may stand in a line of its own above."""
        t_ns, fine = self._shaped_time(groups)
        if t_ns is None and self._heading is not None:
            t_ns, fine = self._heading.t_ns, self._heading.fine
        left = int(groups["length"]) if "length" in groups else None
        mark = MARK_WORDS[groups["mark"].lower()]
        return Heading(mark, t_ns, fine, shape.tool, left=left, joins=True, exact=True)

    def _carries_nothing(self, text: str, number: int) -> LogLine:
        heading = self._heading
        line = self._any_line(text, number)
        line.quiet, line.problem = True, None
        if not line.runs:
            self._heading = heading
        return line

    def _shaped_time(self, groups: Mapping[str, str]) -> tuple[int | None, bool]:
        """The time of a line in a tool's layout, and whether it goes beyond seconds."""
        if groups.get("sample") and self.sample_rate:
            return stamps.in_range(round(int(groups["sample"]) / self.sample_rate * 1e9)), True
        if groups.get("us"):
            return stamps.in_range(int(groups["us"]) * 1000), True
        return self._time(stamps.find(stamps.short_fraction(groups.get("time", "")), self.zone)[0])

    def _payload(self, text: str, shape: Shape, label: str) -> ByteRun | None:
        """The bytes of a tool's line, in whatever shape they stand; what was right in lines like it goes first."""
        if shape.role is LineRole.STRING:
            data = unescape(text)
            return ByteRun(data, 0, len(text), "\\x", Writing.BYTES, checked=self.judge(data))
        _, runs = self._searched(text)
        for run in runs:
            if not run.checked:
                ways: tuple[ByteRun | HexWindow, ...] = (run, *run.others)
                run.take(max(ways, key=lambda way: self.experience.trust(label, way.shape, direct=False)))
        return max(runs, key=lambda run: (bool(run.checked), run.level, len(run.data)), default=None)

    def _any_line(self, text: str, number: int) -> LogLine:
        stamp, rest = self._stamp(text)
        rest = _CODE_SPAN.sub(r"\1", rest)
        t_ns, fine = self._time(stamp)
        line = LogLine(number, text, rest, t_ns=t_ns, fine=fine, stamped=t_ns is not None)
        if self._has_no_bytes(line):
            line.quiet = True
            return line
        line_marks, line.runs = self._searched(rest)
        in_dump = self._dump.row is not None and any(run.offset is not None for run in line.runs[:1])
        if not (in_dump or self._is_counted(line) or any(run.is_likely for run in line.runs)):
            self._as_heading(line, line_marks)
            self._times = time_column(text) or self._times
        line.quiet = line.quiet or _is_ruler(line)
        if line.runs:
            return self._placed(line, stamp, line_marks[0].mark if line_marks else NONE)
        line.quiet = line.quiet or _COMMENT.match(text) is not None
        line.problem = None if line.quiet else halves(rest) or f"no bytes found in {quoted(text)}"
        return line

    def _has_no_bytes(self, line: LogLine) -> bool:
        """Whether a line is a time alone, which is that of the rows below, or what a dump has below its rows."""
        if WORD.search(line.clean):
            return self._dump.ends_with(line.clean) or self._dump.shows(line.clean)
        if line.t_ns is not None:
            self._heading = Heading(NONE, line.t_ns, line.fine, "", joins=True)
        return True

    def _stamp(self, text: str) -> tuple[Stamp | None, str]:
        """The time of a line, and the line without any."""
        if self._times is not None and (in_column := self._times.find(text)) is not None:
            return in_column[0], stamps.find(in_column[1], self.zone)[1]
        stamp, rest = stamps.find(text, self.zone)
        if stamp is None or not stamp.counter or self.experience.habits.counters:
            return stamp, rest
        self.stamps.append(stamp)
        return None, text

    def _searched(self, text: str) -> tuple[list[LineMark], list[ByteRun]]:
        """Marks and runs of a text without its times; logs repeat themselves, so what was met is remembered."""
        learnt = self.experience.taught
        remembered = self.memory.get(text)
        if remembered is None or (remembered[0] != learnt and not all(map(_is_settled, remembered[2]))):
            line_marks = marks(text)
            runs = runs_in(line_of(text, (mark.end for mark in line_marks)), self.judge, self.experience)
            with_marks(text, runs, line_marks)
            if len(text) > _BARE_LEAST:
                return line_marks, runs
            if len(self.memory) >= _REMEMBERED:
                self.memory.clear()
            remembered = self.memory[text] = learnt, line_marks, runs
        return remembered[1], [copy(run) for run in remembered[2]]

    def _as_heading(self, line: LogLine, line_marks: list[LineMark]) -> None:
        """A line of words: what it says of rows below."""
        rest = line.clean
        bare = bool(line_marks) and not WORD.search(rest[line_marks[-1].end :])
        said = [one.mark for one in line_marks if bare or not one.arrow]  # an arrow between words is none
        mark = said[-1] if len({*said}) == 1 else NONE  # `what I send and what comes`
        above, t_ns, fine = self._heading, line.t_ns, line.fine
        if t_ns is None and above is not None and not above.rows:
            t_ns, fine = above.t_ns, above.fine
        port = ""
        if (match := _JPNEVULATOR.match(line.text)) is not None:
            port, bare = match["label"], True
        announced = _ANNOUNCED.search(rest.rstrip(" :"))
        left = int(next(filter(None, announced.groups()))) if announced else None
        label = label_in(rest[-_LABELLED:])
        parted, cells = marks_of_cells(rest, line_marks)
        self._heading = Heading(mark, t_ns, fine, label, port, left, bare, parted=parted, cells=cells)
        line.quiet = bare and line.t_ns is not None and _OCTET.search(rest) is None

    def _is_counted(self, line: LogLine) -> bool:
        """Whether its first bytes are as many as the line above says, or as are left of those."""
        left = None if self._heading is None else self._heading.left
        for run in line.runs[:1]:
            run.counted = all((left == len(run.data), line.begins_with(run), line.ends_with(run)))
        return any(run.counted for run in line.runs)

    def _placed(self, line: LogLine, stamp: Stamp | None, mark: int) -> LogLine:
        """A line with bytes below its heading, and in its dump."""
        first = next((run for run in line.runs if run.is_likely), line.runs[0])
        line.continues = self._dump.goes_on(first, line.t_ns)
        heading = self._heading
        if heading is not None and not mark and not _is_worded(line, first):
            self._below(heading, line, first, stamped=stamp is not None)
            return line
        if heading is not None and line.t_ns is None and not heading.rows:
            line.t_ns, line.fine = heading.t_ns, heading.fine
        if first.is_likely:
            self._heading = None
        return line

    def _below(self, heading: Heading, line: LogLine, first: ByteRun, *, stamped: bool) -> None:
        """Put a line without words below its heading."""
        for run in line.runs:
            run.mark = run.mark or heading.mark_at(line.text, run.start)
            run.heading = "" if run.label else heading.label or " "
        if not stamped:
            goes_on = line.continues or (heading.takes(len(first.data)) and first.offset is None)
            line.continues = heading.rows > 0 and goes_on
            line.port, line.t_ns, line.fine = heading.port, heading.t_ns, heading.fine
            self._heading = heading.above(len(first.data))

    def _time(self, stamp: Stamp | None) -> tuple[int | None, bool]:
        """Nanoseconds that go on past midnight, or None where no capture holds them; whether they go beyond seconds."""
        return (None, False) if stamp is None else (stamps.in_range(self._counted_on(stamp)), stamp.fine)

    def _counted_on(self, stamp: Stamp) -> int:
        self.stamps.append(stamp)
        self.zoneless = self.zoneless or not (stamp.of_day or stamp.zoned)
        t_ns = counted(stamp, self.experience.habits.width)
        if stamp.unnamed and self.experience.habits.days:
            t_ns = of_days(t_ns)
        if stamp.signed and self.experience.habits.steps:
            self._elapsed_ns += t_ns
            return self._elapsed_ns
        if not stamp.of_day:
            return t_ns
        if self._newest is not None and t_ns < self._newest - stamps.DAY_NS // 2:
            self._days += 1
        self._newest = t_ns
        return t_ns + self._days * stamps.DAY_NS


def _is_worded(line: LogLine, run: ByteRun) -> bool:
    """Whether words stand before a run; the sign of Python's bytes is none."""
    before = line.clean[: run.start]
    if run.offset is not None:
        before = before[: before.rfind(run.offset)].removesuffix("0x")
    return any(map(str.isalpha, before.removesuffix("b'").removesuffix('b"')))


def _is_settled(run: ByteRun) -> bool:
    """Whether nothing that is learnt later reads it otherwise."""
    return is_whole(run) and not run.rivals


def _is_ruler(line: LogLine) -> bool:
    """Whether all of a line, or all that could be bytes, are the numbers above columns: `Offset  0  1  2 …`."""
    shown = [line.clean[run.start : run.end] for run in line.runs]
    return is_ruler(line.clean.strip(" |\t").split()) or (bool(shown) and all(is_ruler(s.split()) for s in shown))
