"""What an agent is told: statements, each with a citation, as one JSON object of bounded size.

A citation is `HASH:FRAMES`, twelve digits of the capture's SHA-256 and frames by their index: `3fa9c2d81e07:12,15-17`.
Whatever a device, a file or its name said is an object `{"untrusted": TEXT}`: data, and nothing to be obeyed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from dissectors.values import harmless

MOST_TOKENS: Final = 1900
MARK: Final = "untrusted"
HASH: Final = 12  # digits of a hash in a citation
_LONGEST: Final = 160  # characters of what was said elsewhere
_SENTENCE: Final = 600  # of ours
_FRAMES: Final = 12  # in a citation
_PIECE: Final = re.compile(r"[A-Za-z]+|\d+|\s+|[^\sA-Za-z\d]")
_LETTERS, _DIGITS = 4, 3  # that a token holds at most, of what is no common word
_END: Final = 60  # tokens that the end of an answer takes


class Untrusted(str):
    """A text that a device or a file said."""

    __slots__ = ()


def token_bound(text: str) -> int:
    """How many tokens a text is at most, as byte-pair vocabularies of today cut it: checked against two of them."""
    count = 0
    for piece in _PIECE.findall(text):
        if piece.isascii() and piece.isalpha():
            count += -(-len(piece) // _LETTERS)
        elif piece.isascii() and piece.isdecimal():
            count += -(-len(piece) // _DIGITS)
        elif not piece.isspace() or len(piece) > 1:
            count += len(piece.encode())
    return count


def marked(value: Any) -> Any:
    """A value as JSON has it, texts of others marked, all of bounded length and harmless."""
    if isinstance(value, Untrusted):
        return {MARK: cut(harmless(value), _LONGEST)}
    if isinstance(value, str):
        return cut(harmless(value), _SENTENCE)
    if isinstance(value, Mapping):
        return {name: marked(each) for name, each in value.items() if each is not None}
    if isinstance(value, Sequence):
        return [marked(each) for each in value]
    return value


def cut(text: str, most: int) -> str:
    """A text, its end left out where it is longer."""
    return text if len(text) <= most else text[: most - 1] + "…"


def citation(sha256: str, frames: Iterable[int], octets: Iterable[int] = ()) -> str:
    """The citation of frames of a capture: the first dozen of them, runs as `15-17`; and of bytes in no frame, by the
    offset at which they begin, as `@4096`."""
    runs: list[list[int]] = []
    for frame in sorted(set(frames))[:_FRAMES]:
        if runs and frame == runs[-1][1] + 1:
            runs[-1][1] = frame
        else:
            runs.append([frame, frame])
    told = (f"{first}" if first == last else f"{first}-{last}" for first, last in runs)
    places = (f"@{octet}" for octet in sorted(set(octets))[:_FRAMES])
    return f"{sha256[:HASH]}:{','.join((*told, *places))}"


class AnswerPage:
    """An answer that grows until it is full; statements before `offset` and behind the last that fits are counted."""

    def __init__(self, head: Mapping[str, Any], offset: int = 0) -> None:
        self._head, self._offset = marked(head), max(offset, 0)
        self._statements: list[str] = []
        self._room = MOST_TOKENS - _END - token_bound(_compact(self._head))
        self._seen, self._full = 0, False

    def add_statements(self, count: int, make: Callable[[int], Mapping[str, Any]]) -> None:
        """So many statements more, by their number; those alone are made that may stand here."""
        for number in range(max(self._offset - self._seen, 0), count):
            if self._full:
                break
            text = _compact(marked(make(number)))
            self._room -= token_bound(text) + 1
            self._full = self._room < 0
            if not self._full or not self._statements:
                self._statements.append(text)
        self._seen += count

    def text(self) -> str:
        """The JSON: `of` statements there are; the next ones begin at `next_offset`."""
        told = self._offset + len(self._statements)
        tail: dict[str, Any] = {"of": self._seen}
        if told < self._seen:
            tail["next_offset"] = told
        head, end = _compact(self._head), _compact(tail)
        return f'{head[:-1]}{"," if len(head) > 2 else ""}"statements":[{",".join(self._statements)}],{end[1:]}'


def answered(head: Mapping[str, Any], statements: Iterable[Mapping[str, Any]], offset: int = 0) -> str:
    """An answer of statements that are made already."""
    page, made = AnswerPage(head, offset), list(statements)
    page.add_statements(len(made), made.__getitem__)
    return page.text()


def _compact(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))
