"""What this tool says in comments of pcapng packets, for people, and for itself when it reads the file again."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from ..recording.notes import Note
from .packets import LONGEST

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
