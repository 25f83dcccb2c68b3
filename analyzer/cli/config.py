"""`rtuscope config`: the settings that stay, and where each is from."""

from __future__ import annotations

import argparse
from typing import Any, Final

from ..settingfiles import user_file
from ..settings import SETTINGS, TABLES, SetValue, read_settings
from .exits import DONE
from .settling import check_settings
from .terminal import put_json

EXAMPLE = """\
rtuscope config show
rtuscope config path"""

_UNSET: Final = "-"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    actions = parser.add_subparsers(metavar="ACTION", title="actions", dest="action", required=True)
    show = actions.add_parser("show", help="every setting, its value, and the file and line that it is from")
    show.add_argument("--json", action="store_true", help="an object by key")
    actions.add_parser("path", help="the file of your own settings, there or not")


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
        print(f"read {file}")
    if not settings.files:
        print(f"no settings: neither {user_file()} nor rtuscope.toml here or above")
    lines = [(s.key, settings.values.get(s.key), s.words) for s in SETTINGS]
    for table, words in TABLES.items():
        entries = settings.table(table)
        lines += [(f"{table}.{name}", value, words) for name, value in entries.items()]
        lines += [] if entries else [(f"{table}.*", None, words)]
    width = max(len(key) for key, *_ in lines)
    for key, value, words in lines:
        if value is None:
            print(f"{key:<{width}}  {_UNSET}  ({words})")
        else:
            print(f"{key:<{width}}  {_shown(value.value)}  from {value.where}")
    return DONE


def _object(value: SetValue) -> dict[str, Any]:
    return {"value": value.value, "file": value.file, "line": value.line}


def _shown(value: Any) -> str:
    return ", ".join(value) if isinstance(value, list) else str(value)
