"""Lines that a terminal, a mail or a window has broken: the wrapped and the unwrapped reading are compared.

A break is where bytes end a line and the next line begins with bytes. Lines are put together, with a blank or with
nothing between, where frames with right check values then cross the seams that no reading line by line explains. How
wide the lines are that were put together is learnt: others as wide, whose frames are damaged, follow them.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import accumulate, islice
from typing import Final

from . import stamps
from .entries import NumberedLine
from .plain import plain
from .runs import ByteRun, covered, is_whole

Runs = Callable[[str], Sequence[ByteRun]]  # of a line as it stands there

_BEGINS: Final = re.compile(r"[\s>*#/|]{0,12}(?:,\s?)?(?:0?[xX]|16#|\\x|[$%\\&'\"\[<({,-]|#)?[0-9A-Fa-f]")
_ENDS: Final = re.compile(r"[0-9A-Fa-f][\s,\\hH'\"\])}>;:|.-]{0,4}$|[xX#$%0\\\[<&]$|[,-]\s?$")
_MARGIN: Final = " \t>*#/|"  # what mails and tables put before a line
_CLOSING: Final = " ,;\\|`'\"])}>"
_MOST_LINES: Final = 48
_MOST: Final = 2048  # characters
_PATIENCE: Final = 40  # breaks in vain
_LONG_CHAIN: Final = 8  # lines
_NARROW: Final = 24  # columns: no window is narrower
_LONGER: Final = 8  # characters that a line may have more than the first
_AS_WIDE: Final = {  # by what is put between: how much wider than those before lines that were one may be
    "": range(1),
    " ": range(-11, 2 * _MOST),  # columns that a word at a break may leave empty
}


class Unwrapper:
    """Puts lines of a text together that were one; `runs` reads a line."""

    def __init__(self, runs: Runs) -> None:
        self._runs = runs
        self._widths = dict.fromkeys(_AS_WIDE, -4 * _MOST)  # of lines that were put together; of none yet
        self._waited = 0  # breaks in vain

    def lines(self, lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
        """The lines, with the numbers of the first that they were put together of."""
        source = iter(lines)
        ahead: deque[NumberedLine] = deque(islice(source, 1))
        while ahead:
            count = self._chain(ahead, source) if self._waited < _PATIENCE else 1
            number, text = ahead[0]
            spent = 1
            if count > 1:
                found = self._merged([plain(text) for _, text in islice(ahead, count)])
                self._waited += 1
                if found is not None:
                    text, spent = found
                    self._waited = 0
                elif count >= _LONG_CHAIN:  # from the next line on it would be the same
                    yield from (ahead.popleft() for _ in range(count - 2))
                    number, text = ahead[0]
            yield number, text
            for _ in range(spent):
                ahead.popleft()
            if not ahead:
                ahead.extend(islice(source, 1))

    def _chain(self, ahead: deque[NumberedLine], source: Iterator[NumberedLine]) -> int:
        """How many lines from the first on may be one: each begins with bytes where that above ends with them."""
        first = ahead[0][1]
        if not _NARROW <= len(first) <= _MOST:
            return 1
        count, size = 1, len(first)
        while count < _MOST_LINES and size < _MOST:
            ahead.extend(islice(source, max(count + 1 - len(ahead), 0)))
            if count == len(ahead):
                break
            above, text = ahead[count - 1][1], ahead[count][1]
            if len(text) > len(first) + _LONGER or not _BEGINS.match(text) or not _ENDS.search(above.rstrip()):
                break
            if stamps.find(text)[0] is not None or (count == 1 and self._is_settled(plain(first))):
                break
            count, size = count + 1, size + len(text)
        return count

    def _is_settled(self, text: str) -> bool:
        """Whether a line ends with bytes that need nothing more."""
        runs = self._runs(text)
        if not runs or not is_whole(runs[-1]):
            return False
        return not text.rstrip()[-1:].isalnum() or _covers(runs[-1], text)

    def _merged(self, texts: Sequence[str]) -> tuple[str, int] | None:
        """The lines as one, and how many of them, if that reads more than each alone."""
        texts = _unframed(texts)
        alone = sum(covered(run.checked) for text in texts for run in self._runs(text))
        words = [texts[0].rstrip(), *(" " + text.strip(_MARGIN) for text in texts[1:])]
        for between, parts in (("", texts), (" ", words)):
            seams = [*accumulate(map(len, parts))]
            runs = self._runs("".join(parts))
            run = next((run for run in runs if run.start < seams[0] < run.end), None)
            if run is None:
                continue
            width, known = seams[0], self._widths[between]
            more = sum(covered(run.checked) for run in runs) > alone and self._crosses(run, parts)
            if more or width - known in _AS_WIDE[between]:
                self._widths[between] = max(width, known) if between else width
                count = bisect_left(seams, run.end) + 1
                return "".join(parts[:count]), count
        return None

    def _crosses(self, run: ByteRun, parts: Sequence[str]) -> bool:
        """Whether a frame with a right check value goes over the first seam."""
        before = next((one for one in self._runs(parts[0]) if one.start == run.start), None)
        at = len(before.data) if before is not None else 1
        return any(span.start < at < span.end for span in run.checked)


def _unframed(texts: Sequence[str]) -> list[str]:
    """Lines without the blanks that all have before them, and all but the last behind them."""
    before = min(len(text) - len(text.lstrip()) for text in texts)
    behind = min(len(text) - len(text.rstrip()) for text in texts[:-1])
    return [*(text[before : len(text) - behind] for text in texts[:-1]), texts[-1][before:].rstrip()]


def _covers(run: ByteRun, text: str) -> bool:
    return not text[run.end :].strip(_CLOSING)
