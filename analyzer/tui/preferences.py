"""What the user wants in every capture: filters that are kept, with colours; past filters; columns; keys.

One small file of the user's own, written whole or not at all; where it cannot be read it is left alone.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import captures

from ..filters import check
from ..languages import error_words, tr
from ..settingfiles import user_folder
from ..settings import COLOURS, SettingsError, read_settings

_VERSION: Final = 1
_LONGEST: Final = 1 << 20  # bytes
_PAST: Final = 50  # filters


@dataclass(frozen=True, slots=True)
class KeptFilter:
    """A filter with a name; with a colour the rows that pass it have it."""

    name: str
    text: str
    colour: str = ""


@dataclass
class Preferences:
    """`path` None: kept in memory only."""

    path: Path | None = None
    filters: list[KeptFilter] = field(default_factory=list)
    past: list[str] = field(default_factory=list)  # filters that were used, the newest last
    hidden: set[str] = field(default_factory=set)  # columns
    keys: dict[str, str] = field(default_factory=dict)  # by the id of a binding
    presets: list[KeptFilter] = field(default_factory=list)  # of the settings files, colour rules too; not dropped here
    trouble: str = ""  # why they could not be read

    @classmethod
    def of_user(cls) -> Preferences:
        """Those of whoever runs this."""
        own = cls.read(Path(user_folder()) / "interface.json")
        with suppress(SettingsError):  # the command line has told it
            settings = read_settings()
            own.presets = [KeptFilter(name, str(value.value)) for name, value in settings.table("filters").items()]
            for colour, value in settings.table("colours").items():
                if wrong := check(str(value.value)):
                    own.trouble = own.trouble or f"{value.where}: {value.key}: {wrong}"
                else:
                    own.presets.append(KeptFilter(colour, str(value.value), colour))
        return own

    @classmethod
    def read(cls, path: Path) -> Preferences:
        """Those of a file; none where there is no such file."""
        try:
            if not path.is_file() or path.stat().st_size > _LONGEST:
                return cls(path)
            return cls._from(json.loads(path.read_text(encoding="utf-8")), path)
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            return cls(None, trouble=tr("{file} holds no settings of this program: left alone", file=path))

    @classmethod
    def _from(cls, stored: Mapping[str, Any], path: Path) -> Preferences:
        if stored["version"] != _VERSION:
            raise ValueError("of another version")
        filters = [
            KeptFilter(str(each["name"]), str(each["filter"]), _colour(each.get("colour")))
            for each in stored.get("filters", [])
        ]
        keys = {str(name): str(key) for name, key in dict(stored.get("keys", {})).items()}
        return cls(path, filters, [str(text) for text in stored.get("past", [])], set(stored.get("hidden", [])), keys)

    def used(self, text: str) -> None:
        """A filter was used."""
        self.past = [*(past for past in self.past if past != text), text][-_PAST:]
        self.save()

    def keep(self, kept: KeptFilter) -> None:
        """Keep a filter; one of the same name goes."""
        self.filters = [*(each for each in self.filters if each.name != kept.name), kept]
        self.save()

    def drop(self, name: str) -> None:
        """Keep it no longer."""
        self.filters = [each for each in self.filters if each.name != name]
        self.save()

    def save(self) -> None:
        """Write them; what cannot be written lasts until the user leaves."""
        if self.path is None:
            return
        stored = {
            "version": _VERSION,
            "filters": [{"name": f.name, "filter": f.text, "colour": f.colour} for f in self.filters],
            "past": self.past,
            "hidden": sorted(self.hidden),
            "keys": self.keys,
        }
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with captures.replacing(self.path) as out:
                out.write((json.dumps(stored, indent=2, ensure_ascii=False) + "\n").encode(errors="backslashreplace"))
        except (OSError, captures.CaptureError) as error:
            self.path, self.trouble = None, tr("settings last until you quit: {error}", error=error_words(error))


def _colour(name: object) -> str:
    return str(name) if name in COLOURS else ""
