"""What goes down the wire: few bytes for a key, none for nothing, and always the right picture."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from statistics import median

import pytest
from hypothesis import event, given
from hypothesis import strategies as st
from rich.console import Console
from rich.segment import Segment
from rich.style import Style
from seats import sample_in
from textual.geometry import Region, Size
from textual.strip import Strip

if os.name != "posix":
    pytest.skip("ptys are POSIX", allow_module_level=True)

from emulator import Picture, Watched
from textual._compositor import LayoutUpdate

from analyzer.tui.wire import ThinWire

_STYLES = [
    Style(), Style(bold=True), Style(color="red"), Style(color="#8b949e", bgcolor="#16191d"), Style(reverse=True),
    Style(color="#ffffff", bgcolor="#2f5f8f", bold=True), Style(italic=True, dim=True), Style(underline=True),
]  # fmt: skip
_COLUMNS, _ROWS = 24, 4
_text = st.text(st.sampled_from("ab  ─▲漢字é"), max_size=12)
_pieces = st.lists(st.tuples(_text, st.sampled_from(_STYLES)), max_size=4)
_updates = st.lists(st.tuples(st.integers(0, _COLUMNS - 1), st.integers(0, _ROWS - 1), _pieces), max_size=8)


@given(_updates)
def test_the_terminal_shows_what_is_drawn_however_it_was_sent(updates: list[tuple[int, int, list]]) -> None:  # type: ignore[type-arg]
    """Against the same updates, each sent whole to a terminal of its own."""
    size = Size(_COLUMNS, _ROWS)
    console = Console(width=2, height=1, color_system="256", force_terminal=True)
    wire, thin, whole = ThinWire(), Picture(_COLUMNS, _ROWS), Picture(_COLUMNS, _ROWS)
    blank = LayoutUpdate([[Strip.blank(_COLUMNS)]] * _ROWS, Region(0, 0, _COLUMNS, _ROWS))
    for x, y, pieces in [(0, 0, None), *updates]:
        if pieces is None:
            update = blank
        else:
            strip = Strip([Segment(text, style) for text, style in pieces]).crop(0, _COLUMNS - x)
            update = LayoutUpdate([[strip]], Region(x, y, strip.cell_length, 1))
        thin.feed(wire.thin(update, console, size).text)
        whole.feed(update.render_segments(console))
    assert wire.thin(blank, console, size).text or not updates or thin.lines() == [""] * _ROWS
    for y in range(_ROWS):
        for x in range(_COLUMNS):
            ours, theirs = thin.cells[y][x], whole.cells[y][x]
            if _halved(whole.cells[y], x) or _halved(thin.cells[y], x):
                continue  # what a terminal makes of half a wide character is its own affair
            assert ours == theirs, (x, y)
            if ours.strip():
                assert thin.looks[y][x] == whole.looks[y][x], (x, y)
            else:
                assert thin.looks[y][x][1] == whole.looks[y][x][1], (x, y)


_shapes = st.lists(st.sampled_from(["{} ─▲ b", "漢字 {}", "{}é", "", "x" * _COLUMNS]), min_size=8, max_size=8)


@given(st.lists(st.tuples(st.integers(-8, 8), st.integers(0, 3), st.integers(8, 16), _shapes), min_size=1, max_size=6))
def test_lines_that_move_are_moved_and_stand_where_they_should(moves: list[tuple[int, int, int, list[str]]]) -> None:
    """A list that scrolls between a head and a foot, and its cursor is on another line then."""
    size, shown = Size(_COLUMNS, 16), list(map(str, range(1000, 1016)))
    console = Console(width=2, height=1, color_system="256", force_terminal=True)
    wire, thin, whole = ThinWire(), Picture(*size), Picture(*size)
    scrolls, number = 0, (f"{i * 2654435761 % 2**32:08x}" for i in count())
    for by, top, bottom, shapes in [(0, 0, 16, []), *moves]:
        band, fresh = shown[top:bottom], [shape.format(next(number)) for shape in shapes[: abs(by)]]
        shown[top:bottom] = [*band[by:], *fresh] if by > 0 else [*fresh, *band][: len(band)]
        lines = [Segment(line.ljust(_COLUMNS), _STYLES[5 if y == top else 2]) for y, line in enumerate(shown)]
        update = LayoutUpdate([[Strip([line]).crop(0, _COLUMNS)] for line in lines], Region(0, 0, *size))
        text = wire.thin(update, console, size).text
        scrolls += text.count("\x1b[r")
        thin.feed(text)
        whole.feed(update.render_segments(console))
        assert thin.lines() == whole.lines() and (thin.top, thin.bottom) == (0, 16)
        for ours, theirs in zip(thin.looks, whole.looks, strict=True):
            assert [look[1] for look in ours] == [look[1] for look in theirs]
    event(f"{min(scrolls, 3)} scrolls")


@pytest.mark.parametrize("other", ["\x1b]22;default\x07", "\x1b7", "\x1b[?2026l", "\x1b[1 q", "\x1bPq\x1b\\"])
def test_the_picture_keeps_what_stands_where_a_code_does_not_draw(other: str) -> None:
    """The pointer's shape (OSC 22) comes whenever a thread has read something; it once took a line away here."""
    picture = Picture(8, 3)
    for piece in ("\x1b[1;1Hone\x1b[2;1Htwo", *other):
        picture.feed(piece)
    assert picture.lines() == ["one", "two", ""]


