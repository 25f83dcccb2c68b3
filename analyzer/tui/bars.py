"""The lines around the views: tabs on top, what is open and what is found at the bottom, and the keys; and between them
the panes of the view that is shown: which has the keys, and how much room each has.

The keys are those that mean something where the focus is, clickable: whole ones, as many as there is room for, those
for help and to leave among them, told in the language in use. Textual's own footer makes a dozen widgets anew whenever
the focus moves, some 15 ms of work before the first rows and behind many a key; this line is painted, and only when
other keys stand in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

from rich.cells import cell_len
from rich.text import Text
from textual import events
from textual.binding import ActiveBinding, Binding
from textual.screen import Screen
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import ContentSwitcher, Input, Static

from dissectors.values import harmless

from ..languages import counted, grouped, tr
from ..tables.findings import Severity
from ..words import shortened
from .filterbar import FilterBar
from .frames import FrameList
from .messages import ViewWanted
from .paint import Painted, StyledText, fitted
from .view import View
from .views import BY_NAME, VIEWS

if TYPE_CHECKING:
    from .desk import ViewState
    from .screen import BusScreen


class Tabs(Static):
    """The views by number; the chosen one stands out."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, markup=False)
        self.chosen = VIEWS[0].name
        self.troubles = 0

    def choose(self, view: str) -> None:
        """Another view is shown."""
        self.chosen = view
        self.refresh()

    @property
    def _views(self) -> list[View]:
        return [view for view in VIEWS if view.tab or view.name == self.chosen]

    def _words(self) -> list[tuple[View, str]]:
        """Each view with its text, as short as the width needs: the last ones are only their keys where it must be."""
        views, width = self._views, self.size.width
        words = [self._word(view, narrow=False) for view in views]
        if sum(map(len, words)) > width:
            words = [self._word(view, narrow=True) for view in views]
        for i, view in reversed(list(enumerate(views))):
            if sum(map(len, words)) > width and view.name != self.chosen:
                words[i] = f" {_digit(view)}"
        return list(zip(views, words, strict=True))

    def _word(self, view: View, *, narrow: bool) -> str:
        title = _tab_title(view) if narrow else tr(view.title)
        return f" {_digit(view)} {title}{' ' if not narrow or view.name == self.chosen else ''}"

    def render(self) -> Text:
        line = Text(no_wrap=True)
        for view, text in self._words():
            line.append(text, "reverse bold" if view.name == self.chosen else "")
        return line

    def on_click(self, event: events.Click) -> None:
        offset = event.get_content_offset(self)
        at = 0
        for view, text in self._words():
            if offset is not None and at <= offset.x < at + len(text):
                self.post_message(ViewWanted(view.name))
            at += len(text)


def _digit(view: View) -> str:
    """The first of its keys."""
    return view.key.partition(",")[0]


def _tab_title(view: View) -> str:
    return tr(view.short or view.title)


_LEAST, _MOST = 15, 80  # percent of the screen that the frame below may take


class Panes:
    """The main screen's panes."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    @property
    def all(self) -> list[Widget]:
        """What can have the keys, the view's list first."""
        screen = self._screen
        part, detail = screen.query_one(f"#{screen.view}"), screen.detail
        own = [widget for widget in (part, *part.query("*")) if widget.focusable]
        return [*own, detail.fields, detail.octets] if BY_NAME[screen.view].detail else own

    def arrange(self, view: View) -> None:
        """A view comes up, with the lines and panes that it has."""
        screen, detail = self._screen, self._screen.detail
        screen.query_one("#views", ContentSwitcher).current = view.name
        screen.query_one(Tabs).choose(view.name)
        detail.display = view.detail
        screen.query_one("#views").display = True
        detail.set_class(False, "-zoomed")
        screen.query_one(FilterBar).display = view.filtered
        for name in ("home", "paste", "polls"):  # of the pane alone: one of the screen would style every widget anew
            detail.set_class(view.name == name, f"-{name}")

    def step(self, step: int) -> None:
        """From the list to the fields, to the bytes, and round."""
        panes = self.all
        at = next((i for i, pane in enumerate(panes) if pane.has_focus), -1)
        panes[(at + step) % len(panes) if at >= 0 else 0].focus()

    def zoom(self) -> None:
        """The list alone, or the frame below alone; again both."""
        views, detail = self._screen.query_one("#views"), self._screen.detail
        if not (views.display and detail.display) and BY_NAME[self._screen.view].detail:
            views.display = detail.display = True
            detail.set_class(False, "-zoomed")
        elif detail.has_focus_within:
            views.display = False
            detail.set_class(True, "-zoomed")
        else:
            detail.display = False

    def size(self, step: int) -> None:
        """More or less room for the frame below, in percent of the screen."""
        detail = self._screen.detail
        share = round(100 * detail.size.height / max(1, self._screen.size.height)) + step
        detail.styles.height = f"{max(_LEAST, min(_MOST, share))}%"


