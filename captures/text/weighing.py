"""What no check value supports, weighed where others of the text are right: a sum of bits, above which nothing stands.

Words of a stack, a session's number, a hash beside frames look like bytes. For them speaks that they are written as
what is right, that a mark or known words stand before them, or a header that says their length.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

from .candidates import Writing
from .choosing import MOST_JUDGED, ByteRun, Experience
from .columns import COLUMN_SHAPE
from .judging import ByteJudge
from .loglines import LogLine

_PRIOR: Final = {"words": -3.0, "pairs": 1.0, "base64": -6.0, "swapped words": -3.0, "pairs:": -1.0, "pairs-": -1.0}
_ASCII: Final = -3.0  # a frame of ASCII mode whose LRC is wrong: a colon stands before many numbers
_SIGNED: Final = 4.0  # a writing with signs of its own
_ALIKE: Final = 4.0  # written as what is right
_APART: Final = -2.0  # in words as wide as nothing that is right
_NUMBERS: Final = -1.0  # as people write numbers, too
_MARKED: Final = 4.0
_TRUSTED: Final = 4.0  # behind words behind which others are right
_HEADED: Final = 6  # bytes for which a header speaks
_RIGHT: Final = 16.0
_HARDLY: Final = 4.0  # so little speaks for it that anything plainer outweighs it
_NEVER: Final = 99.0


def leave_out_unsupported(lines: Sequence[LogLine], judge: ByteJudge, experience: Experience) -> None:
    """Take back what was taken for its looks alone, where others are right, or look more like bytes."""
    groups = [group for read in reads_of(lines) for group in _written_alike(read)]
    columns = (run for group in groups for _, run in group if run.shape == COLUMN_SHAPE and run.checked)
    experience.builds.update(run.build for run in columns)
    bits = [_bits_of(group, experience) for group in groups]
    experience.plainest = max(experience.plainest, *bits, -_HARDLY)
    least = 0.0 if experience.builds else -_HARDLY if experience.plainest > 0 else -_NEVER
    for group, weight in zip(groups, bits, strict=True):
        if weight <= least and not _is_announced(group, judge):
            for line, run in group:
                run.taken = line.continues = False


def _is_announced(group: Sequence[tuple[LogLine, ByteRun]], judge: ByteJudge) -> bool:
    """Whether a run is as long as its header says."""
    return any(len(run.data) >= _HEADED and judge(run.data[:MOST_JUDGED], damaged=True) for _, run in group)


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
    begins = [
        i
        for i, ((_, above), (_, run)) in enumerate(pairwise(read), 1)
        if above.build != run.build and not run.checked and run.offset is None
    ]
    return (read[first:last] for first, last in pairwise([0, *begins, len(read)]))


def _bits_of(group: Sequence[tuple[LogLine, ByteRun]], experience: Experience) -> float:
    if any(run.checked or run.joined or run.sure or run.shape == COLUMN_SHAPE for _, run in group):
        return _RIGHT
    return max(_bits(run, experience) for _, run in group)


def _bits(run: ByteRun, experience: Experience) -> float:
    bits = _ASCII if run.ascii else _PRIOR.get(run.shape, _SIGNED if run.level is Writing.BYTES else 0.0)
    alike = run.build in experience.builds
    bits += _ALIKE if alike else _APART if run.build != run.shape else 0.0
    bits += _NUMBERS if experience.builds and not alike and run.level is Writing.LIKELY else 0.0
    bits += _MARKED if run.mark else 0.0
    bits += _TRUSTED if run.label and (run.label, run.shape) in experience.proven else 0.0
    return bits


_NOT_BUT: Final = ("!=", "<>")
_CALLED_COMPUTED, _COUNT, _UNIT = (
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r"\b(?:expect\w*|actual|calculat\w*|comput\w*|should be)\b\W{0,5}(?:0x)?$",
        r"(?<![\w.])(?:(\d{1,4}) ?|(?:single|one)[ -])(?:bytes?|байта?|字节)\b(?: frame)?\)?[\s:=]{1,3}(?:0x)?$",
        r"\.\d|\s?(?:[muµ]s|ns|мк?с|сек|m[VA]|kWh?|k?Hz|°|%|bar|baud|bps|[kM]B|RUB|EUR|USD|руб|шт|times|retries)(?!\w)",
    )
)
_NEAR: Final = 24  # characters
_NUMBER: Final = 2  # bytes that may be one number


def is_measured(run: ByteRun, line: LogLine) -> bool:
    """Whether a few digits are a number with a unit or a fraction, or one that a sentence has in parentheses."""
    aside = line.clean[: run.start].endswith(" (") and line.clean.startswith(")", run.end)
    if len(run.data) <= _NUMBER and run.level is Writing.NUMBER and aside:
        return True
    return len(run.data) < _HEADED and _UNIT.match(line.clean, run.end) is not None


def is_counted(run: ByteRun, line: LogLine) -> bool:
    """Whether the words before say that just so many bytes follow."""
    count = _COUNT.search(line.clean[max(run.start - _NEAR, 0) : run.start])
    return count is not None and int(count[1] or 1) == len(run.data)


def is_computed(run: ByteRun, line: LogLine) -> bool:
    """Whether the words before say that somebody has computed or expected it: it was not on the line."""
    return _CALLED_COMPUTED.search(line.clean[max(run.start - _NEAR, 0) : run.start]) is not None


_RECORD_AROUND: Final = 5  # bytes of a record of Intel HEX: how many it carries, two of an address, a type, a sum
_RECORD_TYPES: Final = 6


def leave_out_records(lines: Sequence[LogLine]) -> None:
    """Lines of a program in Intel HEX, whose sum is that of ASCII mode: no traffic where all of a text are such.

    A request may look like one (`:020300000002F9`), so that one at least must be right, and no frame.
    """
    colons = [line for line in lines if line.clean.lstrip()[:1] == ":"]
    runs = [run for line in colons for run in line.runs]
    if all(_is_record(line.clean.strip()) for line in colons) and any(run.ascii and not run.checked for run in runs):
        for run in runs:
            run.taken, run.why = False, "records of a program in Intel HEX"


def _is_record(text: str) -> bool:
    try:
        record = bytes.fromhex(text[1:])
    except ValueError:
        return False
    if len(record) < _RECORD_AROUND or sum(record) & 0xFF:
        return False
    return record[0] == len(record) - _RECORD_AROUND and record[3] < _RECORD_TYPES


def leave_out_computed(lines: Sequence[LogLine]) -> None:
    """What a text says to be something else than what it received is no traffic."""
    for line in lines:
        for before, run in pairwise(line.runs):
            if before.taken and line.clean[before.end : run.start].removesuffix("0x").rstrip(" [('\"").endswith(
                _NOT_BUT
            ):
                run.taken, run.why = False, "the bytes expected in place of those before"
