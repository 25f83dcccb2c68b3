"""Tables whose columns blanks part, as PDFs are copied and as rules are drawn: where columns are, which cell is whose.

Columns are where most rows have something, between headings; a row that has a blank wherever columns part is cut there,
of any other the cells that two blanks part go each to the nearest column, in turn.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import accumulate, islice, pairwise
from typing import Final

from .roles import known_headings, may_be_heading
from .vocabulary import expression, form

LEAST_CELLS: Final = 3  # that make a row
_MOST_COLUMNS: Final = 100
_CELL: Final = 1000  # characters
_WORDS: Final = r"\S+"
_WIDE: Final = r"\S+(?: \S+)*"  # what two blanks part
_FILL: Final = "\u2060"  # behind a sign that takes two places
_TWICE: Final = "[\u1100-\u11ff\u2e80-\ua4cf\uac00-\ud7a3\uf900-\ufaff\uff00-\uff60]"
_CROSSED: Final = 0.1  # of the rows may have something where columns are parted
_SAME: Final = 2  # places that a cell is farther from a column which has one
Span = tuple[int, int]


def cut_at_blanks(lines: Sequence[str]) -> Iterator[list[str]]:
    """The cells of each line."""
    wide = [expression(_TWICE).sub(rf"\g<0>{_FILL}", line) for line in lines]  # as long as it is shown
    parted = [parts_of_line(line) for line in wide]
    known = [_headings_in(line, cells) for line, cells in zip(wide, parted, strict=True)]
    begins = [at for at, (before, here) in enumerate(pairwise([0, *known])) if here > max(before, 1)]
    for first, last in pairwise(sorted({0, *begins, len(lines)})):
        yield from _cut_table(wide[first:last], parted[first:last], has_heading=first in begins)


def without_page_marks(lines: Sequence[str]) -> list[str]:
    """The lines, empty where one says no more than which page of a book it is on: the same but for a number that
    counts."""
    pages: dict[str, list[tuple[int, list[int]]]] = {}
    for at, line in enumerate(lines):
        numbers = sorted(map(int, expression(r"\d{1,4}").findall(line)))
        if numbers and len(parts_of_line(line[:_CELL])) < LEAST_CELLS:
            words = sorted(expression(r"\d{1,4}").sub("#", line).split())  # of a left page as of a right one
            pages.setdefault(" ".join(words), []).append((at, numbers))
    marks = {at for found in pages.values() if _counts_on([numbers for _, numbers in found]) for at, _ in found}
    return ["" if at in marks else line for at, line in enumerate(lines)]


def _counts_on(found: Sequence[Sequence[int]]) -> bool:
    """Whether of the numbers of lines one rises by 1 each time, and all others stay."""
    steps = [[after - before for before, after in zip(one, other, strict=True)] for one, other in pairwise(found)]
    return steps != [] and all(sorted(step) == [*[0] * (len(step) - 1), 1] for step in steps)


def parts_of_line(line: str) -> list[Span]:
    """Where the cells of a line are that two blanks part; those of a rule one."""
    parts = (_WIDE, _WORDS)[form("rule_above", line) != {}]
    return [cell.span() for cell in islice(expression(parts).finditer(line), _MOST_COLUMNS)]


def _headings_in(line: str, cells: Sequence[Span]) -> int:
    """How many headings are known among cells that may be some."""
    texts = [line[a:b].replace(_FILL, "") for a, b in cells]
    return known_headings(texts) * may_be_heading(texts)


def _cut_table(lines: Sequence[str], parted: Sequence[Sequence[Span]], *, has_heading: bool) -> Iterator[list[str]]:
    columns, are_clear = _columns(lines, parted, has_heading=has_heading)
    gaps = [(end, start) for (_, end), (start, _) in pairwise(columns)]
    edges = [0, *(start for start, _ in columns[1:]), None]
    for number, (line, cells) in enumerate(zip(lines, parted, strict=True)):
        is_crossed = not (are_clear and cells) or any(line[a:b].strip() for a, b in gaps)
        if line.count("|") > 1:
            texts = line.strip().removeprefix("|").removesuffix("|").split("|")
        elif is_crossed:
            texts = _placed(line, [*_parted_at(line, cells, columns, is_heading=has_heading > number)], columns)
        else:
            texts = [line[a:b] for a, b in pairwise(edges)]
        yield [text.replace(_FILL, "").strip()[:_CELL] for text in texts]


def _columns(
    lines: Sequence[str], parted: Sequence[Sequence[Span]], *, has_heading: bool
) -> tuple[Sequence[Span], bool]:
    """Where columns begin and end, and whether blanks part them in nearly all rows: by a rule, or by the rows that have
    as many cells as most; else they are where one of these has its cells."""
    columns = next((cells for line, cells in zip(lines, parted, strict=True) if form("rule_above", line)), None)
    if columns is None:
        counts = Counter(len(cells) for cells in parted[has_heading:] if len(cells) >= LEAST_CELLS)
        usual = max(counts, key=lambda count: (counts[count], count), default=_MOST_COLUMNS)
        full = [at for at in range(has_heading, len(lines)) if len(parted[at]) >= usual]
        runs = _runs([parted[at] for at in full])[:_MOST_COLUMNS]
        if len(runs) < usual:
            return next((parted[at] for at in full if len(parted[at]) == usual), parted[0]), False
        columns = _with_gaps(lines[0], [lines[at] for at in full], runs) if has_heading else runs
    beyond = parted[0] if has_heading else ()
    return [*columns, *(cell for cell in beyond if cell[0] >= columns[-1][1])], True


def _runs(rows: Sequence[Sequence[Span]]) -> list[Span]:
    """Where more than some rows have something."""
    steps: Counter[int] = Counter()
    for cells in rows:
        for start, end in cells:
            steps[start] += 1
            steps[end] -= 1
    places = sorted(steps)
    depths = [depth > _CROSSED * len(rows) for depth in accumulate(map(steps.__getitem__, places))]
    edges = [at for at, (before, here) in zip(places, pairwise([False, *depths]), strict=True) if before != here]
    return [*zip(edges[::2], edges[1::2], strict=True)]


def _with_gaps(heading: str, rows: Sequence[str], columns: Sequence[Span]) -> list[Span]:
    """The columns, and those that begin as a word of the heading, where one blank parts them from others."""
    words = {word.start() for word in expression(_WORDS).finditer(heading)}
    found: list[Span] = []
    for start, end in _runs([[word.span() for word in expression(_WORDS).finditer(row)] for row in rows]):
        if not found or start in words or any(a - _SAME < start <= a for a, _ in columns):
            found.append((start, end))
        else:
            found[-1] = (found[-1][0], end)
    return found


def _parted_at(line: str, cells: Sequence[Span], columns: Sequence[Span], *, is_heading: bool) -> Iterator[Span]:
    """The cells; one over several columns is parted where a word begins as a column does, a heading at each word."""
    starts = [start for start, _ in columns]
    is_row = is_heading or LEAST_CELLS <= len(cells) < len(columns)
    for start, end in cells:
        over = sum(a < end and start < b for a, b in columns)
        words = [word.start() for word in expression(_WORDS).finditer(line, start, end)] * (is_row and over > 1)
        yield from pairwise([start, *(at for at in words if at > start and (is_heading or at in starts)), end])


def _placed(line: str, cells: Sequence[Span], columns: Sequence[Span]) -> list[str]:
    """The texts of cells by columns: as many one by one, else each in the nearest that is free, in turn."""
    if len(cells) == len(columns) or not columns:
        return [line[a:b] for a, b in cells]
    row = [""] * len(columns)
    at = 0
    for number, (start, end) in enumerate(cells):
        at = min(
            range(at, max(at, len(columns) - len(cells) + number) + 1),
            key=lambda column: (
                max(0, columns[column][0] - end, start - columns[column][1]) + _SAME * (row[column] != ""),
                abs(columns[column][0] - start),
            ),
        )
        row[at] = f"{row[at]} {line[start:end]}".strip()
    return row
