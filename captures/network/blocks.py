"""Blocks of pcapng files as bytes, and what this tool puts into such files for itself.

Settings of the line and raw reads. Raw reads stand in blocks of a type for local use, which other programs step over:
columns of reads, packed by zlib. So a file of frames that Wireshark dissects still holds the capture that they came
from, bit for bit. And what it says in comments of packets, for people, and for itself when it reads the file again.
"""

from __future__ import annotations

import json
import re
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..chunks import Block, columns
from ..limits import TIME_LIMIT
from ..line import LineSettings
from ..recording.notes import Note
from .packets import LONGEST

SECTION, INTERFACE, OLD_PACKET, SIMPLE_PACKET, ENHANCED_PACKET = 0x0A0D0D0A, 1, 2, 3, 6
READS: Final = 0x80527473  # for local use
COMMENT, NAME, FLAGS, APPLICATION, SPEED, RESOLUTION, OFFSET = 1, 2, 2, 4, 8, 9, 14  # options, by their block
TEXT: Final = 60_000  # bytes of one comment, at most
_MARK: Final = "rtuscope line settings: "
_COUNTS: Final = struct.Struct("<IIII?")  # reads, bytes, bytes in error, bytes when unpacked; whether timed
_MOST: Final = 1 << 26  # bytes of reads in one block, unpacked


def pcapng_block(kind: int, body: bytes) -> bytes:
    """A block, little-endian; the body's length is a multiple of 4."""
    size = len(body) + 12
    return struct.pack("<II", kind, size) + body + struct.pack("<I", size)


def pcapng_option(code: int, value: bytes) -> bytes:
    """An option of a block; the end of a list of them is four zeros."""
    return struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)


def options(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Codes and values of a list of options in this byte order, as far as it is whole."""
    at = 0
    while at + 4 <= len(data):
        code, size = struct.unpack_from(f"{order}HH", data, at)
        if code == 0:
            return
        yield code, data[at + 4 : at + 4 + size]
        at += 4 + (size + 3 & ~3)


def section(line: LineSettings, *, timed: bool, reads: bool, more: bytes = b"") -> bytes:
    """A section's header, with the settings of the line as comments; `reads`: raw reads follow. `more`: options."""
    text = json.dumps({**line.to_header(), "timed": timed, "reads": reads})
    texts = [text[i : i + TEXT] for i in range(0, len(text), TEXT)]
    comments = b"".join(pcapng_option(COMMENT, f"{_MARK}{part}".encode()) for part in texts)
    return pcapng_block(SECTION, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1) + more + comments + bytes(4))


def settings_in(comments: Iterable[str]) -> Mapping[str, object]:
    """What `section` wrote of the line; nothing where these are other comments."""
    text = "".join(comment.removeprefix(_MARK) for comment in comments if comment.startswith(_MARK))
    try:
        header = json.loads(text)
    except ValueError:
        return {}
    return header if isinstance(header, dict) else {}


def reads_block(block: Block) -> bytes:
    """Raw reads as a block of the file."""
    sizes = np.diff(block.offsets)
    steps = np.diff(block.t_ns, prepend=np.int64(0))
    parts = (steps.astype("<i8"), sizes.astype("<u4"), block.errors.astype("<u4"), block.port, block.mark, block.data)
    body = b"".join(part.tobytes() for part in parts)
    packed = zlib.compress(body, 1)
    head = _COUNTS.pack(len(block), len(block.data), len(block.errors), len(body), block.timed)
    body = head + packed
    return pcapng_block(READS, body + bytes(-len(body) % 4))


def reads_in(body: bytes) -> Block:
    """The reads of such a block's body; ValueError where it is damaged."""
    try:
        count, octets, wrong, size, timed = _COUNTS.unpack_from(body)
        if size > _MOST or size != 14 * count + 4 * wrong + octets:
            raise ValueError("sizes that do not fit each other")
        data = zlib.decompressobj().decompress(body[_COUNTS.size :], size)
    except (struct.error, zlib.error) as error:
        raise ValueError(str(error)) from error
    if len(data) != size:
        raise ValueError("cut")
    t_ns = np.cumsum(np.frombuffer(data, "<i8", count))
    sizes = np.frombuffer(data, "<u4", count, 8 * count).astype(np.int64)
    errors = np.frombuffer(data, "<u4", wrong, 12 * count).astype(np.int64)
    port, mark = np.frombuffer(data, np.uint8, 2 * count, 12 * count + 4 * wrong).reshape(2, count)
    in_range = not count or (t_ns.min() > -TIME_LIMIT and t_ns.max() < TIME_LIMIT and sizes.min() > 0)
    ascending = not wrong or (np.diff(errors, append=octets).min() > 0)
    if not in_range or not ascending or sizes.sum() != octets or mark.max(initial=0) > 2:
        raise ValueError("values out of their range")
    extras: dict[str, NDArray[np.generic]] = {"port": port, "mark": mark, "errors": errors}
    return columns(data[14 * count + 4 * wrong :], sizes, t_ns, timed=bool(timed), extras=extras)


_ERRORS: Final = re.compile(r"parity or framing error at bytes? (\d{1,8}(?:-\d{1,8})?(?:, \d{1,8}(?:-\d{1,8})?)*)")
_RANGES: Final = 1000  # in one comment
_NOTE: Final = re.compile(r"note ([\w-]{1,40}): (.*)", re.S)


def errors_comments(offsets: Sequence[int]) -> list[str]:
    """The comments on a packet with bytes in error; `offsets` are theirs, ascending."""
    ranges: list[list[int]] = []
    for offset in offsets:
        if ranges and ranges[-1][1] == offset - 1:
            ranges[-1][1] = offset
        else:
            ranges.append([offset, offset])
    words = [str(first) if first == last else f"{first}-{last}" for first, last in ranges]
    parts = [", ".join(words[i : i + _RANGES]) for i in range(0, len(words), _RANGES)]
    return [f"parity or framing error at byte{'s' if len(offsets) > 1 else ''} {part}" for part in parts]


def errors_of(comment: str) -> list[int] | None:
    """The offsets that `errors_comments` wrote; None for another comment."""
    match = _ERRORS.fullmatch(comment)
    if match is None:
        return None
    bounds = [[int(number) for number in word.split("-")] for word in match[1].split(", ")]
    if sum(bound[-1] - bound[0] for bound in bounds) > LONGEST:
        return None
    return [offset for bound in bounds for offset in range(bound[0], bound[-1] + 1)]


def note_comment(note: Note) -> str:
    """A note of a recording as a comment."""
    return note.text if note.kind == "comment" else f"note {note.kind}: {note.text}"


def note_of(t_ns: int, comment: str) -> Note:
    """A comment as a note of the capture."""
    match = _NOTE.fullmatch(comment)
    return Note(t_ns, "comment", comment) if match is None else Note(t_ns, match[1], match[2])
