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
    "crc": "compute the check value of bytes and print the whole frame",
    "open": "open a capture in the terminal interface, or paste bytes",
    "info": "a capture's format, line settings, duration, ports and size, at a glance",
    "export": "write a capture's frames as JSON lines, CSV, Parquet, MCAP or pcapng",
    "convert": "convert captures: change format, cut, merge, correct clocks",
    "report": "the bus on one page: units, functions, response times, load, errors",
    "check": "check a capture against rules, for test benches and CI",
    "certify": "acceptance of a line: pass, marginal, fail or unknown, with confidence bounds",
    "document": "describe the bus: devices, registers, poll cycle, timing, unknowns",
    "mcp": "serve captures and lakes to agents, read-only (Model Context Protocol)",
    "batch": "collect many captures of many sites in a lake: Parquet tables that you can query",
    "ask": "query a lake: ready-made questions or SQL",
    "watch": "add new captures to a lake as they arrive",
    "registers": "infer register types, word order and roles, with confidence and reasons",
    "plot": "plot one register over time, in the terminal or as a picture",
    "map": "register maps: list, show, check, import, infer, diff",
    "sniff": "listen to a line and show frames as they arrive; record them with -o",
    "record": "record a line unattended, for days",
    "between": "listen between your own program and its port or gateway; direction is known for certain",
    "tap": "let others listen to a port over the network, with exact byte times",
    "replay": "play a capture at its own pace: on screen, as sniff does, or to a port",
    "twin": "imitate a recorded unit: its answers, delays and registers",
    "ports": "list the serial ports of this machine and their descriptions",
    "wireshark": "add this machine's ports to Wireshark's interfaces",
    "config": "show the saved settings and where each comes from",
    "repair": "repair a recording that was cut off",
    "simulate": "simulate a plausible bus, with faults on request, and write its ground truth",
    "demo": "open the bundled sample capture, or report on it when piped",
    "help": "read the documentation: filters, findings, checks, formats, maps ...",
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
        help="language of the interface, reports, causes, findings and help (default: the system's)",
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
    "export": "no frame, or no frame matches --filter; with --check, there is an error-level finding",
    "convert": "no bytes of the line left to write",
    "report": "no frame; with --check, there is an error-level finding",
    "check": "a rule fails, or the capture holds no frame",
    "certify": "no frame; with --check, the verdict is not pass",
    "document": "no frame",
    "mcp": "with --verify: a citation refers to nothing, or there is none",
    "batch": "a capture cannot be read, or is damaged; the others are in the lake",
    "watch": "with --once: a capture cannot be read, or is damaged; the others are in the lake",
    "registers": "no frame, no response with register values, or with --like no match",
    "map": "traffic contradicts the map, or the capture has no frames or no registers to map",
    "sniff": "no frame arrived, or the tap or the recording lost bytes",
    "record": "bytes of the line were lost",
    "between": "no frame arrived, or the recording lost bytes",
    "replay": "nothing to play: no frames or, with --to, no bytes",
    "twin": "with --client: an answer differs from the recorded one or is missing",
    "repair": "no line data could be recovered",
}
MEANINGS: Final = (
    (DONE, "done; what listens or serves is done when Ctrl-C or a signal ends it"),
    (
        FAILED,
        "the input holds no frame, an assertion fails, a recording lost bytes, or a capture of a batch is damaged",
    ),
    (UNUSABLE, "unusable arguments or input, or a part of the program failed; one line explains why"),
    (INTERRUPTED, "interrupted (Ctrl-C or a signal) before all was done; partial output is kept"),
)
ENDLESS: Final = frozenset({"sniff", "record", "between", "tap", "replay", "twin", "watch"})  # until a signal ends them


def meanings(command: str) -> tuple[tuple[int, str], ...]:
    """The exit statuses of one command, with what each tells."""
    own = {
        DONE: "done, also when ended by Ctrl-C or a signal" if command in ENDLESS else "done",
        FAILED: FAILURES.get(command),
    }
    return tuple((status, meant) for status, words in MEANINGS if (meant := own.get(status, words)) is not None)


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
