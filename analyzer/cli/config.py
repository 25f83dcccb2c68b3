"""`rtuscope config`: the settings that stay, and where each is from; and arguments with them as their defaults.

The command line wins over the settings of files (`analyzer.settings`).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, Final

from ..languages import retold
from ..meant import did_you_mean
from ..settingfiles import user_file
from ..settings import SETTINGS, TABLES, Setting, Settings, SetValue, read_settings
from .commands import DONE, UsageError
from .lineoptions import RateWithFormat
from .terminal import put_json

EXAMPLE = """\
rtuscope config show
rtuscope config path"""

_UNSET: Final = "-"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    actions = parser.add_subparsers(metavar="ACTION", title="actions", dest="action", required=True)
    show = actions.add_parser("show", help="every setting with its value, file and line")
    show.add_argument("--json", action="store_true", help="an object by key")
    actions.add_parser("path", help="the path of your own settings file, even if it does not exist")


def run(arguments: argparse.Namespace) -> int:
    """Do the action. Raises UsageError for a value that no command could use."""
    if arguments.action == "path":
        print(user_file())
        return DONE
    settings = read_settings()
    check_settings(settings)
    if arguments.json:
        put_json({key: _object(value) for key, value in settings.values.items()}, indent=2)
        return DONE
    for file in settings.files:
        print(retold(f"read {file}", "help"))
    if not settings.files:
        print(retold(f"no settings found: neither {user_file()} nor rtuscope.toml here or above", "help"))
    lines = [(s.key, settings.values.get(s.key), s.words) for s in SETTINGS]
    for table, words in TABLES.items():
        entries = settings.table(table)
        lines += [(f"{table}.{name}", value, words) for name, value in entries.items()]
        lines += [] if entries else [(f"{table}.*", None, words)]
    width = max(len(key) for key, *_ in lines)
    for key, value, words in lines:
        if value is None:
            print(f"{key:<{width}}  {_UNSET}  ({retold(words, 'help')})")
        else:
            print(f"{key:<{width}}  {_setting_text(value.value)}  {retold(f'from {value.where}', 'help')}")
    return DONE


def _object(value: SetValue) -> dict[str, Any]:
    return {"value": value.value, "file": value.file, "line": value.line}


def _setting_text(value: Any) -> str:
    return ", ".join(value) if isinstance(value, list) else str(value)


_TAPS: Final = ("sniff", "record", "tap")
_FILTERS: Final = ("filter", "until", "trigger", "around")  # arguments that are filters
_FREE: Final = ("config", "help", "completion")  # commands that settings in disorder must not keep from running


def settled(parser: argparse.ArgumentParser, command: str, arguments: Sequence[str]) -> argparse.Namespace:
    """The arguments, parsed; what is not given is as the settings have it. UsageError, SettingsError."""
    if command in _FREE:
        return parser.parse_args(arguments)
    settings = read_settings()
    usual = _prepare(parser, command, settings)
    parsed = parser.parse_args(arguments)
    for dest, (default, value) in usual.items():
        if getattr(parsed, dest, None) is None:
            setattr(parsed, dest, default if value is None else value)
    if "map" in usual and parsed.map is usual["map"][1]:
        _check_maps(settings)
    for dest in _FILTERS:
        text = getattr(parsed, dest, None)
        if isinstance(text, str) and text.startswith("@"):
            setattr(parsed, dest, _preset(text, settings, getattr(parsed, "map", ())))
    return parsed


def check_settings(settings: Settings) -> None:
    """Raises UsageError, with file and line, for the first value that no command could use."""
    from .commands import add_arguments

    for command in ("sniff", "report"):
        parser = argparse.ArgumentParser()
        add_arguments(parser, command)
        _prepare(parser, command, settings)
    _check_maps(settings)
    maps = _maps(settings)
    for table in ("filters", "colours"):
        for value in settings.table(table).values():
            _check_filter(value, maps)


def _maps(settings: Settings) -> list[str]:
    return [value.value if unit == "all" else f"{value.value}@{unit}" for unit, value in settings.table("maps").items()]


def _check_maps(settings: Settings) -> None:
    from dissectors.maps.files import map_for_unit
    from dissectors.maps.model import MapError

    for value, text in zip(settings.table("maps").values(), _maps(settings), strict=True):
        try:
            map_for_unit(text)
        except MapError as error:
            raise UsageError(f"{value.where}: {value.key}: {error}") from error


def _check_filter(value: SetValue, maps: Sequence[str]) -> None:
    from dissectors.maps.files import unit_maps

    from ..filters.evaluation import check

    if (error := check(str(value.value), charts=unit_maps(maps))) is not None:
        raise UsageError(f"{value.where}: {value.key}: {error}")


def _prepare(parser: argparse.ArgumentParser, command: str, settings: Settings) -> dict[str, tuple[Any, Any]]:
    """Take the defaults away where a setting stands; by argument, the default and what the setting makes of it."""
    usual: dict[str, tuple[Any, Any]] = {}
    chosen = [(s, settings.values[s.key]) for s in SETTINGS if s.key in settings.values]
    for setting, value in chosen:
        for action in parser._actions:
            if action.dest in setting.dests and (not setting.taps or command in _TAPS):
                usual[action.dest] = (action.default, _value(parser, action, setting, value))
                if not action.option_strings:  # PORT
                    action.nargs, action.required = "?", False
                action.default = None
    maps = _maps(settings)
    for action in parser._actions:
        if maps and action.dest == "map" and isinstance(action, argparse._AppendAction):
            usual["map"] = (action.default, maps)
            action.default = None
    return usual


def _value(parser: argparse.ArgumentParser, action: argparse.Action, setting: Setting, value: SetValue) -> Any:
    """What an argument holds that is set so, by the argument's own rules."""
    if setting.key == "theme":
        return value.value == "light"
    if isinstance(value.value, list):
        return value.value
    try:
        converted = parser._get_value(action, str(value.value))
        parser._check_value(action, converted)
    except argparse.ArgumentError as error:
        raise UsageError(f"{value.where}: {setting.key}: {error.message}") from error
    if isinstance(converted, RateWithFormat):
        raise UsageError(
            f"{value.where}: {setting.key}: give only the rate here: parity and bits are separate settings"
        )
    return converted


def _preset(text: str, settings: Settings, maps: Sequence[str]) -> str:
    name, presets = text[1:], settings.table("filters")
    if name not in presets:
        raise UsageError(
            f"no filter @{name} in the settings{did_you_mean(name, presets)} (rtuscope config show lists them)"
        )
    _check_filter(presets[name], maps)
    return str(presets[name].value)