def is_gone(source: object) -> bool:
    """Whether a live source cannot hear anything now."""
    return bool(getattr(source, "gone", False))


_SPIN = "|/-\\"
_SLIM = 100  # columns under which not all of a live state has room


def _following(listing: FrameList) -> str:
    waiting = listing.count() - 1 - listing.cursor
    return tr("following") if listing.following else tr("{count:,} below (F follows)", count=waiting)


class StatusLine(Painted):
    """One line: what is open, what goes on, where one is, what was found."""

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.where = ""
        self.doing = ""
        self.follow = ""
        self.state = ("", "")
        self._turn = 0

    def take_state_of(self, screen: BusScreen) -> None:
        """Where the cursor is, what goes on, live whether the list follows its end, and what became of the file."""
        bus, jobs, picked = self.desk.bus, screen.jobs, screen.picked
        self.where = counted(bus.frames, "frame", "frames")
        if bus.noise_bytes:
            self.where += tr(", noise {count:,} B", count=bus.noise_bytes)
        if jobs.selection is not None:
            self.where = tr("{some:,} of {all:,} rows shown", some=screen.frames.rows.count, all=bus.count)
        if picked.anchor is not None:
            self.where += tr(", selected {count:,}", count=len(picked.rows()))
        listing = screen.query_one(f"#{screen.list_view}", FrameList)
        self.follow = _following(listing) if listing.live and not bus.whole else ""
        self.doing, self.state = jobs.doing, screen.files.state
        self._turn += 1
        self.refresh()

    def render_line(self, y: int) -> Strip:
        width = self.content_size.width
        if y:
            return Strip.blank(width, self.base)
        state = getattr(self.desk.source, "state", None)
        told = [] if state is None or self.desk.bus.whole else list(state())
        slim = bool(told) and width < _SLIM  # what may change stands before what does not
        left = [StyledText(f" {self._called(max(12, width // 3))} ", "strong")]
        left.append(StyledText(" " if slim else f"{self._speed()}  ", "dim"))
        if self.state[0]:
            left.append(StyledText(f"{self.state[0]}  ", self.state[1]))
        if failed := self.desk.failed:
            named = ", ".join(dict.fromkeys(each.part for each in failed))
            left.append(StyledText(f"{tr('FAILED {parts}', parts=shortened(named, width // 4))}  ", "error"))
        if self.desk.ended:
            words = tr("reading ended: {trouble}", trouble=shortened(self.desk.ended, width // 3))
            left.append(StyledText(f"{harmless(words)}  ", "error"))
        if self.desk.paused:
            left.append(StyledText(f"{tr('PAUSED, P resumes')}  ", "warning"))
        if doing := self.doing or self._listening():
            words = self.doing if told else doing  # beside a rate the spin alone says that it listens
            left.append(StyledText(f"{_SPIN[self._turn % len(_SPIN)]} {words}{'  ' if words else ''}", "note"))
        states = [StyledText(f"{harmless(words)}  ", kind) for words, kind in told]
        if slim:
            left += [*states[:-1], StyledText(f"{self.follow}  "), states[-1], StyledText(self.where)]
        else:
            left += [*states, StyledText(", ".join(filter(None, (self.where, self.follow))))]
        right = self._finding_counts()
        size = sum(cell_len(part.text) for part in right)
        return self.strip([*fitted(left, max(0, width - size)), *right], width, self.base)

    def _listening(self) -> str:
        """What a live source does, if it can: looked at when it is painted, as all that stands beside it."""
        source = self.desk.source
        return tr("listening") if source.live and not self.desk.bus.whole and not is_gone(source) else ""

    def _called(self, most: int) -> str:
        name = harmless(self.desk.source.name)
        return name if len(name) <= most else "…" + name[1 - most :]

    def _speed(self) -> str:
        line = self.desk.source.line
        if not line.baud:
            return tr("baud not known")
        return " ".join(filter(None, (str(line.baud), line.character_format)))

    def _finding_counts(self) -> list[StyledText]:
        counts = self.desk.bus.found.by_severity
        kinds = ((Severity.ERROR, "E", "error"), (Severity.WARNING, "W", "warning"), (Severity.NOTE, "N", "note"))
        by_kind = [
            StyledText(f" {grouped(counts[level])}{letter}", kind) for level, letter, kind in kinds if counts[level]
        ]
        losses = self.desk.losses
        lost = [StyledText(f" !{counted(losses, 'loss', 'losses')}", "error")] if losses else []
        return [*lost, *by_kind, StyledText(" ")]


_ALWAYS: Final = frozenset({"help", "leave"})  # actions
_LAST: Final = ("export", "door('=')", "span")  # where all others have room


def fitting(
    bindings: Mapping[str, ActiveBinding], display: Callable[[Binding], str], width: int, focused: Widget | None = None
) -> dict[str, ActiveBinding]:
    """The same bindings by key, those that do not fit into a line of `width` cells no longer shown in it.

    Where one types into a line (`focused`), its own keys alone: the letters of all others are text there.
    """
    if isinstance(focused, Input):
        bindings = {key: each if each.node is focused else _unshown(each) for key, each in bindings.items()}
    active = {key: _in_language(each) if each.binding.show else each for key, each in bindings.items()}
    first = {each.binding.action: each.binding for each in reversed([*active.values()]) if each.binding.show}
    cells = {action: cell_len(f"{display(binding)} {binding.description} ") for action, binding in first.items()}
    room = width - sum(cells[action] for action in _ALWAYS & cells.keys())
    left_out: set[str] = set()
    wanted = dict.fromkeys(each.binding.action for each in active.values() if each.binding.show)
    for action in sorted((each for each in wanted if each not in _ALWAYS), key=_rank):
        room = -1 if cells[action] > room else room - cells[action]  # and none behind it: they keep their order
        if room < 0:
            left_out.add(action)
    return {key: _unshown(each) if each.binding.action in left_out else each for key, each in active.items()}


def _unshown(active: ActiveBinding) -> ActiveBinding:
    return active._replace(binding=replace(active.binding, show=False))


def _rank(action: str) -> int:
    return _LAST.index(action) + 1 if action in _LAST else 0


def _in_language(active: ActiveBinding) -> ActiveBinding:
    binding = replace(active.binding, description=tr(active.binding.description))
    return active._replace(binding=binding, tooltip=tr(active.tooltip))


class KeyInLine(NamedTuple):
    """A key as it stands there."""

    key: str
    display: str
    description: str
    enabled: bool
    tooltip: str

    @property
    def width(self) -> int:
        """Its columns, the blank behind it among them."""
        return cell_len(f"{self.display} {self.description} ")


class KeyLine(Painted):
    """The keys that the screen's bindings show."""

    ALLOW_SELECT = False

    def __init__(self) -> None:
        super().__init__()
        self.keys: tuple[KeyInLine, ...] = ()
        self._waiting = False

    def on_mount(self) -> None:
        self.screen.bindings_updated_signal.subscribe(self, self._bindings_changed)

    def _bindings_changed(self, screen: Screen[object]) -> None:
        if self._waiting or screen is not self.screen:
            return
        self._waiting = True
        self.call_after_refresh(self._look)

    def _look(self) -> None:
        self._waiting = False
        if not self.is_attached:  # its screen was left meanwhile
            return
        keys = tuple(self._shown_keys())
        if keys != self.keys:
            self.keys = keys
            self.refresh()

    def _shown_keys(self) -> Iterator[KeyInLine]:
        """A key for each action, the first that its bindings name."""
        actions = set()
        for _, binding, enabled, tooltip in self.screen.active_bindings.values():
            if binding.show and binding.action not in actions:
                actions.add(binding.action)
                yield KeyInLine(binding.key, self.app.get_key_display(binding), binding.description, enabled, tooltip)

    def render_line(self, y: int) -> Strip:
        width = self.content_size.width
        if y:
            return Strip.blank(width, self.base)
        parts = []
        for key in self.keys:
            parts.append(StyledText(key.display, "key" if key.enabled else "dim"))
            parts.append(StyledText(f" {key.description} ", "" if key.enabled else "dim"))
        return self.strip(fitted(parts, width), width, self.base)

    def _under(self, event: events.MouseEvent) -> KeyInLine | None:
        right = 0
        for key in self.keys:
            right += key.width
            if event.x < right:
                return key
        return None

    def on_mouse_down(self, event: events.MouseDown) -> None:
        key = self._under(event)
        if key is not None and key.enabled:
            self.app.simulate_key(key.key)

    def on_mouse_move(self, event: events.MouseMove) -> None:
        key = self._under(event)
        told = (key.tooltip or None) if key is not None else None
        if told != self.tooltip:
            self.tooltip = told
