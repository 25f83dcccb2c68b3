"""`rtuscope help`: the pages of the documentation, from inside the installed package."""

from __future__ import annotations

import argparse
import shutil
import sys
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Final

from ..languages import in_use, tr
from ..meant import did_you_mean
from ..terminal_text import READABLE, trusted
from .app import main
from .commands import COMMANDS, DONE, UsageError, pages
from .terminal import coloured, places

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from markdown_it.token import Token

EXAMPLE = """\
rtuscope help
rtuscope help filters
rtuscope help dead-unit"""

_ALIASES: Final = {
    "checks": "check",
    "maps": "registers",
    "config": "settings",
    "metrics": "outlets",
    "mqtt": "outlets",
    "tutorial": "tutorial-paste",
    "paste": "tutorial-paste",
    "wiring": "line",
    "termination": "line",
    "commands": "recipes",
}  # words by which pages are asked for


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("topic", nargs="?", metavar="TOPIC", help="page to read (default: the list of pages)")


def run(arguments: argparse.Namespace) -> int:
    """Print a page, or the list of them: in the language in use where it stands in it."""
    by_name = pages(in_use())
    if arguments.topic is None:
        for name, listed in sorted(by_name.items()):
            print(f"{name:18}{_title(listed)}")
        print(tr("\n`rtuscope COMMAND --help` describes a command"))
        return DONE
    if arguments.topic in COMMANDS:
        return main([arguments.topic, "--help"])
    topic = (
        arguments.topic.lower()
        .removesuffix(".md")
        .removeprefix("docs/")
        .removeprefix("howto/")
        .replace("tutorials/", "tutorial-")
    )
    page = by_name.get(topic) or by_name.get(_ALIASES.get(topic, ""))
    if page is None:
        near = did_you_mean(topic, [*by_name, *_ALIASES, *COMMANDS])
        raise UsageError(f"no page {arguments.topic!r}{near} (rtuscope help lists them)")
    text = page.read_text(encoding="utf-8")
    if places(sys.stdout):
        sys.stdout.write(trusted(rendered(text, shutil.get_terminal_size().columns, colour=coloured(sys.stdout))))
    else:
        print(text, end="")
    return DONE


def rendered(markdown: str, columns: int, *, colour: bool) -> str:
    """A page for a terminal of so many columns, without its pictures and without links to files that are not there."""
    from rich.console import Console
    from rich.markdown import Markdown

    page = Markdown(markdown, code_theme="bw", hyperlinks=False)
    for token in page.parsed:
        if token.children:
            token.children = list(_without_files(token.children))
    shown = StringIO()
    console = Console(
        file=shown, width=min(columns, READABLE), force_terminal=colour, color_system="standard" if colour else None
    )
    console.print(page)
    return "\n".join(line.rstrip() for line in shown.getvalue().splitlines()) + "\n"


def _without_files(tokens: Iterable[Token]) -> Iterator[Token]:
    """The parts of a text, of links into the documentation their words alone."""
    elsewhere = False  # the link that is open leads out of it
    for token in tokens:
        if token.type == "link_open":
            elsewhere = str(token.attrGet("href")).startswith("http")
        if token.type == "image" or (token.type in ("link_open", "link_close") and not elsewhere):
            continue
        yield token


def _title(page: Path) -> str:
    with page.open(encoding="utf-8") as lines:
        return lines.readline().lstrip("# ").strip()
