"""Keys and clicks in their order: each acts on what the one before it left.

Textual hands a key to the widget in focus and takes the next at once. Typed fast, or sent by a script, a key then
finds the cursor, the view or the question of some keys ago. Here a key waits for the one before it: for the widget
that got it, for whoever is told by it, for a question that it brings up to have the keys, for a list to show other
rows, and for a view to have its first lines. With Cyrillic on, a letter key gives the letter that stands on it; it
means the same key.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from textual.app import ScreenStackError
from textual.events import Event, Key, MouseDown, MouseScrollDown, MouseScrollUp, MouseUp
from textual.keys import _character_to_key
from textual.screen import ModalScreen
from textual.widgets import Input, TextArea

if TYPE_CHECKING:
    from textual.app import App
    from textual.dom import DOMNode
    from textual.worker import Worker

_LATIN: Final = "qwertyuiop[]asdfghjkl;'zxcvbnm,./`"
_CYRILLIC: Final = "йцукенгшщзхъфывапролджэячсмитьбю.ё"
_UPPER: Final = 'QWERTYUIOP{}ASDFGHJKL:"ZXCVBNM<>?~'
TWINS: Final = {
    **{own: latin for own, latin in zip(_CYRILLIC, _LATIN, strict=True) if own != "."},
    **{own.upper(): latin for own, latin in zip(_CYRILLIC, _UPPER, strict=True) if own != "."},
}


def latin(event: Key) -> Key:
    """The key as the Latin layout has it; itself where it is no Cyrillic letter."""
    twin = TWINS.get(event.character or "")
    return event if twin is None else Key(twin if twin.isalpha() else _character_to_key(twin), twin)


_ASKING: Final = "ask"  # group of the workers that put questions
FINDING: Final = "find"  # and of those that look for the next hit
_LONGEST_S: Final = 2.0  # a laptop that is busy with something else needs one


def put_question(owner: DOMNode, question: Callable[..., Coroutine[Any, Any, None]], *about: object) -> None:
    """Put a question, as long as the owner is there; the keys behind it wait for the answer.

    A worker that ends before its first turn calls nothing: a coroutine made beforehand would never be awaited.
    """
    _: Worker[None] = owner.run_worker(partial(question, *about), group=_ASKING)


CLICKS: Final = MouseDown, MouseUp, MouseScrollDown, MouseScrollUp


class KeyQueue:
    """The keys and clicks that wait for their turn."""

    def __init__(self, app: App[Any], dispatch: Callable[[Event], Awaitable[None]]) -> None:
        self._app, self._dispatch = app, dispatch
        self._waiting: deque[Event] = deque()
        self._task: asyncio.Task[None] | None = None
        self.closed = False  # the application is ending
        self.taken = 0  # keys so far
        self.patience_s = _LONGEST_S  # nothing holds keys back for longer

    @property
    def busy(self) -> bool:
        """Whether a key has not had its effect yet."""
        return self._task is not None

    @property
    def waiting(self) -> int:
        """Keys and clicks that came ahead."""
        return len(self._waiting)

    def close(self) -> None:
        """The application ends: keys that wait have no effect any more."""
        self.closed = True
        self._waiting.clear()
        if self._task is not None:
            self._task.cancel()

    async def take_key(self, event: Key) -> None:
        """A key was pressed: it is handed on at once where none is before it."""
        if self.closed:
            return
        self.taken += 1
        if self._task is not None:
            self._waiting.append(event)
            return
        target = self._app.focused or self._app.screen
        await self._dispatch(self._meant(event))
        task = asyncio.create_task(self._go_on(target))  # from Python 3.12 on it runs at once, and may have ended
        self._task = None if task.done() else task

    async def take_click(self, event: Event) -> None:
        """The mouse was used: it acts on what is there once the keys before it have had their effect."""
        if self._task is None:
            await self._dispatch(event)
        elif not self.closed:
            self._waiting.append(event)

    def _meant(self, event: Event) -> Event:
        """Letters are letters where text is typed, else keys, whatever the layout."""
        if not isinstance(event, Key) or isinstance(self._app.focused, Input | TextArea):
            return event
        return latin(event)

    async def _go_on(self, target: DOMNode) -> None:
        """Wait for the key that `target` was handed, then hand on those that came meanwhile."""
        try:
            while True:
                await handled(self._app, target, self.patience_s)
                if not self._waiting:
                    return
                target = self._app.focused or self._app.screen
                await self._dispatch(self._meant(self._waiting.popleft()))
        except ScreenStackError:  # the application is ending, and has no screen any more
            self._waiting.clear()
        finally:
            self._task = None


async def handled(app: App[Any], target: DOMNode, patience_s: float = _LONGEST_S) -> None:
    """Return once a key that `target` was handed has had its effect, or after so long."""
    try:
        async with asyncio.timeout(patience_s):
            await _notified(target)  # it, and whatever has a binding for the key
            await _notified(app.focused or app.screen)  # who was told of what that did
            await _question_settled(app)
    except TimeoutError:
        jobs = getattr(app.screen, "jobs", None)
        if jobs is not None:
            jobs.wait_no_more()  # or each key would wait as long for the same lines


async def _notified(target: DOMNode) -> None:
    """The widget, then each of those around it: what one posts to the next is in the queue before this."""
    for node in target.ancestors_with_self:
        handled = asyncio.Event()
        if node.is_running and node.call_later(handled.set):
            await handled.wait()


async def _question_settled(app: App[Any]) -> None:
    """A question that is on its way is there and has the keys; one that was answered is done with."""
    while _coming(app):
        await asyncio.sleep(0.001)


def _coming(app: App[Any]) -> bool:
    top = app.screen
    if isinstance(top, ModalScreen):
        return not top.is_running or (top.focused is None and top.AUTO_FOCUS != "")
    jobs = getattr(top, "jobs", None)
    if jobs is not None and (jobs.unsettled or jobs.is_filling):
        return True
    return any(worker.group in (_ASKING, FINDING) and not worker.is_finished for worker in app.workers)
