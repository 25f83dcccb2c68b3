"""What `certify` and `document`, which make one page of a capture, have in common; `report` takes its arguments.

As text (Markdown) on standard output, as JSON, or as one HTML page in a file.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from .commands import DONE, INTERRUPTED, NO_FRAME
from .inputs import tell_damage
from .terminal import add_overwrite_argument, put_json, tell_user, to_be_overwritten

if TYPE_CHECKING:
    from captures import Capture

    from ..reports.model import Report


class PageOfCapture(Protocol):
    """What a page is made from."""

    @property
    def report(self) -> Report: ...

    def to_json(self) -> dict[str, Any]: ...


Page = TypeVar("Page", bound=PageOfCapture)


def add_page_arguments(parser: argparse.ArgumentParser, *, json: str, html: str) -> None:
    """--json, --html FILE and --overwrite, with what the first two hold in words."""
    shape = parser.add_mutually_exclusive_group()
    shape.add_argument("--json", action="store_true", help=json)
    shape.add_argument("--html", metavar="FILE", help=html)
    add_overwrite_argument(parser, "FILE")


def put_out(
    arguments: argparse.Namespace,
    capture: Capture,
    make: Callable[[], Page],
    *,
    markdown: Callable[[Page], str],
    html: Callable[[Page], str],
) -> Page:
    """Make the page and write it as was asked for; what of the capture could not be read goes to standard error."""
    if arguments.html is None:
        page = make()
        if arguments.json:
            put_json(page.to_json(), indent=2)
        else:
            sys.stdout.write(markdown(page))
    else:
        from ..exports.sink import output

        to_be_overwritten(arguments.html, overwrite=arguments.overwrite, source=capture.path)
        with output(arguments.html, source=capture.path) as file:  # an unusable name is told before the work
            page = make()
            file.write(html(page).encode())
        if page.report.partial:
            tell_user("interrupted; the report covers only the part read so far")
    tell_damage(arguments.capture, capture)
    return page


def status_of(page: PageOfCapture) -> int:
    """The exit status, as far as the capture tells it."""
    if page.report.partial:
        return INTERRUPTED
    if not page.report.frames:
        tell_user(f"{page.report.source}: no Modbus frame found")
        return NO_FRAME
    return DONE