def _halved(cells: list[str], x: int) -> bool:
    from rich.cells import cell_len

    wide = cell_len(cells[x]) > 1
    return (cells[x] == "" and cell_len(cells[x - 1]) < 2) or (wide and (x + 1 == len(cells) or cells[x + 1] != ""))


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Watched]:
    with Watched("open", str(sample_in(tmp_path)), cwd=tmp_path) as terminal:
        terminal.until("causes explain").settle(1.5)
        terminal.press("1")
        yield terminal


def cost(terminal: Watched, keys: str, times: int = 1, quiet: float = 0.5, patience: float = 5.0) -> float:
    """Bytes that a key mostly costs, however slow the machine is to begin with sending them: for `patience` seconds."""
    terminal.settle(quiet)
    costs = []
    for _ in range(times):
        terminal.count = 0
        terminal.press(keys, quiet)
        if not terminal.count:
            with suppress(AssertionError):
                terminal.until(lambda: terminal.count > 0, patience).settle(quiet)
        costs.append(terminal.count)
    return median(costs)  # what a view still had to draw may come with one of them


def test_a_key_costs_little(terminal: Watched) -> None:
    """At 80x24 in 256 colours: arrow under 1 kB also where a list scrolls, page
    under 4 kB, another view under 12 kB, idle nothing."""
    assert 100 < cost(terminal, "\x1b[B", 8) < 1000
    for view in "0345679":  # where a list has ended a key costs nothing
        terminal.press(view + "\x1b[H" + "\x1b[B" * 26)
        assert cost(terminal, "\x1b[B", 3, patience=0.5) < 1000, view
    for view in "21":
        terminal.press(view + "\x1b[H" + "\x1b[B" * 26)
        assert 100 < cost(terminal, "\x1b[B", 8) < 1000, f"{view}: the list scrolls"
    assert 100 < cost(terminal, "\x1b[6~", 4) < 4000
    assert cost(terminal, "\t", 3) < 4000
    for view in "2345678":
        assert 100 < cost(terminal, view) < 12_000, view
    assert cost(terminal, "\x1b") < 12_000
    assert cost(terminal, "1") < 12_000
    assert cost(terminal, "?") < 12_000
    assert cost(terminal, "\x1b") < 12_000
    terminal.count = 0
    terminal.settle(2.0)
    assert terminal.count == 0


def test_a_terminal_that_says_its_size_gets_the_whole_picture_again(terminal: Watched) -> None:
    """Of another size for a moment, it has shown something else meanwhile; so has one that is attached again."""
    stood = terminal.shown()
    terminal.picture = Picture(80, 24)
    os.kill(terminal.pid, signal.SIGWINCH)
    terminal.until(lambda: terminal.shown() == stood)
