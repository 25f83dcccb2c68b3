"""The front door: what a first word that is no command asks for.

A file is opened (a report on a pipe), a port is listened to, bytes are read, from arguments or standard input; words
and options of other tools lead to ours. The result is a command line as it would have been typed in full.
"""

from __future__ import annotations

import os
import re
import stat
import sys
from collections.abc import Sequence
from contextlib import suppress
from itertools import takewhile
from typing import Final

from .commands import COMMANDS, UsageError
from .synonyms import NOUN, OPTIONS, VERBS
from .terminal import full_screen, shell_word

_BYTES: Final = (
    re.compile(  # what is bytes whatever else it may be: pairs of hex, run together, or as source code has them
        r"\s*(?:(?:0x)?[0-9A-Fa-f]{2}(?:[\s,;:\-]+(?:0x)?[0-9A-Fa-f]{2})+"
        r"|(?:0x)?[0-9A-Fa-f]{8,}|:[0-9A-Fa-f]{6,}|(?:\\x[0-9A-Fa-f]{2})+|(?:\[[0-9A-Fa-f]{2}\]\s*)+)[\s,;]*"
    )
)
_WINDOWS_PORT: Final = re.compile(r"(?:\\\\\.\\)?COM\d{1,3}", re.IGNORECASE)
_ADDRESS: Final = re.compile(r"[a-z][a-z0-9+]{1,15}://\S+", re.IGNORECASE)
FILE_NAME: Final = re.compile(r"[/\\]|\.[A-Za-z][A-Za-z0-9]{0,10}(?:\.[gx]z)?$")
_HEAD: Final = 1 << 16  # bytes by which a text is told from a capture
_CAPTURE: Final = '"serial-chunks"'  # in the first line of a capture that is text


def asked(arguments: Sequence[str]) -> list[str] | None:
    """The command line that arguments without a command ask for; None where they ask for nothing known."""
    if not arguments:
        return _of_input([])
    first, rest = arguments[0], list(arguments[1:])
    if first in OPTIONS:
        return _with(OPTIONS[first], rest)
    if first.startswith("-") and first != "-":
        return _of_input(list(arguments))
    if not os.path.lexists(first) and first.casefold() in VERBS:
        return _with(VERBS[first.casefold()], rest)
    return _of_noun(first, rest)


def _with(command: str, rest: list[str]) -> list[str] | None:
    if command == NOUN:
        return asked(rest) if rest else None
    return [command, *rest]


def _of_noun(first: str, rest: list[str]) -> list[str] | None:
    """What a thing asks for: a file, a port, bytes."""
    if first == "-":
        return _of_input(rest)
    if is_port(first):
        return ["sniff", first, *rest]
    if os.path.isdir(first):  # noqa: PTH112 - pathlib takes 4 ms to import
        name = shell_word(first)
        raise UsageError(f"{first}: is a directory: rtuscope batch {name} -o LAKE reads all captures in it")
    if os.path.isfile(first):  # noqa: PTH113
        return [_to_see(rest), first, *rest]
    words = [first, *takewhile(lambda word: not word.startswith("-"), rest)]  # behind an option its value may stand
    if _BYTES.fullmatch(" ".join(words)) or any(character.isspace() for character in first):
        return ["parse", first, *rest]
    if FILE_NAME.search(first):
        raise UsageError(f"{first}: no such file")
    return None


def is_port(word: str) -> bool:
    """Whether a word names something to listen to: a device, a port of Windows, an address."""
    if _ADDRESS.fullmatch(word) or _WINDOWS_PORT.fullmatch(word):
        return True
    if not word.startswith("/dev/"):
        return False
    with suppress(OSError):
        return stat.S_ISCHR(os.stat(word).st_mode)  # noqa: PTH116
    return True  # not there now: `sniff` says so


def _to_see(options: list[str]) -> str:
    """The command that shows a file: the interface on a terminal, but for options that only a report has."""
    if not full_screen():
        return "report"
    return "report" if _unknown_to("open", options) and not _unknown_to("report", options) else "open"


def _unknown_to(command: str, options: list[str]) -> list[str]:
    """The options that a command does not know."""
    if not options:
        return []
    from argparse import ArgumentParser

    from .commands import add_arguments

    parser = ArgumentParser(add_help=False)
    add_arguments(parser, command)
    known = parser._option_string_actions
    return [word for word in options if word.startswith("-") and word.partition("=")[0] not in known]


def _of_input(options: list[str]) -> list[str] | None:
    """What standard input asks for, where it is a pipe or a file that holds something."""
    stream = sys.stdin
    if stream is None or stream.closed or stream.isatty():
        return None
    peek = getattr(getattr(stream, "buffer", None), "peek", None)
    head: bytes = peek(_HEAD)[:_HEAD] if peek is not None else b""
    if not head:
        return None
    return ["report", "-", *options] if _is_capture(head) else ["parse", *options, "-f", "-"]


def _is_capture(head: bytes) -> bool:
    """Whether what begins like this is a capture rather than bytes written out."""
    text = head.decode("latin-1")
    if _BYTES.fullmatch(text):
        return False
    if _CAPTURE in text.partition("\n")[0]:
        return True
    from captures.formats import claimed
    from captures.text import encodings

    return encodings.is_binary(head) or claimed(head, "", None)


def unknown(word: str) -> str:
    """What to do about a first word that is neither a command nor a thing that is known."""
    from ..meant import did_you_mean

    near = did_you_mean(word, COMMANDS)
    why = near[2:] if near else "give a file, a port, bytes, or a command (rtuscope --help lists them)"
    return f"no command {word!r}: {why}"
