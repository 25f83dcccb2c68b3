"""Settings that stay: the user's `config.toml` and a project's `rtuscope.toml`, each value with where it stands.

A setting is a default of the command line, which wins; a project's wins over the user's. A project's file is found in
the working folder or above it. A folder is not trusted by being entered: its file cannot name functions, which are
code, nor a port that is not this machine's, nor a map outside of the folder.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from .errors import RtuscopeError
from .meant import did_you_mean
from .settingfiles import PROJECT, found_files, user_file


class SettingsError(RtuscopeError):
    """A settings file that cannot be used: which, what line, what to do."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What may be set: `kind` is what the file holds there, `dests` the arguments that it is a default of."""

    key: str
    kind: type | tuple[type, ...]
    dests: tuple[str, ...]
    words: str
    taps: bool = False  # only of commands that listen: elsewhere the capture says it itself
    personal: bool = False  # not a project's to say


@dataclass(frozen=True, slots=True)
class SetValue:
    """A value of a file."""

    key: str
    value: Any
    file: str
    line: int | None

    @property
    def where(self) -> str:
        return self.file if self.line is None else f"{self.file}, line {self.line}"


_NUMBER: Final = (int, float)
_LOCAL_PORT: Final = re.compile(r"COM\d{1,4}|/dev/(?!.*\.\.)[\w./:+-]+", re.IGNORECASE)  # no host, no file, no `spy://`
SETTINGS: Final = (
    Setting("port", str, ("port",), "the port for sniff, record and tap", taps=True),
    Setting("tz", str, ("tz",), "time zone for timestamps that carry none"),
    Setting("lang", str, ("lang",), "language of messages: en or ru"),
    Setting("theme", str, ("light",), "light or dark"),
    Setting("functions", list, ("functions",), "files that declare vendor functions", personal=True),
    Setting("line.baud", (int, str), ("baud",), "bit/s of a tap, or auto", taps=True),
    Setting("line.parity", str, ("parity",), "parity of a tap: N, E, O or auto", taps=True),
    Setting("line.stop_bits", _NUMBER, ("stop",), "of a tap", taps=True),
    Setting("line.data_bits", int, ("bits",), "of a tap", taps=True),
    Setting("timing.t15_ms", _NUMBER, ("t15_ms",), "longest silence inside a frame"),
    Setting("timing.t35_ms", _NUMBER, ("t35_ms",), "shortest silence between frames"),
    Setting("timing.turnaround_ms", _NUMBER, ("turnaround_ms",), "shortest pause after a broadcast"),
    Setting("timing.idle_ms", _NUMBER, ("idle_ms",), "silence after which the line counts as idle"),
)
_SETTINGS_BY_KEY: Final = {setting.key: setting for setting in SETTINGS}
COLOURS: Final = ("red", "yellow", "green", "blue", "violet")  # that rows may have in the interface
TABLES: Final = {  # whose keys are the user's own, those of `colours` apart
    "maps": 'register maps by unit, or for `all` others: 17 = "meter.csv"',
    "filters": "filters by name, used as --filter @NAME",
    "colours": 'colour rules of the interface: red = "exception or not crc_ok"',
}


@dataclass(frozen=True, slots=True)
class Settings:
    """What the files say, the stronger over the weaker."""

    values: Mapping[str, SetValue]
    files: tuple[str, ...] = ()

    def table(self, name: str) -> dict[str, SetValue]:
        """The entries of one of TABLES."""
        begin = f"{name}."
        return {key.removeprefix(begin): value for key, value in self.values.items() if key.startswith(begin)}


def read_settings() -> Settings:
    """What all files say; SettingsError."""
    values: dict[str, SetValue] = {}
    files = tuple(found_files())
    for file in files:
        for value in _read(file, project=os.path.basename(file) == PROJECT):  # noqa: PTH119
            values[value.key] = value
    return Settings(values, files)


def _read(file: str, *, project: bool) -> Iterator[SetValue]:
    text, content = _parsed(file)
    for key, value in _flat(content):
        at = SetValue(key, value, file, _line_of(text, key))
        table, dot, name = key.partition(".")
        setting = _SETTINGS_BY_KEY.get(key)
        if dot and table in TABLES:
            yield _table_entry(at, table, name, project=project)
        elif setting is None:
            near = did_you_mean(key, [*_SETTINGS_BY_KEY, *TABLES])
            raise SettingsError(f"{at.where}: no setting {key!r}{near} (rtuscope help settings)")
        else:
            yield _checked(at, setting, project=project)


