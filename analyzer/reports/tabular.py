"""Tables of the text page: columns as wide as what stands in them, laid out by `rich`.

Where they have no room beside one another, those that tell least go first; names are cut before the last of these goes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from typing import Final, NamedTuple

_GAP: Final = 2  # blanks between columns
_SHORT, _SHORTEST = 24, 10  # characters of a name that is cut: rather than that a column goes, and at least


class PageColumn(NamedTuple):
    """The head of a column, and how it stands."""

    head: str
    is_words: bool = False  # set to the left; else figures, to the right
    spare: int = 0  # what there is no room for: those of the highest number go first, those of 0 stay
    is_cut: bool = False  # the column that gives way before the one of number 1, and once none is spare


@dataclass(frozen=True, slots=True)
class PageTable:
    """Rows of cells below heads; a cell is plain text of one line."""

    columns: Sequence[PageColumn]
    rows: Sequence[Sequence[str]]
    indent: int = 0

    def lines(self, width: int) -> list[str]:
        """So many columns wide at most, or as wide as figures need."""
        from rich.cells import cell_len
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        widths = [
            max(cell_len(text) for text in (column.head, *cells))
            for column, *cells in zip(self.columns, *self.rows, strict=True)
        ]
        room = width - self.indent
        shown = list(range(len(self.columns)))
        while (over := _taken(widths, shown) - room) > 0:
            spare = max(shown, key=lambda one: self.columns[one].spare)
            slack = sum(max(widths[one] - _SHORT, 0) for one in shown if self.columns[one].is_cut)
            if over <= slack * (self.columns[spare].spare <= 1) or not self.columns[spare].spare:
                break
            shown.remove(spare)
        over = max(over, 0)
        table = Table(box=None, pad_edge=False, padding=(0, _GAP, 0, 0), header_style="", show_edge=False)
        for number in shown:
            column, own = self.columns[number], widths[number]
            own = max(own - over, min(own, _SHORTEST)) if column.is_cut else own
            table.add_column(
                Text(column.head), justify="left" if column.is_words else "right", no_wrap=True, width=own,
                overflow="ellipsis",
            )  # fmt: skip
        for row in self.rows:
            table.add_row(*(Text(row[number]) for number in shown))
        file = StringIO()
        console = Console(file=file, width=max(room, _taken(widths, shown)), color_system=None, legacy_windows=False)
        console.print(table)
        return [" " * self.indent + line.rstrip() for line in file.getvalue().splitlines()]


def _taken(widths: Sequence[int], shown: Sequence[int]) -> int:
    """Columns of the page that these take, with the gaps between them."""
    return sum(widths[number] + _GAP for number in shown) - _GAP
