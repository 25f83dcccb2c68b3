"""Lines of serial logs: bytes, times, marks and labels, whichever tool wrote them.

Lines whose layout is a tool's own are declared in `captures.text.tools`. Every other line is read by common sense: the
stamp is taken out, the rest is cut at its direction marks, and bytes are looked for in each part.

`LineReader` keeps what one line says for the next: a header line (time and mark of the hex lines below it), the offsets
of a dump, the midnight that a log of times of day passed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from captures.text import stamps
from captures.text.hexshapes import Found, HexError, decimals, dump_line, find, strict, unescape
from captures.text.marks import NONE, segments
from captures.text.tools import MARK_WORDS, SHAPES, Role, Shape

LONG_LINE = 1 << 20  # characters: beyond it a line is only looked at as bare hex digits
_ANSI = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
_COMMENT = re.compile(r"(?:^\s*(?:#|//|;|--$)|\s(?:#|//)\s).*$")
_WORD = re.compile(r"\w")
_BARE_HEX = re.compile(r"[0-9A-Fa-f\s]+")


# Tried after everything else: a time and the name of who speaks, bytes below.
_JPNEVULATOR = re.compile(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{6}: (?P<label>\S.*?)\s*$")
_SOCAT_BYTES = re.compile(r"^ ((?:[0-9a-f]{2} ){0,15}[0-9a-f]{2})(?:  .*)?$")


@dataclass(frozen=True, slots=True)
class Piece:
    """Bytes of a log with what is known of them; `t_ns` counts on past midnight where the log has times of day.

    `continues` says that these bytes belong to the same read, or dump, as the piece before.
    """

    data: bytes
    line: int
    text: str
    ascii: bool = False
    mark: int = NONE
    t_ns: int | None = None
    label: str = ""
    continues: bool = False


@dataclass(frozen=True, slots=True)
class Reading:
    """What one line gave: pieces, and in `problem` why not all of it could be used."""

    pieces: tuple[Piece, ...] = ()
    problem: str | None = None
    halved: bool = False  # the problem is digits that are meant as bytes and do not come in pairs


@dataclass(slots=True)
class _Header:
    """What a header line says of the hex lines below it."""

    mark: int
    t_ns: int | None
    label: str
    left: int | None  # bytes still to come, where the header told
    fresh: bool = True


@dataclass(slots=True)
class LineReader:
    """Reads a log line by line; bytes of a tool's second report of the same bytes are left out.

    With `decimal` bytes are decimal numbers; that is for a text in which no others were found.
    """

    decimal: bool = False
    _header: _Header | None = None
    _dump: tuple[int, int] | None = None  # bytes of the dump so far, offset of its first line
    _days: int = 0
    _newest: int | None = None
    _received: bool = False  # pymodbus reports received bytes by themselves, not only those it processes
    _tools: list[Shape] = field(default_factory=lambda: list(SHAPES))

    def read(self, line: str, number: int) -> Reading:
        """The bytes of a line. Never raises; a line that holds neither bytes nor anything known has a `problem`."""
        if len(line) > 4096 and _BARE_HEX.fullmatch(line):
            return self._bare(line, number)
        if len(line) > LONG_LINE:
            return Reading(problem=f"a line of {len(line)} characters is not a line of a log")
        text = _ANSI.sub("", line).replace("\x00", " ").rstrip("\r\n")
        if not text.strip():
            return Reading()
        try:
            if self.decimal:
                return self._any_line(text, number)
            return self._tool_line(text, number) or self._dump_line(text, number) or self._any_line(text, number)
        except HexError as error:
            return Reading(problem=str(error), halved=True)

    def _bare(self, line: str, number: int) -> Reading:
        try:
            found = strict(line)
        except HexError as error:
            return Reading(problem=str(error), halved=True)
        return Reading((self._piece(found, number, line[:80]),) if found else ())

    def _tool_line(self, text: str, number: int) -> Reading | None:
        header = self._header
        if header is not None and header.left:
            if (body := _SOCAT_BYTES.match(text)) is not None:
                data = bytes.fromhex(body[1])[: header.left]
                header.left -= len(data)
                piece = self._piece(Found(data), number, text)
                if not header.left:
                    self._header = None
                return Reading((piece,))
            self._header = None
            lost = f"{header.left} bytes that the line above announces are missing here"
            rest = self._tool_line(text, number) or self._any_line(text, number)
            return replace(rest, problem=rest.problem or lost)
        for i, shape in enumerate(self._tools):
            if (match := shape.pattern.match(text)) is not None:
                if i and shape.role is not Role.NOTHING:  # a log is of one tool: its shapes first from now on
                    self._tools.insert(0, self._tools.pop(i))
                return self._shaped(shape, match, number, text)
        return None

    def _shaped(self, shape: Shape, match: re.Match[str], number: int, text: str) -> Reading:
        groups = match.groupdict()
        if shape.role is Role.NOTHING:
            return Reading()
        mark = MARK_WORDS.get((groups.get("mark") or "").lower(), shape.mark)
        t_ns = self._time(stamps.find(_whole_fraction(groups.get("time") or ""))[0])
        length = int(groups["length"]) if groups.get("length") else None
        if shape.role is Role.HEADER:
            above = self._header
            if t_ns is None and above is not None and above.fresh:
                t_ns = above.t_ns  # its time stands in a line of its own
            self._header = _Header(mark, t_ns, "", length)
            return Reading()
        found = Found(unescape(groups["hex"])) if shape.role is Role.STRING else _payload(groups["hex"])
        if shape.tool == "pymodbus":
            self._received = self._received or match["mark"].lower() == "recv"
            if self._received and match["mark"].lower() == "processing":
                return Reading()
        if found is None:
            return Reading()
        problem = None
        if groups.get("cut") or found.cut:
            shown = f"{len(found.data)} of {length} bytes" if length else f"the first {len(found.data)} bytes"
            problem = f"the log shows {shown} only"
        data = found.data[: max(length, 0)] if length is not None else found.data
        if not data:
            return Reading(problem=problem)
        return Reading((Piece(data, number, text, found.ascii, mark, t_ns),), problem)

    def _dump_line(self, text: str, number: int) -> Reading | None:
        """A line of an offset dump, joined to the dump that it goes on with."""
        so_far = self._dump
        line = dump_line(text)
        if line is None:
            if so_far is not None and _is_offset(text.strip().rstrip(":"), so_far):
                return Reading()  # od and hexdump end with the length
            self._dump = None
            return None
        offset, data = line
        goes_on = so_far is not None and _is_offset(offset, so_far)
        self._dump = (so_far[0] + len(data), so_far[1]) if goes_on and so_far else (len(data), int(offset, 16))
        piece = self._piece(Found(data), number, text)
        return Reading((replace(piece, continues=goes_on or piece.continues),))

    def _any_line(self, text: str, number: int) -> Reading:
        stamp, rest = stamps.find(text)
        bare = _COMMENT.sub("", rest) if "#" in rest or "//" in rest or rest.lstrip()[:1] in (";", "-") else rest
        pieces: list[Piece] = []
        t_ns = self._time(stamp)
        problem, mark = None, NONE
        for segment in segments(bare):
            mark = NONE if segment.arrow and pieces else segment.mark or (NONE if pieces else mark)
            for found in (decimals if self.decimal else find)(segment.text) if _WORD.search(segment.text) else ():
                pieces.append(Piece(found.data, number, text, found.ascii, mark, t_ns))
                problem = f"the text shows the first {len(found.data)} bytes only" if found.cut else problem
        if not pieces:
            return self._no_bytes(text, t_ns, bare, mark)
        if stamp is None and mark == NONE and self._header is not None:
            first = self._piece(Found(pieces[0].data, pieces[0].ascii), number, text)
            return Reading((first, *(replace(piece, t_ns=first.t_ns) for piece in pieces[1:])), problem)
        self._header = None
        return Reading(tuple(pieces), problem)

    def _no_bytes(self, text: str, t_ns: int | None, bare: str, mark: int) -> Reading:
        if not _WORD.search(bare) and t_ns is None and not mark:
            return Reading()  # a comment, or a rule between entries
        if (match := _JPNEVULATOR.match(text)) is not None:
            self._header = _Header(mark, t_ns, match["label"], None)
            return Reading()
        if (t_ns is not None or mark) and not _WORD.search(segments(bare)[-1].text):
            self._header = _Header(mark, t_ns, "", None)
            return Reading()
        return Reading(problem=f"no bytes found in {_short(text.strip())!r}")

    def _piece(self, found: Found, number: int, text: str) -> Piece:
        """Bytes on a line of their own: mark and time are those of the header above."""
        header = self._header
        if header is None:
            return Piece(found.data, number, text, found.ascii)
        continues, header.fresh = not header.fresh, False
        return Piece(found.data, number, text, found.ascii, header.mark, header.t_ns, header.label, continues)

    def _time(self, stamp: stamps.Stamp | None) -> int | None:
        """Nanoseconds that go on past midnight."""
        if stamp is None:
            return None
        if not stamp.of_day:
            return stamp.t_ns
        if self._newest is not None and stamp.t_ns < self._newest - stamps.DAY_NS // 2:
            self._days += 1
        self._newest = stamp.t_ns
        return stamp.t_ns + self._days * stamps.DAY_NS


def joined(pieces: Iterator[Piece], limit: int | None = None) -> Iterator[Piece]:
    """Pieces with those that continue one put together, up to about `limit` bytes each."""
    held: Piece | None = None
    parts: list[bytes] = []
    size = 0
    for piece in pieces:
        if held is not None and piece.continues and (limit is None or size < limit):
            parts.append(piece.data)
            size += len(piece.data)
            continue
        if held is not None:
            yield held if len(parts) == 1 else replace(held, data=b"".join(parts))
        held, parts, size = piece, [piece.data], len(piece.data)
    if held is not None:
        yield replace(held, data=b"".join(parts))


def _payload(text: str) -> Found | None:
    found = find(text)
    return found[0] if found else None


def _is_offset(digits: str, so_far: tuple[int, int]) -> bool:
    """Whether these digits are where a dump goes on: in hex, or in octal as od writes it."""
    length, first = so_far
    if not re.fullmatch(r"[0-9A-Fa-f]{4,8}", digits):
        return False
    octal = set(digits) <= set("01234567") and not first
    return int(digits, 16) == first + length or (octal and int(digits, 8) == length)


def _whole_fraction(time: str) -> str:
    """socat 1.7 writes microseconds as nine digits: `.000394797` is 394797 us."""
    return re.sub(r"(?<=\d{4}/\d\d/\d\d \d\d:\d\d:\d\d\.)000(?=\d{6}$)", "", time)


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."
