"""Filters that the user keeps: used by name, lit in the lists by colour, a row each in the timeline."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ..filters import FilterError
from ..languages import tr
from ..model.selection import compiled
from ..settings import COLOURS
from .filterbar import FilterBar
from .preferences import KeptFilter
from .prompts import Ask, Choose

if TYPE_CHECKING:
    from ..model.selection import Test
    from .desk import ViewState
    from .screen import BusScreen

_SHOWN = 9  # of the user's own, and of the settings files' as many
_KEYS = "123456789abcefghij"


class KeptFilters:
    """The main screen's kept filters."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    async def choose(self) -> None:
        """Use one, keep the one in use, drop one."""
        screen = self._screen
        wishes, ask = screen.desk.wishes, screen.app.push_screen_wait
        bar = screen.query_one(FilterBar)
        own = wishes.filters[:_SHOWN]
        shown = [*own, *wishes.presets][: 2 * _SHOWN]
        choices = [(_KEYS[i], _entry_words(entry)) for i, entry in enumerate(shown)]
        choices += [("k", tr("keep the filter in use: {filter}", filter=bar.text))] if bar.text else []
        choices += [("d", tr("drop one"))] if own else []
        if not choices:
            screen.tell(tr("no filter is kept yet: use one, then S keeps it"))
            return
        which = await ask(Choose(tr("Kept filters"), choices))
        if which is None:
            return
        if which < len(shown):
            bar.use(shown[which].text)
        elif choices[which][0] == "k":
            await self._keep(bar.text)
        else:
            gone = await ask(Choose(tr("Drop"), choices[: len(own)]))
            if gone is not None:
                wishes.drop(own[gone].name)
        self._again()

    async def _keep(self, text: str) -> None:
        hint = tr("a name; a colour behind it lights its rows: {colours}", colours=", ".join(COLOURS))
        answer = await self._screen.app.push_screen_wait(Ask(tr("Keep as"), hint, wrong=_no_name))
        if answer is None:
            return
        name, _, colour = answer.strip().rpartition(" ")
        if colour not in COLOURS or not name:
            name, colour = answer.strip(), ""
        self._screen.desk.wishes.keep(KeptFilter(name, text, colour))

    def _again(self) -> None:
        """Colours are others now."""
        self._screen.desk.rules = list(rules_of(self._screen.desk))
        self._screen.repaint_lists()
        self._screen.refresh_view()


def rules_of(desk: ViewState) -> Iterator[tuple[Test, str]]:
    """Kept filters with a colour and the settings' rules, as tests with the kind (`paint.INKS`) of their rows."""
    for entry in (*desk.wishes.filters, *desk.wishes.presets):
        if entry.colour:
            try:
                yield compiled(entry.text, desk.source.line).test, f"tint-{entry.colour}"
            except FilterError:
                continue  # kept for captures with a map, or by another version


def kept_tests(desk: ViewState) -> Iterator[tuple[str, Test]]:
    """All of them, by name."""
    for entry in desk.wishes.filters:
        try:
            yield entry.name, compiled(entry.text, desk.source.line).test
        except FilterError:
            continue


def _entry_words(entry: KeptFilter) -> str:
    return f"{entry.name}: {entry.text}" + (f" ({entry.colour})" if entry.colour not in ("", entry.name) else "")


def _no_name(text: str) -> str:
    return "" if text.strip() else tr("a name is needed")
