"""`rtuscope help`: the pages of the documentation, from inside the installed package."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

from ..meant import did_you_mean
from .app import main
from .commands import COMMANDS, DONE, UsageError, pages

EXAMPLE = """\
rtuscope help
rtuscope help filters
rtuscope help findings"""

_ALIASES: Final = {
    "checks": "check",
    "maps": "registers",
    "config": "settings",
    "metrics": "outlets",
    "mqtt": "outlets",
}  # words by which pages are asked for


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("topic", nargs="?", metavar="TOPIC", help="a page; without one, what there is")


def run(arguments: argparse.Namespace) -> int:
    """Print a page, or the list of them."""
    by_name = pages()
    if arguments.topic is None:
        for name, listed in sorted(by_name.items()):
            print(f"{name:14}{_title(listed)}")
        print("\nrtuscope COMMAND --help tells of a command")
        return DONE
    if arguments.topic in COMMANDS:
        return main([arguments.topic, "--help"])
    topic = arguments.topic.lower().removesuffix(".md").removeprefix("docs/")
    page = by_name.get(topic) or by_name.get(_ALIASES.get(topic, ""))
    if page is None:
        near = did_you_mean(topic, [*by_name, *_ALIASES, *COMMANDS])
        raise UsageError(f"no page {arguments.topic!r}{near} (rtuscope help lists them)")
    print(page.read_text(encoding="utf-8"), end="")
    return DONE


def _title(page: Path) -> str:
    with page.open(encoding="utf-8") as lines:
        return lines.readline().lstrip("# ").strip()
