"""Pages that the user has written to a file: where to, in which form, and what became of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..languages import error_words, tr
from ..model.causestory import story
from .items import cause_facts
from .prompts import Ask, may_write, names_folder, typed_path

if TYPE_CHECKING:
    from ..causes.registry import Cause
    from .screen import BusScreen
    from .threads import Stop


class PageFile(NamedTuple):
    """A page that may be written: what is asked for it."""

    question: str
    web_question: str
    name: str  # that is offered
    suffixes: Sequence[str]  # of the forms that it has


async def write_page(screen: BusScreen, kind: PageFile, make: Callable[[Path, Stop], bytes]) -> None:
    """Ask for a file, and write to it what `make` gives in a thread; a browser downloads it."""
    app = screen.app
    forms = tr("a file; its suffix sets the format: {formats}", formats=" ".join(kind.suffixes))

    def wrong(text: str) -> str:
        path = typed_path(text)
        if path.suffix.lower() not in kind.suffixes:
            return forms
        return "" if names_folder(path.parent) else tr("no folder {folder}", folder=path.parent)

    question = kind.web_question if app.is_web else kind.question
    text = await app.push_screen_wait(Ask(question, forms, wrong=wrong, value=kind.name))
    if not text:
        return
    path = typed_path(text)
    if not await may_write(screen, path):
        return

    def work(stop: Stop) -> tuple[bytes, str]:
        data = make(path, stop)
        try:
            if not (app.is_web or stop()):  # whose making was stopped is no page
                from ..exports.sink import output

                with output(path, source=screen.desk.source.path) as file:
                    file.write(data)
        except Exception as error:  # told in one line
            return b"", error_words(error)
        return data, ""

    def done(written: tuple[bytes, str]) -> None:
        data, trouble = written
        if trouble:
            screen.notify_of(trouble, wrong=True)
        elif app.is_web:
            app.deliver_binary(BytesIO(data), save_filename=path.name)
        else:
            screen.notify_of(tr("written to {file}", file=path.absolute()))

    screen.jobs.run("write page", work, done, exclusive=False)


async def write_story(screen: BusScreen, cause: Cause) -> None:
    """Write the story of a cause: what it is, what shows it, and the user's notes on that."""
    desk = screen.desk
    notes = desk.notes_by_row

    def make(_: Path, stop: Stop) -> bytes:
        lines = story(desk.bus, cause, cause_facts(cause), notes, desk.zone, stop)
        return "".join(f"{line}\n" for line in lines).encode()

    question = tr("Write the story of {cause} to", cause=cause.cause)
    kind = PageFile(question, tr("Download the story as"), f"{cause.cause}.md", (".md", ".txt"))
    await write_page(screen, kind, make)
