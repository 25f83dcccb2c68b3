"""What goes to the terminal: only the cells that changed, and lines that moved as a scroll.

Textual draws whole lines of widgets again, each piece with all of its colours. Here a shadow of the terminal knows what
stands in every cell; an update becomes the shortest way from there. On a slow line (SSH over a modem, a console server
at 115200 baud) an arrow key costs some hundred bytes so.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Final, NamedTuple

from rich.cells import cell_len, get_character_cell_size
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate

if TYPE_CHECKING:
    from rich.console import Console
    from rich.segment import Segment
    from rich.style import Style
    from textual.geometry import Size

Stretch = tuple[int, int, "Iterable[Segment]"]  # line, column, what stands there

_OFF: Final = {1: 22, 2: 22, 3: 23, 4: 24, 5: 25, 6: 25, 7: 27, 8: 28, 9: 29, 21: 24, 53: 55}  # SGR: how to end each
_MARKS_ON_BLANKS: Final = frozenset({4, 7, 9, 21, 53})
_FEW: Final = 4  # cells: writing so many again is shorter than to jump over them
_LOOKS: Final = 1 << 12


_SCROLLED: Final = 4  # lines that must have moved together, or they are drawn again
_WORTH: Final = 40  # cells that moving them spares: its codes take some 20 bytes


class Look(NamedTuple):
    """How a cell looks, in codes of SGR. Foreground `""`: any, since nothing is seen of it."""

    front: str
    back: str
    marks: frozenset[int]


_PLAIN: Final = Look("39", "49", frozenset())


class _CellLine(NamedTuple):
    """A line of the terminal: what stands in each cell, and how it looks."""

    texts: list[str]
    looks: list[Look | None]


class ThinWire:
    """The terminal as it stands, and what was sent of late."""

    def __init__(self) -> None:
        self._size = (0, 0)
        self._texts: list[list[str]] = []
        self._looks: list[list[Look | None]] = []
        self._cache: dict[Style | None, tuple[Look, Look]] = {}
        self._known: dict[Look, Look] = {}  # each look once: two are the same where they are one object
        self._sent: deque[tuple[float, int]] = deque()

    def forget(self) -> None:
        """Nobody knows what the terminal shows: all is sent again."""
        self._size = (0, 0)

    def thin(self, update: CompositorUpdate, console: Console, size: Size) -> ThinUpdate:
        """An update as the difference from what stands there; it must be written, or the next one is wrong.

        `size` is the terminal's, in cells, as the driver knows it: a console goes by COLUMNS and LINES where they are
        set, and in a browser they are, once and for all.
        """
        self._fit(size)
        if isinstance(update, LayoutUpdate):
            return ThinUpdate(self.difference(_of_layout(update), console))
        if isinstance(update, ChopsUpdate):
            return ThinUpdate(self.difference(_of_chops(update), console))
        self.forget()
        return ThinUpdate(update.render_segments(console))

    def rate(self, seconds: float = 1.0) -> int:
        """Bytes that went out in the newest `seconds`."""
        since = time.monotonic() - seconds
        while self._sent and self._sent[0][0] < since:
            self._sent.popleft()
        return sum(size for _, size in self._sent)

    def difference(self, stretches: Iterable[Stretch], console: Console) -> str:
        """What to write so that these pieces stand on the terminal."""
        before: dict[int, _CellLine] = {}
        changed: dict[int, set[int]] = {}
        for y, x, segments in stretches:
            if 0 <= y < self._size[1]:
                before.setdefault(y, _CellLine(self._texts[y].copy(), self._looks[y].copy()))
                changed.setdefault(y, set()).update(self._changes(y, x, segments, console))
        scroll = self._scroll(before, changed)
        text = scroll + self._written(changed)
        self._sent.append((time.monotonic(), len(text)))
        return text

    def _written(self, changed: Mapping[int, set[int]]) -> str:
        """The cells that changed, by line."""
        out: list[str] = []
        at: tuple[int, int] | None = None  # the cursor: line, column
        now = _PLAIN
        for y, columns in changed.items():
            texts, looks = self._texts[y], self._looks[y]
            for first, last in _runs(sorted(columns), looks, texts):
                if at != (y, first):
                    ahead = at is not None and at[0] == y and at[1] < first
                    out.append(f"\x1b[{first - at[1]}C" if ahead and at else f"\x1b[{y + 1};{first + 1}H")
                begin = first
                while begin < last:
                    wanted, end = looks[begin], begin + 1
                    while end < last and looks[end] is wanted:
                        end += 1
                    if wanted is not now and wanted is not None and wanted != now and any(texts[begin:end]):
                        code, now = _turned(now, wanted)
                        out.append(code)
                    out += texts[begin:end]
                    begin = end
                at = None if last >= self._size[0] else (y, last)
        if now != _PLAIN:
            out.append("\x1b[m")
        return "".join(out)

    def _scroll(self, before: Mapping[int, _CellLine], changed: dict[int, set[int]]) -> str:
        """The code that moves lines to where they stand now; `changed` is then what is left to write.

        Lines are deleted and inserted between two margins: every terminal since the VT102 does that, the console of
        Linux too, which has no code for scrolling alone.
        """
        drawn = [y for y in sorted(before) if len(changed[y]) > _FEW]
        if len(drawn) < _SCROLLED:
            return ""
        stood = {tuple(before[y].texts): y for y in drawn}
        moves = Counter(stood[key] - y for y in drawn if (key := tuple(self._texts[y])) in stood)
        by, lines = max(moves.items(), key=lambda move: move[1], default=(0, 0))
        if not by or lines < _SCROLLED:
            return ""
        moved = [y for y in drawn if stood.get(tuple(self._texts[y])) == y + by]
        top, bottom = min(moved[0], moved[0] + by), max(moved[-1], moved[-1] + by)
        left = {y: self._left(y, before, y + by if top <= y + by <= bottom else -1) for y in range(top, bottom + 1)}
        spared = sum(len(changed.get(y, ())) - len(columns) for y, columns in left.items())
        if spared < _WORTH:
            return ""
        changed |= left
        at = top + 1
        return f"\x1b[{at};{bottom + 1}r\x1b[{at}H\x1b[{abs(by)}{'M' if by > 0 else 'L'}\x1b[r"

    def _left(self, y: int, before: Mapping[int, _CellLine], source: int) -> set[int]:
        """Columns of a line that are others than in the line that has moved there; all where none has (-1)."""
        texts, looks, width = self._texts[y], self._looks[y], self._size[0]
        if source < 0:
            return set(range(width))
        old = before.get(source) or _CellLine(self._texts[source], self._looks[source])
        others = {i for i in range(width) if texts[i] != old.texts[i] or looks[i] is not old.looks[i]}
        return others | {i - 1 for i in others if i and not texts[i]}

    def _fit(self, size: Size) -> None:
        width, height = size
        if self._size != size:
            self._size = width, height
            self._texts = [[" "] * width for _ in range(height)]
            self._looks = [[None] * width for _ in range(height)]

    def _changes(self, y: int, x: int, segments: Iterable[Segment], console: Console) -> list[int]:
        """Take the segments in; columns that are others now, ascending."""
        changed: list[int] = []
        texts, looks, width = self._texts[y], self._looks[y], self._size[0]
        for text, style, control in segments:
            if control or not text:
                continue
            full, blank = self._looks_of(style, console)
            cells = list(text) if text.isascii() else _cells_of_text(text)
            own: list[Look | None] = [blank if cell == " " else full for cell in cells]
            skip, room = max(0, -x), max(0, width - x)
            if skip or len(cells) > room:
                cells, own = cells[skip:room], own[skip:room]
            at = x + skip
            x += len(own) + skip
            end = at + len(cells)
            if texts[at:end] == cells and looks[at:end] == own:
                continue
            for i, (cell, wanted) in enumerate(zip(cells, own, strict=True), at):
                if texts[i] != cell or looks[i] is not wanted:
                    if not texts[i]:  # the other half of a wide character goes with this one
                        texts[i - 1], looks[i - 1] = " ", None
                    if i + 1 < width and not texts[i + 1]:
                        texts[i + 1], looks[i + 1] = " ", None
                    texts[i], looks[i] = cell, wanted
                    changed.append(i)
        return changed

    def _looks_of(self, style: Style | None, console: Console) -> tuple[Look, Look]:
        """How text in a style looks, and how a blank does."""
        looks = self._cache.get(style)
        if looks is None:
            if len(self._cache) > _LOOKS:
                self._cache.clear()
            full = _codes_of(style, console)
            marks = full.marks & _MARKS_ON_BLANKS
            blank = Look(full.front if marks else "", full.back, marks)
            looks = self._cache[style] = (self._known.setdefault(full, full), self._known.setdefault(blank, blank))
        return looks


class ThinUpdate(CompositorUpdate):
    """An update whose text is known."""

    def __init__(self, text: str) -> None:
        self.text = text

    def render_segments(self, console: Console) -> str:  # noqa: ARG002
        """What to write to the terminal."""
        return self.text


def _of_layout(update: LayoutUpdate) -> Iterator[Stretch]:
    for y, strips in enumerate(update.strips, update.region.y):
        yield y, update.region.x, (segment for strip in strips for segment in strip)


def _of_chops(update: ChopsUpdate) -> Iterator[Stretch]:
    for y, x1, x2 in update.spans:
        for end, (x, strip) in zip(update.chop_ends[y], update.chops[y].items(), strict=False):
            if strip is not None and x < x2 and end > x1:
                low, high = max(x, x1), min(end, x2)
                yield y, low, strip if (low, high) == (x, end) else strip.crop(low - x, high - x)


def _cells_of_text(text: str) -> list[str]:
    """A text cell by cell; the second cell of a wide character is empty."""
    if len(text) == cell_len(text):
        return list(text)
    out: list[str] = []
    for character in text:
        size = get_character_cell_size(character)
        if size == 0 and out:
            out[-1] += character
        out.extend(([character, ""] if size > 1 else [character]) if size else [])
    return out


def _runs(changed: Sequence[int], looks: Sequence[Look | None], texts: Sequence[str]) -> Iterator[tuple[int, int]]:
    """Changed columns as stretches to write, over gaps that are shorter to write again than to jump over."""
    first = last = -1
    for column in changed:
        if first < 0:
            first = column
        elif column == last:
            pass
        elif column - last > _FEW or not all(_alike(looks[i], looks[last - 1]) for i in range(last, column)):
            yield first, last
            first = column
        last = column + 1
        while last < len(texts) and not texts[last]:
            last += 1  # the other half of a wide character
    if first >= 0:
        yield first, last


def _alike(own: Look | None, neighbour: Look | None) -> bool:
    """Whether a cell can be written in another one's look."""
    if own is None or neighbour is None or own == neighbour:
        return own == neighbour
    return not own.front and own.back == neighbour.back and own.marks == neighbour.marks & _MARKS_ON_BLANKS


