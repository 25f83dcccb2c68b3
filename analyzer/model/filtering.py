"""The display filter on the model's own columns (`analyzer.filters` is the language)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .selection import Test


class Completion(NamedTuple):
    """What could stand from `start` on up to the cursor, and a word of help."""

    text: str
    help: str
    start: int


class Trouble(Exception):
    """What is wrong with a filter, at `column` (from 0)."""

    def __init__(self, text: str, column: int) -> None:
        super().__init__(text)
        self.column = column


def trouble(text: str) -> Trouble | None:
    """What is wrong with a filter; None for nothing."""
    return Trouble("no filter language is installed", 0) if text.strip() else None


def completions(text: str, cursor: int) -> Sequence[Completion]:
    """What could be typed at the cursor."""
    return ()


def compiled(text: str) -> Test:
    """A filter as a test of rows."""
    raise Trouble("no filter language is installed", 0)


EXAMPLES = (
    "unit == 17 and function in (3, 4)",
    "exception or crc_ok == false",
    'finding == "late-response"',
    "register == 40108 and value > 1000",
    "response_time > 50ms",
    "gap > 3.5 chars",
    'hex contains "03 02"',
    "not noise",
)
