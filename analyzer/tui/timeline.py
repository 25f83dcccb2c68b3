"""Bus activity over time: load, troubles and noise, in as many columns as there are; zoom, and a span for the list."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
from numpy.typing import NDArray
from textual import events
from textual.binding import Binding, BindingType
from textual.strip import Strip

from ..languages import counted, tr
from ..model.activity import time_marks
from ..words import is_clock, percent, short, shortened, unit_word
from .messages import RowWanted, SpanChosen, SpanSeen
from .paint import Painted, StyledText, fitted, in_runs
from .plot import EIGHTHS

if TYPE_CHECKING:
    from ..causes.registry import Cause
    from ..model.activity import Band, Bins
    from .desk import ViewState

_DEAF: Final = "░"
_LABEL: Final = 9  # columns left of the plot
_BELOW: Final = 5  # lines under it
_LEAST_PLOT: Final = 3  # lines that bands leave to it
_LOW_PLOT: Final = 8  # lines that it takes before causes in words get more than one below
_IN_WORDS: Final = 4  # lines for those
_HIGH_PLOT: Final = 12  # lines that it takes before bands get more than one
_TALL: Final = 3  # lines of a band, at most
_ABOVE: Final = 2
_LEAST_NS: Final = 1_000_000  # no span is shorter
_LONG_NS: Final = 600 * 10**9  # from which on times of day say more than seconds
_LEAST: Final = 0.001  # the least load that fills the plot


class Timeline(Painted, can_focus=True):
    """The plot; a cursor in it, and from `space` on a span."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left,h", "move(-1)", "Left", show=False),
        Binding("right,l", "move(1)", "Right", show=False),
        Binding("pageup", "move(-20)", "Left", show=False),
        Binding("pagedown", "move(20)", "Right", show=False),
        Binding("home", "edge(0)", "Begin", show=False),
        Binding("end", "edge(1)", "End", show=False),
        Binding("plus,equals_sign,up", "zoom(0.5)", "Zoom in", key_display="+"),
        Binding("minus,down", "zoom(2)", "out", key_display="-"),
        Binding("a", "whole", "All", tooltip="The whole capture again"),
        Binding("space", "pin", "Span", tooltip="Begin a span here, or take it back"),
        Binding("enter", "enter", "Show", tooltip="The span in the frame list, or the frame here"),
    ]

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.t_start = self.t_end = 0
        self.is_full = True
        self.cursor = 0
        self.pinned: int | None = None  # ns
        self._bins: Bins | None = None
        self.bands: Sequence[Band] = ()
        self.banded: tuple[object, ...] = ()  # what the bands were asked for
        self.causes: Sequence[Cause] = ()  # those that the bands are numbered by
        self.known: Sequence[Cause] = ()  # the newest

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to point at."""
        return self._bins is None

    @property
    def columns(self) -> int:
        """Of the plot."""
        return max(10, self.content_size.width - _LABEL - 1)

    def grown(self) -> None:
        """Rows came."""
        bus = self.desk.bus
        if self.is_full:
            self.t_start, self.t_end = bus.t_first, max(bus.t_last, bus.t_first + _LEAST_NS)
        self.refill()

    def refill(self) -> None:
        """Count anew for what is in sight."""
        bus = self.desk.bus
        if bus.count and bus.timed:
            self._bins = self.desk.figures.over(self.t_start, self.t_end, self.columns)
        self.cursor = min(self.cursor, self.columns - 1)
        self.refresh()

    def _moved(self) -> None:
        """Another span is in sight: the bands of the old one go."""
        self.bands = [band._replace(counts=band.counts * 0, troubles=band.troubles * 0) for band in self.bands]
        self.post_message(SpanSeen())

    def on_resize(self) -> None:
        self.refill()
        self.post_message(SpanSeen())

    def time_at(self, column: float) -> int:
        """The time at a column's left edge."""
        return self.t_start + round((self.t_end - self.t_start) * column / self.columns)

    def render_line(self, y: int) -> Strip:
        width, height = self.content_size.width, self.content_size.height
        base = self.base
        bins = self._bins
        if bins is None:
            why = tr("nothing captured yet") if self.desk.bus.timed else tr("no times in this capture")
            return self.strip([StyledText(f"  {why}" if y == 0 else "", "dim")], width, base)
        free = height - _ABOVE - _BELOW - len(self._shown_bands) * self._tall
        plot = max(1, min(free, max(_LOW_PLOT, free - _IN_WORDS)))
        return self.strip(fitted(self._line(y, plot, bins), width), width, base)

    @property
    def _shown_bands(self) -> Sequence[Band]:
        """Those that there is room for."""
        return self.bands[: max(0, self.content_size.height - _ABOVE - _BELOW - _LEAST_PLOT)]

    @property
    def _tall(self) -> int:
        """Lines of each: what the plot of the load needs no more is theirs."""
        free = self.content_size.height - _ABOVE - _BELOW - _IN_WORDS - _HIGH_PLOT
        return max(1, min(_TALL, free // max(1, len(self.bands))))

    def _line(self, y: int, plot: int, bins: Bins) -> list[StyledText]:
        if y == 0:
            return self._title(bins)
        if y == 1:
            return [StyledText(self._scale(), "dim")]
        y -= _ABOVE
        if y < plot:
            return self._bars(y, plot, bins)
        y -= plot
        if y == 0:
            return [StyledText(f"{tr('trouble') + ' ':>{_LABEL}}", "error"), *self._marks(bins.troubles, "error", "▪█")]
        if y == 1:
            return [StyledText(f"{tr('noise') + ' ':>{_LABEL}}", "noise"), *self._marks(bins.noise, "noise", "·▪")]
        shown, tall = self._shown_bands, self._tall
        if 2 <= y < 2 + len(shown) * tall:
            return self._band(shown[(y - 2) // tall], (y - 2) % tall, tall)
        y -= len(shown) * tall
        if y == 2:
            span = self._span_columns()
            under = ["─" if span and span[0] <= i <= span[1] else " " for i in range(self.columns)]
            under[self.cursor] = "▲"
            return [StyledText(" " * _LABEL), StyledText("".join(under), "strong")]
        if y == 3:
            return self._under_cursor(bins)
        return self._cause_at_cursor(y - 4)

    def _title(self, bins: Bins) -> list[StyledText]:
        load = self._loads(bins)
        title = (
            tr(" load, share of the line's capacity") if self.desk.bus.char_ns else tr(" load, bytes (baud not known)")
        )
        most = tr(", at most {share}", share=percent(load.max())) if self.desk.bus.char_ns else ""
        return [
            StyledText(title, "strong"),
            StyledText(tr("   a column is {time}", time=short(round(bins.width_ns))) + most, "dim"),
        ]

    @property
    def _by_the_clock(self) -> bool:
        """Whether times are those of day: seconds since the start of a week say little."""
        return is_clock(self.desk.bus.t_first) and self.t_end - self.t_start >= _LONG_NS

    def _scale(self) -> str:
        """Times under the title: of day, or round numbers of seconds since the start."""
        if self._by_the_clock:
            line = [" "] * (self.columns + _LABEL)
            for t_ns, words in time_marks(self.t_start, self.t_end, self.columns // 10, self.desk.zone):
                column = int((t_ns - self.t_start) / (self.t_end - self.t_start) * self.columns)
                if column < self.columns - 6:
                    line[_LABEL + column : _LABEL + column + 6] = f"|{words:<5}"
            return "".join(line)
        first = self.desk.bus.t_first
        size = (self.t_end - self.t_start) / 1e9
        least = size * 14 / self.columns  # room for a label
        step = next(s for k in range(-7, 8) for s in (10.0**k, 2 * 10.0**k, 5 * 10.0**k) if s >= least or k == 7)
        out = [" "] * (self.columns + _LABEL)
        at = math.ceil((self.t_start - first) / 1e9 / step)
        while (column := int((at * step - (self.t_start - first) / 1e9) / size * self.columns)) < self.columns - 10:
            text = f"|{at * step:.10g} {unit_word('s')}"
            out[_LABEL + column : _LABEL + column + len(text)] = text
            at += 1
        return "".join(out)

    def _loads(self, bins: Bins) -> NDArray[np.float64]:
        scale = self.desk.bus.char_ns
        if scale:
            shares: NDArray[np.float64] = np.minimum(bins.octets * scale / bins.width_ns, 1.0)
            return shares
        return bins.octets / max(1, int(bins.octets.max()))

    def _bars(self, y: int, plot: int, bins: Bins) -> list[StyledText]:
        load = self._loads(bins)
        top = max(float(load.max()), _LEAST)
        level = np.clip(np.round(load / top * plot * 8).astype(int), (load > 0).astype(int), None)
        cells = np.clip(level - (plot - 1 - y) * 8, 0, 8)
        label = percent(top) if y == 0 else percent(0) if y == plot - 1 else ""
        if not self.desk.bus.char_ns:
            label = ""
        span, deaf = self._span_columns(), self._deaf_columns()
        texts, kinds = [], []
        for i, cell in enumerate(cells.tolist()):
            inside = span is not None and span[0] <= i <= span[1]
            kind = "accent" if i == self.cursor else "strong" if inside else "request"
            unheard = i in deaf and not cell
            texts.append(_DEAF if unheard else EIGHTHS[cell] if cell or i != self.cursor else "┊")
            kinds.append("error" if unheard and i != self.cursor else kind)
        return [StyledText(f"{label:>{_LABEL - 1}} ", "dim"), *in_runs(texts, kinds)]

    def _deaf_columns(self) -> set[int]:
        """Columns of times in which a recording heard nothing."""
        columns: set[int] = set()
        scale = self.columns / max(self.t_end - self.t_start, 1)
        for away in self.desk.bus.deaf:
            to = self.t_end if away.to_ns is None else away.to_ns
            if away.from_ns <= self.t_end and to >= self.t_start:
                low, high = (int((t - self.t_start) * scale) for t in (away.from_ns, to))
                columns |= set(range(max(low, 0), min(high, self.columns - 1) + 1))
        return columns

    def _marks(self, counts: NDArray[np.int64], kind: str, glyphs: str) -> list[StyledText]:
        half = max(1, int(counts.max()) // 2)
        return [
            StyledText("".join(" " if not c else glyphs[0] if c < half else glyphs[1] for c in counts.tolist()), kind)
        ]

    def _band(self, band: Band, y: int, tall: int) -> list[StyledText]:
        """How much there was in each column; `!` where something of it was wrong, as all of a cause's is."""
        wrong = "error" if band.cause is None else self.causes[band.cause].severity
        name = shortened(band.name, _LABEL - 1)
        most, under = max(1, int(band.counts.max(initial=0))), tall - 1 - y
        texts, kinds = [], []
        for i, (count, trouble) in enumerate(zip(band.counts.tolist(), band.troubles.tolist(), strict=True)):
            level = max(1, round(8 * tall * count / most)) if count else 0
            marked = trouble and band.cause is None and not under
            texts.append("!" if marked else EIGHTHS[max(0, min(8, level - 8 * under))])
            kinds.append("accent" if i == self.cursor else wrong if trouble else "response")
        return [StyledText(f"{'' if under else name:>{_LABEL - 1}} ", "dim"), *in_runs(texts, kinds)]

    def _cause_at_cursor(self, line: int) -> list[StyledText]:
        """One on a line, in words, with the number that its band has."""
        here = [band.cause for band in self.bands if band.cause is not None and band.counts[self.cursor]]
        if line >= len(here):
            return []
        cause = self.causes[here[line]]
        return [StyledText(f" {here[line] + 1} ", cause.severity), StyledText(cause.text)]

    def _under_cursor(self, bins: Bins) -> list[StyledText]:
        i = self.cursor
        t_ns = self.time_at(i)
        at = (
            self.desk.when(t_ns)
            if self._by_the_clock
            else f"{(t_ns - self.desk.bus.t_first) / 1e9:.6f} {unit_word('s')}"
        )
        load = f", {tr('load {share}', share=percent(self._loads(bins)[i]))}" if self.desk.bus.char_ns else ""
        frames = counted(int(bins.frames[i]), "frame", "frames")
        if self.desk.is_emptied:
            return [StyledText(f" {self.desk.emptied()}", "dim")]
        words = f" {at}: {frames}{load}, {counted(int(bins.troubles[i]), 'trouble', 'troubles')}"
        span = self._span()
        if i in self._deaf_columns():
            words += tr("; nothing was recorded here")
        more = tr("   span {time}, Enter shows it", time=short(span[1] - span[0])) if span else ""
        return [StyledText(words), StyledText(more, "accent")]

    @property
    def span_under_cursor(self) -> tuple[int, int]:
        """The span that is marked, else the cursor's column."""
        return self._span() or (self.time_at(self.cursor), self.time_at(self.cursor + 1))

    def _span(self) -> tuple[int, int] | None:
        if self.pinned is None:
            return None
        low, high = sorted((self.pinned, self.time_at(self.cursor)))
        return low, high + round((self.t_end - self.t_start) / self.columns)

    def _span_columns(self) -> tuple[int, int] | None:
        if self.pinned is None:
            return None
        at = round((self.pinned - self.t_start) / (self.t_end - self.t_start) * self.columns)
        low, high = sorted((at, self.cursor))
        return max(0, low), high

    # Doing

    def action_move(self, step: int) -> None:
        cursor = self.cursor + step
        if not 0 <= cursor < self.columns and not self.is_full:
            self._shift(cursor)
        self.cursor = max(0, min(cursor, self.columns - 1))
        self.refresh()

    def _shift(self, cursor: int) -> None:
        """Move what is in sight, not beyond the capture."""
        bus, size = self.desk.bus, self.t_end - self.t_start
        over = cursor if cursor < 0 else cursor - self.columns + 1
        start = self.t_start + round(size * over / self.columns)
        self.t_start = max(bus.t_first, min(start, bus.t_last - size))
        self.t_end = self.t_start + size
        self.refill()
        self._moved()

    def action_edge(self, edge: int) -> None:
        self.cursor = edge * (self.columns - 1)
        self.refresh()

    def action_zoom(self, factor: float) -> None:
        bus = self.desk.bus
        if not bus.count or not bus.timed:
            return
        centre = self.time_at(self.cursor + 0.5)
        total = max(bus.t_last - bus.t_first, _LEAST_NS)
        size = min(max(round((self.t_end - self.t_start) * factor), _LEAST_NS), total)
        self.is_full = size == total
        share = (self.cursor + 0.5) / self.columns
        self.t_start = max(bus.t_first, min(centre - round(size * share), bus.t_first + total - size))
        self.t_end = self.t_start + size
        self.cursor = max(0, min(self.columns - 1, int((centre - self.t_start) * self.columns / size)))
        self.refill()
        self._moved()

    def action_whole(self) -> None:
        self.is_full, self.pinned = True, None
        self.grown()
        self._moved()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Without times there is no axis to move on."""
        return not self.desk.is_untimed and super().check_action(action, parameters)

    def action_pin(self) -> None:
        self.pinned = None if self.pinned is not None else self.time_at(self.cursor)
        self.refresh()

    def action_enter(self) -> None:
        span = self._span()
        if span is not None:
            self.post_message(SpanChosen(*span))
        elif self.desk.bus.count:
            self.post_message(RowWanted(self.desk.bus.table.row_at_time(self.time_at(self.cursor + 1))))

    def on_click(self, event: events.Click) -> None:
        offset = event.get_content_offset(self)
        if offset is not None and _LABEL <= offset.x < _LABEL + self.columns:
            self.cursor = offset.x - _LABEL
            self.refresh()
            if event.chain > 1:
                self.action_enter()

    def on_mouse_scroll_up(self) -> None:
        self.action_zoom(0.5)

    def on_mouse_scroll_down(self) -> None:
        self.action_zoom(2)
