"""Home: the state of the bus at a glance. What is wrong and whose fault it is first, then every unit on a line."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple

from textual.binding import Binding, BindingType

from dissectors.values import harmless

from ..languages import counted, tr
from ..outages import unheard
from ..reports.findings import left_words
from ..words import compact, decimal, duration, moment, percent, rough_percent, short, short_bound
from .filterbar import FilterBar
from .health import bad_count, badness, facts_items, is_due, slow_units, slow_words, unit_items
from .items import FrameDetail, of_cause, whose
from .lines import Lines
from .paint import StyledText, fitted
from .places import OF_FIGURES, CausePlace, Place, UnitPlace
from .plot import over_time, sparkline
from .view import DoorCell, View, cells_of_units

if TYPE_CHECKING:
    from textual.widget import Widget

    from ..causes.leftovers import Left
    from ..causes.registry import Cause
    from ..model.bus import Bus
    from ..reports.model import Report, UnitRow
    from .desk import ViewState
    from .screen import BusScreen

_AGAIN_S: Final = 2.0  # between two reckonings while rows come
_LABEL: Final = 9
_HEADS: Final = 3  # lines above, where the load has one of them
_TALL: Final = 12  # lines of the load, at most
_WIDE: Final = 100  # columns from which on there is room to say whose fault a cause is
_NARROW: Final = 60  # and under which there is room for the least of a unit only
_LETTERS: Final = {"error": "E", "warning": "W", "note": "N"}
_MANY: Final = 0.05  # of the requests without a good answer
_PEAK: Final = 20  # columns: ` peak 27% in 1m02s`
_LEAST_PEAK: Final = 11  # ` peak 27%`
_ANSWERS: Final = 28  # columns: `answers ≤48.3ms, 95% ≤53.3ms`


class BusState(NamedTuple):
    """What Home shows."""

    report: Report
    causes: Sequence[Cause]
    not_explained: Sequence[Left] = ()
    of_all: bool = False  # whether all rows had come


class HomeList(Lines):
    """A line a cause, then a line a unit; what the cursor is on is told below."""

    HEAD = _HEADS
    EMPTY = "nothing captured yet"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "enter", "Open", tooltip="A cause: the first frame that shows it; a unit: only its rows"),
    ]

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.state: BusState | None = None
        self.settled = False  # whether it was reckoned of all rows
        self.first_at, self.first_pause_s = 0.0, _AGAIN_S  # when, unseen, it is reckoned: should it come up?

    def use_state(self, state: BusState) -> None:
        """Newer figures."""
        scope = self.desk.scope
        if scope.narrows:  # causes are told from everything; those of units that are left out are not shown
            units = {unit.unit for unit in state.report.units}
            own = [cause for cause in state.causes if not cause.units or units.intersection(cause.units)]
            state = BusState(state.report, own, of_all=state.of_all)
        slow = slow_units(state.report)
        sickest = sorted(state.report.units_as_heard, key=lambda row: (*badness(row), row.unit not in slow, row.unit))
        self.state = BusState(replace(state.report, units=tuple(sickest)), state.causes, state.not_explained)
        self.settled = state.of_all
        self._fresh_until = 0.0
        self.grown()
        if self.count() or self.desk.is_foreign:
            self._tell()

    def grown(self) -> None:
        self._make_heads()
        super().grown()

    def resized(self) -> None:
        self._make_heads()
        super().resized()

    def _make_heads(self) -> None:
        """The load is as high as two thirds of what the lines leave."""
        free = self.scrollable_content_region.height - _HEADS - self.count()
        drawn = self.desk.bus.count and self.desk.bus.timed and not self.desk.is_foreign
        self.HEAD = _HEADS + (max(0, min(_TALL - 1, 2 * free // 3)) if drawn else 0)

    @property
    def empty(self) -> str:
        if self.state is None and self.desk.bus.count:
            return ""  # it is being reckoned, as the first line says
        if self.desk.is_foreign:
            return tr("what was captured instead is shown below")
        return self.desk.emptied(self.EMPTY)

    @property
    def cause(self) -> Cause | None:
        """The cause under the cursor."""
        causes = () if self.state is None else self.state.causes
        return causes[self.cursor] if self.cursor < len(causes) else None

    @property
    def unit(self) -> UnitRow | None:
        """The unit under the cursor."""
        if self.state is None:
            return None
        at = self.cursor - len(self.state.causes)
        return self.state.report.units[at] if 0 <= at < len(self.state.report.units) else None

    def count(self) -> int:
        return 0 if self.state is None else len(self.state.causes) + len(self.state.report.units)

    def heads(self, y: int, width: int) -> Sequence[StyledText]:
        bus = self.desk.bus
        if y == 0:
            return fitted(self._verdict(), width)
        room = max(1, width - _LABEL - (_PEAK if width >= _NARROW else _LEAST_PEAK))
        if not bus.count or not bus.timed or self.desk.is_foreign:
            untimed = y == 1 and not bus.timed and not self.desk.is_foreign
            return fitted([StyledText(f"  {tr('no times in this capture')}" if untimed else "")], width)
        bins = self.desk.figures.over(bus.t_first, max(bus.t_last, bus.t_first + 1), room)
        if y < self.HEAD - 1:
            most = ""
            if bus.char_ns and y == 1:
                share = min(1.0, float((bins.octets * bus.char_ns / bins.width_ns).max()))
                most = tr(" peak {share}", share=percent(share))
                if width >= _NARROW:
                    most += tr(" in {time}", time=short(round(bins.width_ns)))
            label = tr("load") if y == 1 else ""
            bars = sparkline(bins.octets.astype(float), room, y - 1, self.HEAD - 2)
            return fitted(
                [StyledText(f"{label:>{_LABEL - 1}} "), StyledText(f"{bars:<{room}}", "request"), StyledText(most)],
                width,
            )
        marks = "".join(
            bar if n else " "
            for n, bar in zip(bins.troubles.tolist(), sparkline(bins.troubles.astype(float), room), strict=False)
        )
        return fitted([StyledText(f"{tr('trouble'):>{_LABEL - 1}} "), StyledText(marks, "error")], width)

    def _verdict(self) -> list[StyledText]:
        words, kind = next(self._verdicts())
        totals = [StyledText(f"   {self._totals()}", "dim")] * (kind != "dim")  # where nothing is shown, none
        return [StyledText(f"  {words}", kind), *totals]

    def _verdicts(self) -> Iterator[tuple[str, str]]:
        """What the first line may say, in words and as what it is shown: the first that holds is said."""
        desk, bus, state = self.desk, self.desk.bus, self.state
        failed = desk.failed_words()
        failure = f"{failed[:1].upper()}{failed[1:]}", "error"
        if desk.is_foreign:
            yield tr("no Modbus frames found"), ""
        if state is None and failed:
            yield failure
        if state is None or not bus.frames:
            yield tr("reading …"), ""
            return
        if desk.is_emptied:
            yield desk.emptied(), "dim"
        if ports := state.report.separate_ports:
            words = tr("{count} separate lines read as one: use --only-port {port}", count=len(ports), port=ports[0])
            yield words, "error"
        if state.causes:
            things = counted(len(state.causes), "cause explains", "causes explain")
            yield tr("{things} what is wrong", things=things), "error"
        if desk.scope.narrows:
            yield tr("No cause affects what is shown"), ""
        if _is_away(bus):
            yield _deaf_words(bus), "error"
        if state.not_explained:
            yield tr("Not explained: {words}", words=left_words(state.not_explained[0])), "warning"
        if failed:  # what it would have told is not known
            yield failure
        if any(count for level, count in bus.found.by_severity.items() if level > 1):
            yield tr("Isolated problems without a cause"), "warning"
        if bus.deaf:
            yield _deaf_words(bus), "warning"
        yield tr("No problems found") if bus.whole else tr("No problems so far"), "good"

    def _totals(self) -> str:
        """How many frames and findings there are, and in what time."""
        bus = self.desk.bus
        span = tr(" in {time}", time=duration(bus.t_last - bus.t_first)) if bus.timed and bus.count else ""
        frames, findings = counted(bus.frames, "frame", "frames"), counted(bus.found.count, "finding", "findings")
        if self.desk.scope.narrows:
            shown = tr("{some:,} of {frames}", some=self.desk.figures.frames, frames=frames)
            return f"{shown}{span}"
        if not self.settled and bus.count:
            return tr("so far {frames}{span}, {findings}", frames=frames, span=span, findings=findings)
        return f"{frames}{span}, {findings}"

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        assert self.state is not None
        causes = self.state.causes
        if line < len(causes):
            return fitted(_cause_line(causes[line], causes, width), width)
        return fitted(self._unit_line(self.state.report.units[line - len(causes)], width), width)

    def _unit_line(self, unit: UnitRow, width: int) -> list[StyledText]:
        bus, counts, times = self.desk.bus, unit.counts, unit.times
        bad, late = (count / max(1, counts.requests) for count in (bad_count(counts), counts.late))
        slow = unit.unit in slow_units(self.state.report) if self.state is not None else False
        kind = "error" if bad > _MANY else "warning" if bad or late or slow else "good"
        load = ""
        if bus.char_ns and bus.timed and bus.t_last > bus.t_first:
            share = self.desk.figures.units.octets[unit.unit] * bus.char_ns / (bus.t_last - bus.t_first)
            load = tr("uses {share}", share=percent(share))
        answers = tr("no answer times") if is_due(counts) else tr("no answer is due")
        half, most = times.bounds("p50"), times.bounds("p95")
        if half is not None and most is not None:
            answers = tr("answers {half}, 95% {most}", half=short_bound(half), most=short_bound(most))
        health = tr("slow" if slow else "sound") if is_due(counts) else ""
        if bad or late:
            worse = max(bad, late)
            share = rough_percent(worse)
            health = tr("{share:>4} bad", share=share) if bad >= late else tr("{share:>3} late", share=share)
        whom = [StyledText(tr("  unit {unit:>3} ", unit=unit.unit)), StyledText(f"{health:>8} ", kind)]
        if width < _NARROW:
            return [*whom, StyledText("" if most is None else f"  {decimal('95%')} {short_bound(most)}")]
        parts = [
            *whom,
            StyledText(tr("{asked:>6} asked  ", asked=compact(counts.requests))),
            StyledText(f"{load:>10}  " if width >= _WIDE else ""),
            StyledText(f"{answers:<{_ANSWERS}}"),
        ]
        room = width - sum(len(part.text) for part in parts) - 2
        if room > 7:
            parts.append(StyledText("  " + over_time(self.desk.answer_means(unit.unit), room), "response"))
        return parts

    def look(self) -> FrameDetail:
        """What the cursor is on, in full."""
        cause, unit = self.cause, self.unit
        if cause is not None:
            return of_cause(self.desk, cause)
        if unit is not None and self.state is not None:
            return FrameDetail(
                tr("unit {unit}", unit=unit.unit),
                b"",
                unit_items(unit, self.state.report, self.state.causes),
            )
        if self.state is not None and self.desk.is_foreign:
            return FrameDetail(tr("what was captured"), b"", facts_items(self.state.report))
        return FrameDetail("", b"", ())


def _is_away(bus: Bus) -> bool:
    """Whether nothing can be heard now."""
    return bool(bus.deaf) and bus.deaf[-1].to_ns is None and not bus.whole


def _deaf_words(bus: Bus) -> str:
    """The newest time in which nothing was heard, and how many there were; that of a port that is away has no end."""
    newest, more = bus.deaf[-1], len(bus.deaf) - 1
    if _is_away(bus):
        words = tr("nothing heard since {moment}: {text}", moment=moment(newest.from_ns), text=harmless(newest.text))
    else:
        words = unheard(newest)
    words = f"{words[:1].upper()}{words[1:]}"
    return f"{words}; {counted(more, 'more such time', 'more such times')}" if more else words


def _cause_line(cause: Cause, causes: Sequence[Cause], width: int) -> list[StyledText]:
    """One of several, under each other; where there is little room only the cause's own words."""
    letter = StyledText(f"{_LETTERS.get(cause.severity, ' ')} ", cause.severity)
    if width < _WIDE:
        return [letter, StyledText(_first_words(cause.text, width - 2))]
    whom, sure = (max(map(len, each)) for each in (map(whose, causes), (one.sure for one in causes)))
    return [
        letter,
        StyledText(f"{whose(cause):<{whom}} "),
        StyledText(f"{cause.sure:<{sure}}  ", "dim"),
        StyledText(_first_words(cause.text, width - 2 - whom - 1 - sure - 2)),
    ]


