"""`rtuscope completion`: the script that lets a shell complete commands and options, and what it completes besides.

Ports, fields of filters, rules, maps, pages.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, Final

from ..terminal_text import trusted

EXAMPLE = "rtuscope completion bash"

WHERE = """\
bash        rtuscope completion bash > ~/.local/share/bash-completion/completions/rtuscope
zsh         rtuscope completion zsh > _rtuscope   (in a folder of $fpath)
fish        rtuscope completion fish > ~/.config/fish/completions/rtuscope.fish
powershell  rtuscope completion powershell >> $PROFILE
"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.description = f"{parser.description}\n\nwhere it goes:\n" + "".join(
        f"  {line}\n" for line in WHERE.splitlines()
    )
    parser.add_argument("shell", choices=("bash", "zsh", "fish", "powershell"), help="the shell")


def run(arguments: argparse.Namespace) -> int:
    """Print it."""
    from argcomplete.shell_integration import shellcode

    sys.stdout.write(trusted(shellcode(["rtuscope"], shell=arguments.shell)))  # with tabs
    return 0


def complete_arguments(parser: argparse.ArgumentParser) -> None:
    """Give the arguments of a parser and of its actions what completes them."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                complete_arguments(inner)
        elif action.choices is None and (words := _WORDS.get(action.dest)) is not None and action.type is None:
            setattr(action, "completer", _completer(words))  # noqa: B010 - argcomplete's, argparse knows of none


def _completer(words: Callable[[str], Iterable[str]]) -> Callable[..., list[str]]:
    def completer(prefix: str, **_: Any) -> list[str]:
        return [word for word in words(prefix) if word.startswith(prefix)]

    return completer


def _ports(_: str) -> Iterable[str]:
    from captures.errors import CaptureError
    from captures.live.ports import ports

    listed = []
    with suppress(CaptureError):
        listed = ports()
    return [
        *(port.device for port in listed),
        *(port.link for port in listed if port.link),
        "socket://",
        "rfc2217://",
        "tap://",
    ]


def _filter(text: str) -> Iterable[str]:
    from ..filters.completion import complete

    return [text[: each.start] + each.text for each in complete(text, len(text))]


def _rules(_: str) -> Iterable[str]:
    from ..checks.model import forms

    return [example for form in forms() for example in form.examples]


def _maps(prefix: str) -> Iterable[str]:
    from argcomplete.completers import FilesCompleter

    from dissectors.maps import shipped_names

    return [*shipped_names(), *FilesCompleter(("csv", "yaml", "yml"))(prefix)]


def _pages(_: str) -> Iterable[str]:
    from .commands import pages

    return pages()


_WORDS: Final[dict[str, Callable[[str], Iterable[str]]]] = {
    "port": _ports,
    "port2": _ports,
    "to": _ports,
    "filter": _filter,
    "until": _filter,
    "trigger": _filter,
    "around": _filter,
    "rule": _rules,
    "map": _maps,
    "topic": _pages,
}
