"""What the parts of the main screen know of it: each part is a class of its own, and the screen is all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.screen import Screen

if TYPE_CHECKING:
    from .desk import Desk
    from .frames import ConversationList, FrameList
    from .look import Look


class Part(Screen[None]):
    """A part of the main screen."""

    if TYPE_CHECKING:
        desk: Desk
        view: str
        row: int | None
        look: Look
        pinned: int | None
        doing: str

        @property
        def frames(self) -> FrameList: ...
        @property
        def talk(self) -> ConversationList: ...
        def action_view(self, view: str) -> None: ...
        def refresh_view(self) -> None: ...
        def say(self) -> None: ...
        def study_row(self, row: int) -> None: ...
        def tell(self, text: str, *, wrong: bool = False) -> None: ...