def _first_words(text: str, room: int) -> str:
    """As many words of a text as there is room for; the pane below has all of it."""
    words = text[: room - 1].rpartition(" ")[0]
    return text if len(text) <= room or not words else f"{words.rstrip(':;,')} …"


def _refresh(screen: BusScreen) -> None:
    _reckon(screen)


def _reckon(screen: BusScreen) -> None:
    """Newer figures, for whoever asks first: one reckoning serves Home in sight and whether it comes up."""
    home, bus = screen.query_one(HomeList), screen.desk.bus
    figures, source = screen.desk.figures, screen.desk.source
    basis = bus.count, bus.found.count, bus.whole, id(figures), tuple(bus.deaf)

    def work(_: object) -> BusState:
        whole, story = bus.whole, bus.story()
        return BusState(figures.report(source), story.causes, story.not_explained, whole)

    def came(state: BusState) -> None:
        home.use_state(state)
        if not screen.undecided or screen.touched:
            return
        if state.causes or screen.desk.is_foreign:
            screen.action_view(VIEW.name)
        screen.undecided = not bus.whole and not state.causes

    screen.jobs.reckon("home", basis, work, came, fills=VIEW.name, failed=home.grown)


def come_up_first(screen: BusScreen) -> None:
    """Come up first where there are causes to tell, or no frame is there, and nobody has pressed a key yet."""
    home, bus = screen.query_one(HomeList), screen.desk.bus
    screen.undecided &= not screen.touched
    if not screen.undecided or not bus.count or (time.monotonic() < home.first_at and not bus.whole):
        return
    home.first_at = time.monotonic() + home.first_pause_s
    home.first_pause_s *= 2  # the longer the capture, the dearer a look, and the less there is to expect of the next
    _reckon(screen)


