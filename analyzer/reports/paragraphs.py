"""Lines of the text page: paragraphs are wrapped, and tables laid out, to the room there is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from textwrap import wrap
from typing import Final

from ..languages import APART
from .tabular import PageTable

WIDTH: Final = 80  # columns of the page
_APART: Final = re.compile(rf"(?<=\d){APART}(?=\d{{3}}\b|%)")  # in languages that set thousands, or %, apart by a space
_KEPT: Final = "\N{NO-BREAK SPACE}"  # no line ends at it


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Words to be wrapped: what stands before their first line, and before the others.

    `whole`: a word that is longer than the room is not broken, such as a name.
    """

    words: str
    first: str = ""
    others: str = "   "
    whole: bool = False

    def lines(self, width: int) -> list[str]:
        """So many columns wide."""
        lines = wrap(
            _APART.sub(_KEPT, self.words),
            width,
            initial_indent=self.first,
            subsequent_indent=self.others,
            break_on_hyphens=False,
            break_long_words=not self.whole,
        )
        return [line.replace(_KEPT, APART) for line in lines]


PageLine = str | Paragraph | PageTable
