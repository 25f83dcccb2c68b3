"""What a live bus is watched for: when it comes the terminal rings, and the row is bookmarked and marked."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from dissectors.values import harmless

from ..filters import FilterError
from ..languages import error_words, tr
from .prompts import Ask

if TYPE_CHECKING:
    from .live import LiveSource
    from .screen import BusScreen


class Triggers:
    """The main screen's trigger."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    @property
    def source(self) -> LiveSource | None:
        """What can be watched; None where nothing comes any more."""
        source = self._screen.desk.source
        watched = hasattr(source, "watch") and not self._screen.desk.bus.whole
        return cast("LiveSource", source) if watched else None

    async def ask(self) -> None:
        """Ask what to watch for."""
        screen, source = self._screen, self.source
        if source is None:
            return
        before = "" if source.trigger is None else source.trigger.text
        hint = tr("a filter, or: cause (any new one), cause all-silent; empty: nothing")
        question = Ask(tr("Ring and mark when this comes"), hint, value=before, wrong=self._wrong)
        text = await screen.app.push_screen_wait(question)
        if text is not None and text.strip() != before:
            source.watch(text.strip(), screen.desk.meanings.charts)
            screen.write_status()

    def _wrong(self, text: str) -> str:
        try:
            if text.strip():
                from ..live.conditions import LiveTrigger

                LiveTrigger(text.strip(), self._screen.desk.meanings.charts)
        except FilterError as error:
            return error_words(error)
        return ""

    def ring(self) -> None:
        """Ring for what came, and bookmark where it stands."""
        source, desk = self.source, self._screen.desk
        for fired in source.fired() if source is not None else ():
            words = tr("trigger: {words}", words=fired.text)
            if fired.start >= 0 or desk.bus.count:
                place = (fired.port, fired.start) if fired.start >= 0 else desk.place(desk.bus.count - 1)
                desk.notes.comments.setdefault(place, words)
                self._screen.repaint_lists()
            self._screen.app.bell()
            self._screen.notify_of(harmless(words))