def _chosen(screen: BusScreen, sender: Widget) -> None:
    assert isinstance(sender, HomeList)
    if screen.view == VIEW.name:
        screen.detail.show_frame(sender.look())


def _entered(screen: BusScreen, sender: Widget) -> None:
    """A cause: the first row that shows it. A unit: its rows alone."""
    assert isinstance(sender, HomeList)
    cause, unit = sender.cause, sender.unit
    if cause is not None:
        screen.jumps.walk(cause)
    elif unit is not None:
        screen.action_view(screen.list_view)
        screen.query_one(FilterBar).use_filter(f"unit == {unit.unit}")


def _shown(screen: BusScreen) -> None:
    screen.detail.show_frame(screen.query_one(HomeList).look())


def _cells(screen: BusScreen) -> list[DoorCell]:
    home = screen.query_one(HomeList)
    if home.unit is not None:
        unit, times = home.unit.unit, home.unit.times
        cells = [DoorCell("u", tr("unit {unit}", unit=unit), f"unit == {unit}")]
        if times.p95_ns:
            slow = f"unit == {unit} and response_time >= {times.p95_ns // 1000 / 1000}ms"  # never above the slowest
            cells.append(DoorCell("s", slow_words(times), slow))
        return cells
    return [] if home.cause is None else cells_of_units(home.cause.units)


def _at(screen: BusScreen) -> Place:
    home = screen.query_one(HomeList)
    if home.cause is not None:
        return CausePlace(home.cause)
    return None if home.unit is None else UnitPlace(home.unit.unit)


VIEW: Final = View(
    name="home", key="0,H", title="Home",
    make=lambda desk: HomeList(desk, id="home"), refresh=_refresh,
    chosen=_chosen, entered=_entered, shown=_shown, at=_at, cells=_cells,
    detail=True, offers=OF_FIGURES | {"goto", "finding"}, figures=True,
)  # fmt: skip
