"""Entries that are not a line each, made so: JSON over several, packets, rows left out, characters one by one.

Bytes are taken for what a packet carries (`tcpdump -X`, `tshark -x`) only where its headers agree on its length to the
byte: RFC 791, RFC 9293, RFC 768. hexdump, od and xxd write `*` in place of rows that are like the one above.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from .plain import NumberedLine

_OPENS: Final = re.compile(r"(\s*)(?:\[\s*|\}\s*,\s*)?\{\s*$")
_KEY: Final = re.compile(r'\s*"[^"]*"\s*:')
_ITEM: Final = re.compile(r"(\s*)- [\"']?[A-Za-z]\w*[\"']?:(?:\s|$)")
_TIMED: Final = re.compile(
    r"(?:[\"{\s'-]|^)(?:ts?|time\w*|date\w*|at|when|[\w.]*(?:time_?stamp|epoch)|(?:elapsed|uptime|t)(?:_?(?:ms|us|ns|s))?)[\"']?\s*:",
    re.IGNORECASE,
)
_ENTRY_LINES: Final = 1024  # lines of an entry
_NESTING: Final = re.compile(r'"(?:[^"\\]|\\.)*"?|[][{}]')
_SEVERAL: Final = re.compile(r"\}\s*,\s*\{")


def whole_entries(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    """Lines with their numbers, those of an indented entry as one line with the number of the first.

    An object that holds others in a list is none: they are. Items of YAML are those that have a time.
    """
    return _items(_objects(lines))


def _objects(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    held: list[NumberedLine] = []
    end = ""  # how the line begins that ends the object
    for number, line in lines:
        opens = _OPENS.match(line)
        if held and line.startswith(end):
            yield _whole([*held, (number, line if opens is None else "}")])
            held = []
            if opens is None:
                continue
        elif held and (opens or len(held) >= _ENTRY_LINES or (len(held) == 1 and not _KEY.match(line))):
            yield from held
            held = []
        if held or opens is not None:
            held.append((number, line))
            end = end if opens is None else opens[1] + "}"
        else:
            yield number, line
    yield from held


def _items(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    held: list[NumberedLine] = []
    inside = ""  # how its lines begin
    for number, line in lines:
        if held and (not line.strip() or not line.startswith(inside) or len(held) >= _ENTRY_LINES):
            yield from _timed(held)
            held = []
        begins = None if held else _ITEM.match(line)
        inside = inside if begins is None else begins[1] + " "
        if held or begins is not None:
            held.append((number, line))
        else:
            yield number, line
    yield from _timed(held)


def _timed(held: list[NumberedLine]) -> list[NumberedLine]:
    timed = len(held) > 1 and any(_TIMED.search(line) for _, line in held)
    return [_whole(held)] if timed else held


def _whole(held: Sequence[NumberedLine]) -> NumberedLine:
    return held[0][0], " ".join(line.strip() for _, line in held)


def entries_of(line: str) -> list[str]:
    """A line, or the objects apart of a list that stands in it, if each tells its time."""
    if line.lstrip()[:1] not in ("[", "{") or not _SEVERAL.search(line):
        return [line]
    depth = 0
    starts: dict[int, list[int]] = {}
    for token in _NESTING.finditer(line):
        if token[0] in "[{":
            depth += 1
            if token[0] == "{":
                starts.setdefault(depth, []).append(token.start())
        elif token[0] in "]}":
            depth -= 1
    first = min((level for level, places in starts.items() if len(places) > 1), default=0)
    if not first:
        return [line]
    parts = [line[start:end] for start, end in pairwise((*starts[first], len(line)))]
    if sum(bool(_TIMED.search(part)) for part in parts) <= len(parts) / 2:
        return [line]
    return [head, *parts] if (head := line[: starts[first][0]]).strip("[ ") else parts


_IP_AT: Final = {0: None, 14: 12, 16: 14, 18: 16}  # where IP begins: bare, Ethernet, Linux SLL, VLAN; and its type
_IPV4: Final = b"\x08\x00"
_LEAST_IP: Final = 20
_LEAST_FRAME: Final = 60  # bytes that Ethernet fills up to
_TCP: Final = 6
_UDP: Final = 17
_UDP_HEADER: Final = 8
_MODBUS_PORT: Final = 502
_TX, _RX = 1, 2


class Payload(NamedTuple):
    """The bytes of a TCP segment or UDP datagram, none of an acknowledgement; `mark` by the port of Modbus, or 0."""

    data: bytes
    mark: int


def payload_of(packet: bytes) -> Payload | None:
    """What a whole packet carries; None of all other bytes."""
    for at, kind in _IP_AT.items():
        if kind is None or packet[kind:at] == _IPV4:
            found = _of_ip(packet, at)
            if found is not None:
                return found
    return None


def _of_ip(packet: bytes, at: int) -> Payload | None:
    if len(packet) < at + _LEAST_IP or packet[at] >> 4 != 4:
        return None
    header, total = 4 * (packet[at] & 15), _number(packet, at + 2)
    filled = at > 0 and len(packet) == _LEAST_FRAME
    if header < _LEAST_IP or (at + total != len(packet) and not (filled and at + total < len(packet))):
        return None
    begin, end, protocol = at + header, at + total, packet[at + 9]
    if protocol == _TCP and begin + 20 <= end and 20 <= (size := packet[begin + 12] >> 4 << 2) <= end - begin:
        return _marked(packet, begin, packet[begin + size : end])
    if protocol == _UDP and begin + _UDP_HEADER <= end and _number(packet, begin + 4) == end - begin:
        return _marked(packet, begin, packet[begin + _UDP_HEADER : end])
    return None


def _marked(packet: bytes, begin: int, data: bytes) -> Payload:
    source, destination = _number(packet, begin), _number(packet, begin + 2)
    return Payload(data, _TX if destination == _MODBUS_PORT else _RX if source == _MODBUS_PORT else 0)


def _number(packet: bytes, at: int) -> int:
    return int.from_bytes(packet[at : at + 2], "big")


_ROW: Final = re.compile(r"^(?P<lead>\s*)(?P<offset>[0-9A-Fa-f]{4,8})(?P<rest>:?\s+\S.*)?$")
_OCTAL: Final = frozenset("01234567")
_OD_DIGITS: Final = 7  # of an offset in octal
_WIDTH: Final = 16  # bytes of a row, unless two rows say otherwise
_ROWS_AGAIN: Final = 4096  # rows that are written again in one text


class _DumpRow(NamedTuple):
    lead: str
    offset: str
    rest: str


def with_repeats(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    """Lines with their numbers, each `*` between two rows of a dump as the rows for which it stands."""
    above: list[_DumpRow] = []  # the last two rows
    held: NumberedLine | None = None
    left = _ROWS_AGAIN
    for number, line in lines:
        if above and line.strip() == "*":
            held = held or (number, line)
            continue
        row = _row(line)
        if held is not None:
            rows = _between(above, row.offset) if row is not None else ()
            if 0 < len(rows) <= left:
                left -= len(rows)
                for text in rows:
                    yield held[0], text
            else:
                yield held
            held = None
        above = [*above[-1:], row] if row is not None and row.rest else []
        yield number, line
    if held is not None:
        yield held


def _row(line: str) -> _DumpRow | None:
    match = _ROW.match(line.rstrip("\r\n"))
    return None if match is None else _DumpRow(match["lead"], match["offset"], match["rest"] or "")


def _between(above: list[_DumpRow], following: str) -> list[str]:
    """The rows between the last one and the next offset; none where the offsets do not say how many."""
    last = above[-1]
    for base in _bases(above, following):
        begin, end = int(last.offset, base), int(following, base)
        width = begin - int(above[0].offset, base) if len(above) > 1 else _WIDTH
        count = (end - begin) // width - 1 if width > 0 else 0
        if 0 < count <= _ROWS_AGAIN and end - begin - (count + 1) * width < width:
            digits = "o" if base == 8 else "x"
            numbers = (f"{begin + i * width:0{len(last.offset)}{digits}}" for i in range(1, count + 1))
            return [f"{last.lead}{number}{last.rest}" for number in numbers]
    return []


def _bases(above: list[_DumpRow], following: str) -> tuple[int, ...]:
    """In which base offsets can be: od writes seven octal digits before bytes."""
    offsets = [row.offset for row in above] + [following]
    if not all(len(one) == _OD_DIGITS and set(one) <= _OCTAL for one in offsets):
        return (16,)
    if len(above) > 1:
        return (16,) if int(offsets[1], 16) - int(offsets[0], 16) == _WIDTH else (8,)
    return (16, 8)


_CHARACTER: Final = re.compile(r"^(?P<head>(?:.{0,60}[\s:>=])?)(?P<quote>['\"]?)(?P<char>[:0-9A-F])(?P=quote)\s*$")
_LEAST: Final = 9  # characters of a frame from its colon on, without its end
_ADU_CHARS: Final = 513


def whole_words(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    """Lines with their numbers, those that show a frame's characters one each as one line with the number of the first.

    A frame begins with its colon; what stands before each of its characters is the same.
    """
    held: list[NumberedLine] = []
    head, word = "", ""
    for number, line in lines:
        shown = _CHARACTER.match(line)
        char = "" if shown is None else shown["char"]
        if held and (char in ("", ":") or line[: len(head)] != head or len(word) >= _ADU_CHARS):
            yield from held if len(word) < _LEAST else [(held[0][0], head + word)]
            held, word = [], ""
        if shown is None or not (held or char == ":"):
            yield number, line
            continue
        held.append((number, line))
        head, word = shown["head"], word + char
    yield from held if len(word) < _LEAST else [(held[0][0], head + word)]
