"""The manual page, made from the parser: `python -m analyzer.cli.manpage > docs/rtuscope.1`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from textwrap import wrap

from ..version import __version__
from .app import command_line
from .commands import COMMANDS, MEANINGS, load

_FILES = (
    ("~/.config/rtuscope/config.toml", "your settings; `rtuscope config path` prints where they are elsewhere"),
    ("rtuscope.toml", "a project's, in the working folder or above it"),
)
_ENVIRONMENT = (
    ("NO_COLOR", "no colours"),
    ("RTUSCOPE_CONFIG", "a settings file in place of yours; empty: none is read"),
    ("RTUSCOPE_MQTT_PASSWORD", "of the broker of --mqtt"),
    ("RTUSCOPE_DEBUG", "1: where an error came from"),
)


def man_page() -> str:
    """The page, in roff."""
    parser = command_line(COMMANDS)
    lines = [f'.TH RTUSCOPE 1 "{_released()}" "rtuscope {__version__}" "User Commands"', ".SH NAME"]
    lines += _filled(f"rtuscope - {parser.description}")
    lines += [".SH SYNOPSIS", ".B rtuscope", r"\fICOMMAND\fR [\fIOPTION\fR ...]", ".SH COMMANDS"]
    commands = next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    for name, words in COMMANDS.items():
        lines += [".SS " + _roff_text(f"rtuscope {name}"), *_filled(f"{words[0].upper()}{words[1:]}.")]
        lines += _arguments(commands.choices[name])
        lines += [".P", "Example:", ".nf"]
        lines += [rf"\&    {_roff_text(line)}" for line in load(name).EXAMPLE.splitlines()]
        lines += [".fi"]
    exits = tuple((str(status), words) for status, words in MEANINGS)
    for title, entries in (("EXIT STATUS", exits), ("FILES", _FILES), ("ENVIRONMENT", _ENVIRONMENT)):
        lines.append(f".SH {title}")
        for term, words in entries:
            lines += [".TP", f".B {_roff_text(term)}", *_filled(words)]
    told = "rtuscope help, which prints the documentation: formats, filters, checks, findings, causes"
    lines += [".SH SEE ALSO", *_filled(told)]
    return "\n".join(lines) + "\n"


def _arguments(parser: argparse.ArgumentParser, begin: str = "") -> Iterator[str]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, inner in action.choices.items():
                yield from (".TP", rf".B {_roff_text(f'{begin}{name}')}", *_filled(helps.get(name, "")))
                yield from (".RS", *_arguments(inner), ".RE")
        elif action.help not in (None, argparse.SUPPRESS) and action.dest != "help":
            yield from (".TP", _term(action), *_filled((action.help or "").replace("%%", "%")))


def _term(action: argparse.Action) -> str:
    name = action.metavar or (f"{{{','.join(map(str, action.choices))}}}" if action.choices else action.dest.upper())
    value = "" if action.nargs == 0 else rf" \fI{_roff_text(name if isinstance(name, str) else ' '.join(name))}\fR"
    if not action.option_strings:
        return value.strip()
    return ", ".join(rf"\fB{_roff_text(flag)}\fR" for flag in action.option_strings) + value


def _released() -> str:
    """The day of this version."""
    head = f"## {__version__} - "
    changes = (Path(__file__).parents[2] / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    return next((line.removeprefix(head) for line in changes if line.startswith(head)), "")


def _filled(text: str) -> list[str]:
    """Lines of text, short enough for editors: roff fills them again."""
    lines = wrap(_roff_text(text), 78, break_long_words=False, break_on_hyphens=False)
    return [rf"\&{line}" if line[:1] in (".", "'") else line for line in lines]


def _roff_text(text: str) -> str:
    """A line of text as roff takes it."""
    escaped = text.replace("\\", r"\e").replace("-", r"\-").replace("\n", " ")
    return rf"\&{escaped}" if escaped[:1] in (".", "'") else escaped


if __name__ == "__main__":
    print(man_page(), end="")