def _codes_of(style: Style | None, console: Console) -> Look:
    system = console._color_system
    if style is None or system is None:
        return _PLAIN
    front = style.color.downgrade(system).get_ansi_codes() if style.color else ()
    back = style.bgcolor.downgrade(system).get_ansi_codes(foreground=False) if style.bgcolor else ()
    names = ("bold", "dim", "italic", "underline", "blink", "blink2", "reverse", "conceal", "strike")
    marks = frozenset(code for code, name in enumerate(names, 1) if getattr(style, name))
    return Look(";".join(front) or "39", ";".join(back) or "49", marks)


@lru_cache(_LOOKS)
def _turned(now: Look, wanted: Look) -> tuple[str, Look]:
    """The codes from one look to another, and the look after them."""
    codes: list[str] = []
    if not wanted.front:
        wanted = Look("", wanted.back, wanted.marks | (now.marks - _MARKS_ON_BLANKS))
    ended = {_OFF[mark] for mark in now.marks - wanted.marks}
    codes += [str(code) for code in sorted(ended)]
    lasting = {mark for mark in now.marks if _OFF[mark] not in ended}
    codes += [str(mark) for mark in sorted(wanted.marks - lasting)]
    front = wanted.front or now.front
    if front != now.front:
        codes.append(front)
    if wanted.back != now.back:
        codes.append(wanted.back)
    after = Look(front, wanted.back, wanted.marks)
    return (f"\x1b[{';'.join(codes)}m" if codes else ""), after