def _parsed(file: str) -> tuple[str, dict[str, Any]]:
    """The text of a file, and what it holds."""
    import tomllib

    try:
        with open(file, encoding="utf-8-sig") as stream:  # noqa: PTH123
            text = stream.read()
        return text, tomllib.loads(text)
    except OSError as error:
        raise SettingsError(f"{file}: {(error.strerror or str(error)).lower()}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{file}: {error}") from error
    except RecursionError as error:
        raise SettingsError(f"{file}: nested too deeply") from error


def _table_entry(at: SetValue, table: str, name: str, *, project: bool) -> SetValue:
    """An entry of one of TABLES."""
    if not isinstance(at.value, str):
        raise SettingsError(f"{at.where}: {at.key} is not text")
    if table == "colours" and name not in COLOURS:
        raise SettingsError(f"{at.where}: no colour {name!r}: {', '.join(COLOURS)}")
    if table != "maps":
        return at
    if project:
        _refuse_outside(at)
    return replace(at, value=_resolved(at.file, at.value))


def _checked(at: SetValue, setting: Setting, *, project: bool) -> SetValue:
    """The value of one of SETTINGS."""
    key, value = at.key, at.value
    if project and setting.personal:
        raise SettingsError(f"{at.where}: {key} are code, so a project's file cannot set them: put them into "
                            f"{user_file()}, or give --{key}")  # fmt: skip
    if not isinstance(value, setting.kind) or isinstance(value, bool):
        raise SettingsError(f"{at.where}: {key} is {value!r}: {setting.words}")
    if key == "theme" and value not in ("light", "dark"):
        raise SettingsError(f"{at.where}: theme is {value!r}: use light or dark")
    if project and key == "port" and not _LOCAL_PORT.fullmatch(str(value)):
        raise SettingsError(f"{at.where}: port {value!r} is not on this machine, so a project's file cannot set "
                            f"it: put it into {user_file()}, or give it to the command")  # fmt: skip
    return replace(at, value=[_resolved(at.file, str(item)) for item in value]) if isinstance(value, list) else at


def _flat(content: Mapping[str, Any], begin: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in content.items():
        if isinstance(value, dict) and (value or key not in TABLES):
            yield from _flat(value, f"{begin}{key}.") if value else iter([(f"{begin}{key}", value)])
        elif not isinstance(value, dict):
            yield f"{begin}{key}", value


def _line_of(text: str, key: str) -> int | None:
    """The line on which a key stands, as files are usually written."""
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        if head := re.match(r"\s*\[+\s*([^\]]+?)\s*\]", line):
            table = head[1].replace('"', "")
            if table == key:
                return number
            continue
        name = re.match(r"\s*([^=#]+?)\s*=", line)
        if name and ".".join(filter(None, (table, re.sub(r"[\"'\s]", "", name[1])))) == key:
            return number
    return None


def _refuse_outside(at: SetValue) -> None:
    """SettingsError for a map of a project's that lies elsewhere: another machine's, a device, a file of the user's."""
    folder = os.path.dirname(os.path.abspath(at.file))  # noqa: PTH100, PTH120
    path = os.path.join(folder, at.value)  # noqa: PTH118
    named = at.value.startswith(("~", "/", "\\")) or ":" in at.value or ".." in re.split(r"[/\\]", at.value)
    try:
        inside = not named and _is_below(os.path.realpath(path), os.path.realpath(folder))
    except (OSError, ValueError):  # with a NUL
        inside = False
    if not inside:
        raise SettingsError(f"{at.where}: the map {at.value!r} is outside the project's folder, so a project's file "
                            f"cannot set it: put it into {user_file()}, or give --map")  # fmt: skip


def _is_below(path: str, folder: str) -> bool:
    return os.path.commonpath((path, folder)) == folder


def _resolved(file: str, name: str) -> str:
    """A file named in settings, from the folder that they stand in; other names as they are."""
    from pathlib import Path

    try:
        path = Path(file).absolute().parent / Path(name).expanduser()
        return str(path) if path.exists() else name
    except (OSError, ValueError, RuntimeError):  # no name of a file: too long, with a NUL, of a user who is not there
        return name
