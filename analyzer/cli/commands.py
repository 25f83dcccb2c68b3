"""The commands that there are, as a table, how each ends, and where the pages of their documentation are.

A new one is a line here and a module of its name beside this file, which holds EXAMPLE (lines that work when copied),
`configure(parser)` and `run(arguments) -> status`. `meanings` says what each exit status tells of one command,
`MEANINGS` of all; help and the manual page print them.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final, Protocol, cast

COMMANDS: Final[dict[str, str]] = {
    "parse": "annotate pasted bytes: one frame, a request with its answer, or a stretch of a log",
    "crc": "the check value of bytes, and the whole frame to send",
    "open": "the terminal interface: a capture, or a prompt to paste bytes at",
    "info": "format, line settings, span, ports and size of a capture, at once",
    "export": "write a capture's frames as JSON lines, CSV, Parquet, MCAP or pcapng",
    "convert": "captures as another capture: another format, cut, merged, their clocks mended",
    "report": "the bus in one page: units, functions, response times, load, errors",
    "check": "assert rules on a capture, for test benches and CI",
    "certify": "acceptance of a line: pass, marginal, fail or unknown, with confidence bounds",
    "document": "the bus described: devices, registers, poll round, timing, what is not known",
    "mcp": "captures and lakes told to agents, read only, over the Model Context Protocol",
    "batch": "collect many captures of many sites in a lake: Parquet tables that you can query",
    "ask": "query a lake: ready questions or SQL",
    "watch": "add new captures to a lake as they arrive",
    "registers": "what the registers mean: type, word order, role, with confidence and reasons",
    "plot": "one register over time, in the terminal or as a picture",
    "map": "register maps: list, show, check, import, infer, diff",
    "sniff": "listen to a tap and show frames as they come; record them with -o",
    "record": "only record a tap, unattended, for days",
    "between": "listen between your own program and its port or gateway; direction is known for certain",
    "tap": "let others listen to a port over the network, with the times of its bytes",
    "replay": "play a capture in its own time into the view of sniff, or onto a port",
    "twin": "answer as a recorded unit did: its answers, its delays, its registers",
    "ports": "list the serial ports of this machine and their descriptions",
    "wireshark": "have Wireshark list this machine's taps among its interfaces",
    "config": "settings that stay: show them, and where each is from",
    "repair": "make a whole file of a recording that was cut",
    "simulate": "make a capture of a plausible bus, with faults on request, and its ground truth",
    "demo": "open the bundled sample capture; on a pipe, report on it",
    "help": "the pages of the documentation: filters, findings, checks, formats, maps ...",
    "completion": "print the completion script of a shell",
}


class Command(Protocol):
    """What a command's module offers."""

    EXAMPLE: str

    def configure(self, parser: argparse.ArgumentParser) -> None: ...

    def run(self, arguments: argparse.Namespace) -> int: ...


def add_arguments(parser: argparse.ArgumentParser, name: str) -> Command:
    """The arguments of a command of the table, and --lang, which `app` heeds, of it and of its actions."""
    command = load(name)
    command.configure(parser)
    add_language(parser)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for each in action.choices.values():
                if "-" in each.prefix_chars:
                    add_language(each, default=argparse.SUPPRESS)  # what was given before the action stays
    return command


def add_language(parser: argparse.ArgumentParser, default: str | None = None) -> None:
    """--lang."""
    parser.add_argument(
        "--lang",
        choices=("en", "ru"),
        default=default,
        help="language of the interface, reports, causes, findings and help (en)",
    )


def load(name: str) -> Command:
    """The module of one command of the table."""
    from importlib import import_module

    return cast(Command, import_module(f"{__package__}.{name}"))


DONE: Final = 0
NO_FRAME: Final = 1
FAILED: Final = 1
UNUSABLE: Final = 2
INTERRUPTED: Final = 130
FAILURES: Final = {  # what status 1 tells, by command; the others do not end with it
    "parse": "the bytes hold no frame; with --check, there is an error-level finding",
    "export": "no frame, or nothing passes --filter; with --check, there is an error-level finding",
    "convert": "no byte of the line was left to write",
    "report": "no frame; with --check, there is an error-level finding",
    "check": "a rule fails, or the capture holds no frame",
    "certify": "no frame; with --check, the verdict is not pass",
    "document": "no frame",
    "mcp": "with --verify: a citation refers to nothing, or there is none",
    "batch": "a capture cannot be read, or is damaged; the others are in the lake",
    "watch": "with --once: a capture cannot be read, or is damaged; the others are in the lake",
    "registers": "no frame, no answer that carries a register, or with --like none that fits",
    "map": "traffic contradicts the map, or the capture holds no frame, or no register to make a map of",
    "sniff": "no frame came, or bytes were lost by the tap or by the recording",
    "record": "bytes of the line were lost",
    "between": "no frame came, or bytes were lost by the recording",
    "replay": "nothing was played: no frame, or with --to no byte",
    "twin": "with --client: an answer was not as recorded, or did not come",
    "repair": "no byte of the line is left in it",
}
MEANINGS: Final = (
    (DONE, "done"),
    (
        FAILED,
        "the input holds no frame, an assertion fails, a recording lost bytes, or a capture of a batch is damaged",
    ),
    (UNUSABLE, "unusable arguments or input; one line explains why"),
    (INTERRUPTED, "interrupted (Ctrl-C or a signal); partial output is kept"),
)


def meanings(command: str) -> tuple[tuple[int, str], ...]:
    """The exit statuses of one command, with what each tells."""
    own = FAILURES.get(command)
    return tuple(
        (status, words if status != FAILED or own is None else own)
        for status, words in MEANINGS
        if status != FAILED or own is not None
    )


class UsageError(Exception):
    """Arguments that cannot be used; the message says which and what to do."""


_INSTALLED: Final = Path(__file__).parents[1] / "pages"
_CLONE: Final = Path(__file__).parents[2] / "docs"  # of a clone


def pages(language: str = "en") -> dict[str, Path]:
    """The pages, by name: guides and how-tos by their own, tutorials as `tutorial-NAME`; in a language other than
    English those that stand in it, and the English ones for the rest."""
    folder = _INSTALLED if _INSTALLED.is_dir() else _CLONE
    named = _pages_in(folder)
    return named if language == "en" else {**named, **_pages_in(folder / language)}


def _pages_in(folder: Path) -> dict[str, Path]:
    kinds = (("", ""), ("howto", ""), ("tutorials", "tutorial-"))
    return {
        f"{prefix}{page.stem}": page
        for below, prefix in kinds
        for page in (folder / below).glob("*.md")
        if page.stem != "index"  # the site's own
    }
