"""From arguments to an exit status, with every trouble told in one line.

Exceptions of this project's own packages carry a message for the user; those of the operating system get one here.
Any other is a defect: it is told in one line as well, and RTUSCOPE_DEBUG=1 shows where it came from.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import IO, Any, Final, NoReturn, TextIO

from ..failures import PartFailedWarning, is_for_users
from ..meant import did_you_mean
from ..settingfiles import found_files
from ..terminal_text import gated_streams
from ..version import __version__
from .commands import COMMANDS, DONE, INTERRUPTED, UNUSABLE, Command, UsageError, add_arguments, add_language, meanings
from .synonyms import instead_of
from .terminal import endable, full_screen, tell_user
from .twins import TWINS

_PLACEHOLDER: Final = re.compile("[A-Z][A-Z_]+")
_NO_NUMBER: Final = re.compile("invalid (int|float) value: ('.*')")  # as argparse has it
_ARGUMENTS: Final = re.compile(
    "^argument [^:]+:|(?<=^the following arguments are required: ).+"
)  # as argparse has them
_OWN: Final = frozenset({"-h", "--help", "--version"})  # what is said without a command
_RUSSIAN_OF_WINDOWS: Final = 0x19  # LANG_RUSSIAN of winnt.h
_NAMED: Final = 12  # values of an argument at most that an error lists


def _placeholders(text: str) -> str:
    """Words in capitals that stand for a value, in the language in use."""
    return _PLACEHOLDER.sub(lambda word: _in_language(word[0]), text)


class HelpText(argparse.RawDescriptionHelpFormatter):
    """argparse's help, its own words in the language in use too."""

    def add_usage(self, usage: Any, actions: Any, groups: Any, prefix: str | None = None) -> None:
        super().add_usage(usage, actions, groups, _in_language("usage: ") if prefix is None else prefix)

    def _metavar_formatter(
        self, action: argparse.Action, default_metavar: str | None
    ) -> Callable[[int], tuple[str, ...]]:
        """What stands for a value: its words in capitals, `[HOST:]PORT`; choices are typed as they are."""
        formatted = super()._metavar_formatter(action, default_metavar)  # type: ignore[arg-type]
        if default_metavar is None or (action.choices is not None and action.metavar is None):
            return formatted
        return lambda count: tuple(map(_placeholders, formatted(count)))


