"""Which direction mark of a line is whose: that before a run of bytes, or behind the only one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from .choosing import ByteRun
from .tools import NONE, RX, TX, LineMark

_WORD: Final = re.compile(r"\w")
_OF_BRACKETS: Final = {"[": TX, "<": RX}  # as libmodbus and ModScan write them


def with_marks(text: str, runs: Sequence[ByteRun], line_marks: Sequence[LineMark]) -> None:
    """Each run with the mark before it; of one run alone, the one behind it where there is none before.

    An arrow says nothing behind a plain word, nor behind the first run: there it points from one frame to the next.
    """
    if not line_marks and len(runs) > 1:
        brackets = [text[run.start - 1 : run.start] for run in runs]
        if {"[", "<"} <= {*brackets}:  # `[01][03]…<01><03>…`
            for run, bracket in zip(runs, brackets, strict=True):
                run.mark = _OF_BRACKETS.get(bracket, NONE)
    ahead, newest = 0, None
    for run in runs:
        for mark in line_marks[ahead:]:
            if mark.end > run.start:
                break
            ahead += 1
            if not (mark.arrow and ((newest is not None and newest.plain) or runs[0].end <= mark.start)):
                newest = mark
        if newest is not None:
            run.mark, run.arrow = newest.mark, newest.arrow
            run.direct = not _WORD.search(text, newest.end, run.start)
    if len(runs) == 1 and not runs[0].mark:
        behind = [mark for mark in line_marks if mark.start >= runs[0].end and not mark.arrow]
        if len(behind) == 1:
            runs[0].mark = behind[0].mark