class Parser(argparse.ArgumentParser):
    """argparse, but an error is one line, and help has no colours (Python 3.14): the gate would escape them."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **{"formatter_class": HelpText, **settings})
        self.color = False

    def format_help(self) -> str:
        """argparse's, in the language in use."""
        _tell_arguments(self)
        return super().format_help()

    def _print_message(self, message: str, file: Any = None) -> None:
        """argparse's, which would hide that nothing could be written."""
        if message:
            (file or sys.stderr).write(message)

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """argparse's, but an option that is not known is told with the one that was meant."""
        words = list(sys.argv[1:] if args is None else args)
        places = self._get_positional_actions()
        if any(action.dest in ("capture", "captures") for action in places):
            words = [word for word in words if word != "-r"]  # as tshark names the file to read
        scattered = len(places) > 1 and places[-1].nargs == argparse.OPTIONAL  # it may stand behind options
        parse = self.parse_known_intermixed_args if scattered else self.parse_known_args
        parsed, left = parse(words, namespace)
        if left:
            self.unknown(left)
        return parsed

    def knows(self, option: str) -> bool:
        """Whether it is an option of this command."""
        return option in self._option_string_actions

    def unknown(self, left: Sequence[str]) -> NoReturn:
        """Refuse arguments that are none, with the option that was meant."""
        mistyped = left[0].startswith("-")  # another word is one too many
        near = _near_option(left[0].partition("=")[0], self._option_string_actions) if mistyped else ""
        self.error(f"unrecognized arguments: {' '.join(left)}{near}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            near = did_you_mean(str(value), map(str, action.choices))
            choices = list(map(str, action.choices))
            if not near and len(choices) <= _NAMED:  # of more the help that is named beside tells
                near = f" (choose from {', '.join(choices)})"
            raise argparse.ArgumentError(action, f"invalid choice: {value!r}{near}")

    def error(self, message: str) -> NoReturn:
        from ..languages import retold

        message = _NO_NUMBER.sub(lambda no: f"{no[2]} is not a {'whole ' if no[1] == 'int' else ''}number", message)
        if message.endswith(" required: ACTION"):
            actions = (each for each in self._actions if isinstance(each, argparse._SubParsersAction))
            message = f"choose an action: {', '.join(each for found in actions for each in found.choices)}"
        message = _ARGUMENTS.sub(lambda named: _placeholders(named[0]), message)
        raise UsageError(f"{retold(message)} {retold(f'(see {self.prog} --help)')}")


def _near_option(option: str, known: Iterable[str]) -> str:
    """What was meant by an option that is not known: that of another tool, or one mistyped."""
    known = list(known)
    instead = instead_of(option, known)
    if instead is None:
        return did_you_mean(option, known)
    return f": did you mean {_placeholders(instead)}?" if instead.startswith("-") else f": {instead}"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy would start threads for algebra that nothing here does
    _tolerant(sys.stdout)
    _tolerant(sys.stderr)
    failed = list[object]()  # parts of an analysis

    def tell_warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
        failed.extend([message] if issubclass(category, PartFailedWarning) else ())
        tell_user(" ".join(str(message).split()))

    with gated_streams(), warnings.catch_warnings():
        warnings.showwarning = tell_warning
        status = _status_of(list(sys.argv[1:] if argv is None else argv))
        return UNUSABLE if failed and status == DONE else status


def _status_of(arguments: list[str]) -> int:
    """Run a command; every trouble becomes a line and a status."""
    try:
        with endable():
            status = _ended(arguments)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # the reader, such as head, has had enough
        _settle_stdout()
        return DONE
    except Exception as error:
        if os.environ.get("RTUSCOPE_DEBUG"):
            raise
        with suppress(OSError):  # nobody listens on standard error: the status still tells
            tell_user(_error_line(error))
        _settle_stdout()
        return UNUSABLE
    return status


def _ended(arguments: list[str]) -> int:
    """The status of a command that may end the program: --help and --version; or words of a declaration in use."""
    try:
        return _run(arguments)
    except SystemExit as stop:
        if isinstance(stop.code, str):
            tell_user(stop.code)
            return UNUSABLE
        return stop.code or DONE


def _with_settings(parser: argparse.ArgumentParser, arguments: list[str]) -> argparse.Namespace:
    """What was typed, over what settings files say, where there are some; and the language in use from here on."""
    if next(found_files(), None) is None:
        parsed = parser.parse_args(arguments[1:])
    else:
        from .config import settled

        parsed = settled(parser, arguments[0], arguments[1:])
    chosen = getattr(parsed, "lang", None) or os.environ.get("RTUSCOPE_LANG")
    if chosen:
        from ..languages import LANGUAGES, use_language

        if chosen not in LANGUAGES:
            raise UsageError(f"RTUSCOPE_LANG is {chosen!r}: {' or '.join(LANGUAGES)}")
        use_language(chosen)
    return parsed


def _speak(arguments: list[str]) -> None:
    """The language that is asked for, in use before anything is said of the other arguments."""
    chosen = os.environ.get("RTUSCOPE_LANG") or _language_set() or _language_of_system()
    for word, following in zip(arguments, [*arguments[1:], ""], strict=False):
        if word == "--lang" or word.startswith("--lang="):
            chosen = _known_language(word.partition("=")[2] or following) or chosen
    if chosen := _known_language(chosen):
        from ..languages import LETTERS, use_language

        use_language(chosen)
        _carry(LETTERS[chosen], sys.stdout)
        _carry(LETTERS[chosen], sys.stderr)


def _language_of_system() -> str | None:
    """The language in which this user's system speaks, if it is not English."""
    if sys.platform == "win32":
        from ctypes import windll

        primary = windll.kernel32.GetUserDefaultUILanguage() & 0x3FF
        return "ru" if primary == _RUSSIAN_OF_WINDOWS else None
    locale = next(filter(None, map(os.environ.get, ("LC_ALL", "LC_MESSAGES", "LANG"))), "")
    name = locale.partition("_")[0].lower()
    return None if name in ("", "c", "c.utf-8", "en", "posix") else name


def _known_language(name: str | None) -> str | None:
    if not name:
        return None
    from ..languages import LANGUAGES

    return name if name in LANGUAGES else None


def _language_set() -> str | None:
    """The language of the settings, if they can be read: what is wrong with them is told later."""
    if next(found_files(), None) is None:
        return None
    from ..settings import SettingsError, read_settings

    with suppress(SettingsError, OSError):
        setting = read_settings().values.get("lang")
        return None if setting is None else str(setting.value)
    return None


def _languages_before(arguments: list[str]) -> int:
    """How many arguments are `--lang ru` at the beginning."""
    given = 0
    while given < len(arguments) and arguments[given].partition("=")[0] == "--lang":
        given += 1 if "=" in arguments[given] else 2
    return given


def _command_first(arguments: list[str]) -> list[str]:
    """`--lang ru` behind the command that it stands before, where every command takes it."""
    given = _languages_before(arguments)
    return [*arguments[given : given + 1], *arguments[:given], *arguments[given + 1 :]]


def _run(arguments: list[str]) -> int:
    _speak(arguments)
    arguments = _command_first(arguments)
    if "_ARGCOMPLETE" in os.environ:
        import argcomplete

        from .completion import complete_arguments

        parser = command_line(COMMANDS)
        complete_arguments(parser)
        argcomplete.autocomplete(parser)
    if arguments and arguments[0] in COMMANDS:  # the usual way: nothing of other commands is built
        parser = Parser(prog=f"rtuscope {arguments[0]}")
        command = _fill(parser, arguments[0])
        return command.run(_with_settings(parser, arguments))
    if not arguments or arguments[0] not in _OWN:
        return _at_the_door(arguments)
    return _general(arguments)


def _at_the_door(arguments: list[str]) -> int:
    """Run what arguments without a command ask for."""
    from . import door

    if (full := door.asked(arguments)) is not None:
        return _run(full)
    if _languages_before(arguments) >= len(arguments) and full_screen():
        from .start import choose

        command_line(()).parse_args(arguments)  # a language that there is
        return DONE if (chosen := choose()) is None else _run([*chosen, *arguments])
    if arguments and not arguments[0].startswith("-"):
        raise UsageError(door.unknown(arguments[0]))
    return _general(arguments)


def _general(arguments: list[str]) -> int:
    """What is said without a command: help, the version, what is wrong with an option that stands before one."""
    if not _OWN.issuperset(arguments[:1]) and (behind := [word for word in arguments if word in COMMANDS]):
        option = arguments[0].partition("=")[0]
        parser = Parser(prog=f"rtuscope {behind[0]}")
        _fill(parser, behind[0])
        if not parser.knows(option):
            parser.unknown([option])
        raise UsageError(f"{option} goes after the command: rtuscope {behind[0]} {option} ...")
    parser = command_line(())
    parser.parse_args(arguments)
    parser.print_help()
    return DONE


def command_line(filled: Iterable[str]) -> Parser:
    """All commands by name; those in `filled` with their arguments too."""
    parser = Parser(
        prog="rtuscope",
        description=_in_language("Frame parser and serial-capture analyzer for Modbus RTU buses."),
        epilog=f"{_in_language('example:')}\n  rtuscope parse 11 03 00 6B 00 03 76 87\n\n"
        + _in_language("Run `rtuscope COMMAND --help` for options and an example."),
    )
    parser.add_argument("--version", action="version", version=f"rtuscope {__version__}")
    add_language(parser)
    commands = parser.add_subparsers(metavar="COMMAND", title="commands")
    for name, words in COMMANDS.items():
        if name in filled:
            _fill(commands.add_parser(name, help=words), name)
        else:
            commands.add_parser(name, help=words)
    return parser


def _fill(parser: argparse.ArgumentParser, name: str) -> Command:
    """The arguments of a command, and the help of it and of its actions, if it has any."""
    command = add_arguments(parser, name)
    lines = command.EXAMPLE.splitlines()
    _help(parser, name, COMMANDS[name], lines)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for choice in action._choices_actions:
                own = [line for line in lines if line.startswith(f"rtuscope {name} {choice.dest}")]
                _help(action.choices[choice.dest], name, choice.help or "", own)
    return command


def _help(parser: argparse.ArgumentParser, name: str, words: str, lines: list[str]) -> None:
    """What stands around a parser's arguments in its help."""
    words = _in_language(words)
    statuses = [f"  {status:<5}{_in_language(meaning)}\n" for status, meaning in meanings(name)]
    examples = [f"  {line}\n" for line in lines]
    parser.description = f"{words[:1].upper()}{words[1:]}."
    told = [f"{_in_language('exit status:')}\n", *statuses]
    parser.epilog = "".join([*told, *([f"\n{_in_language('example:')}\n", *examples] if examples else [])])


def _tell_arguments(parser: argparse.ArgumentParser) -> None:
    """What arguments say of themselves, and the titles above them, in the language in use."""
    for group in parser._action_groups:
        group.title = group.title and _in_language(group.title)
        group.description = group.description and _in_language(group.description)
    for action in parser._actions:
        action.help = action.help and _in_language(action.help)
        if isinstance(action, argparse._SubParsersAction):
            for choice in action._choices_actions:
                choice.help = choice.help and _in_language(choice.help)


def _in_language(words: str) -> str:
    from ..languages import retold

    return retold(words, "help")


def _error_line(error: Exception) -> str:
    """An exception in one line: what, where, what to do."""
    if is_for_users(error):
        text = str(error)
    elif isinstance(error, OSError):
        where = "standard output" if error.filename is None else error.filename
        text = f"{where}: {(error.strerror or str(error)).lower()}"
    elif isinstance(error, MemoryError):
        text = "not enough memory for this input"
    else:
        text = f"defect: {type(error).__name__}: {error}; please report it (RTUSCOPE_DEBUG=1 shows where)"
    return " ".join(text.split())


def _tolerant(stream: IO[str]) -> None:
    """Characters that the terminal's encoding lacks are written as twins or escapes, and not fatal."""
    reconfigure = getattr(stream, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors=TWINS)


def _carry(letters: str, stream: TextIO) -> None:
    """A file or pipe takes UTF-8 where the machine's code page has no such letters: escapes alone nobody reads."""
    try:
        letters.encode(stream.encoding or "utf-8")
    except UnicodeEncodeError:
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None and not stream.isatty():
            reconfigure(encoding="utf-8")


def _settle_stdout() -> None:
    """What standard output does not take goes nowhere, so that Python's own flush at exit stays quiet."""
    try:
        sys.stdout.flush()
    except OSError:
        with suppress(OSError, ValueError, AttributeError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
