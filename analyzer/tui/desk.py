"""What all widgets look at: the bus, the user's notes on it, how times are shown, what the user wants in every capture.

The latter are preferences: filters that are kept, with colours; past filters; columns; keys. One small file of the
user's own, written whole or not at all; where it cannot be read it is left alone. Nothing of Textual here.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, tzinfo
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

import captures

from ..failures import FailedPart, Failures, failed_words
from ..filters import check
from ..languages import error_words, retold, tr
from ..model.bus import Bus
from ..model.meanings import Meanings
from ..model.scope import Scope, ScopedFigures
from ..model.table import PIECE
from ..settingfiles import user_folder
from ..settings import COLOURS, SettingsError, read_settings
from ..usernotes import Notes, Place
from ..words import TimeBase, date_and_time, is_clock, seconds, short, time_of_day, unit_word, zone_name

if TYPE_CHECKING:
    from dissectors.maps.model import RegisterMap

    from ..model.selection import Test
    from ..model.source import ViewSource

_VERSION: Final = 1
_LONGEST: Final = 1 << 20  # bytes
_RECENT: Final = 8  # captures listed at the start
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
    recent: list[str] = field(default_factory=list)  # captures that were opened, the newest last
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
            return cls(None, trouble=tr("{file} is not an rtuscope settings file: left unchanged", file=path))

    @classmethod
    def _from(cls, stored: Mapping[str, Any], path: Path) -> Preferences:
        if stored["version"] != _VERSION:
            raise ValueError("of another version")
        filters = [
            KeptFilter(str(each["name"]), str(each["filter"]), _colour(each.get("colour")))
            for each in stored.get("filters", [])
        ]
        keys = {str(name): str(key) for name, key in dict(stored.get("keys", {})).items()}
        past, recent = ([str(text) for text in stored.get(name, [])] for name in ("past", "recent"))
        return cls(path, filters, past, set(stored.get("hidden", [])), keys, recent)

    def used(self, text: str) -> None:
        """A filter was used."""
        self.past = [*(past for past in self.past if past != text), text][-_PAST:]
        self.save()

    def opened(self, capture: Path) -> None:
        """A capture was opened: the start screen lists it."""
        name = str(capture.absolute())
        if self.recent[-1:] != [name]:
            self.recent = [*(one for one in self.recent if one != name), name][-_RECENT:]
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
            "recent": self.recent,
        }
        try:
            self.path.parent.mkdir(0o700, parents=True, exist_ok=True)
            with captures.replacing(self.path, private=True) as out:
                out.write((json.dumps(stored, indent=2, ensure_ascii=False) + "\n").encode(errors="backslashreplace"))
        except (OSError, captures.CaptureError) as error:
            self.path, self.trouble = None, tr("settings last until you quit: {error}", error=error_words(error))


def _colour(name: object) -> str:
    return str(name) if name in COLOURS else ""


_MINUTE_NS: Final = 60 * 10**9
_HOUR_NS: Final = 60 * _MINUTE_NS


def _no_charts(units: Iterable[int]) -> Mapping[int, RegisterMap]:  # noqa: ARG001
    return {}


@dataclass
class ViewState:
    """One source under study."""

    source: ViewSource
    bus: Bus
    notes: Notes = field(default_factory=Notes)
    base: TimeBase = TimeBase.START
    scope: Scope = field(default_factory=Scope)
    narrowed: ScopedFigures | None = None  # what the scope leaves, once it was counted
    wishes: Preferences = field(default_factory=Preferences)
    rules: list[tuple[Test, str]] = field(default_factory=list)  # colours of rows
    paused: bool = False  # what comes is read, but not shown
    failures: Failures = field(default_factory=Failures)  # of what threads work out for views
    ended: str = ""  # why reading ended before the source did
    losses: int = 0  # things that the source told to be lost or broken
    zone: tzinfo = UTC  # of times of day
    charts: Callable[[Iterable[int]], Mapping[int, RegisterMap]] = _no_charts  # the maps of units
    raw: bool = False  # lists show the registers, not what they mean
    meanings: Meanings = field(init=False)
    _reference: tuple[Place, int] | None = None  # and its time

    def __post_init__(self) -> None:
        self.meanings = Meanings(self.bus, lambda: self.notes.types, lambda: self.charts)

    @property
    def figures(self) -> Bus | ScopedFigures:
        """The figures of the rows that the scope leaves; of all until those were counted."""
        return self.narrowed if self.narrowed is not None and self.scope.narrows else self.bus

    def in_scope(
        self, t_ns: NDArray[np.int64], rows: NDArray[np.int64], values: NDArray[np.uint16]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint16]]:
        """Readings, of those rows that the scope leaves."""
        figures = self.figures
        if not isinstance(figures, ScopedFigures):
            return t_ns, rows, values
        inside = np.isin(rows, figures.rows)
        return t_ns[inside], rows[inside], values[inside]

    def answer_means(self, unit: int) -> NDArray[np.float64]:
        """Mean answer times of a unit (ns) over the capture, NaN where there are none; empty if the tap's clock tells
        none."""
        return np.zeros(0) if self.bus.off_ns is None else self.figures.units.means(unit)

    @property
    def failed(self) -> tuple[FailedPart, ...]:
        """Parts that failed: of the analysis, and of what views show."""
        return (*self.bus.failed, *self.failures.parts)

    def failed_words(self) -> str:
        """What failed, in one line; empty where nothing did."""
        return retold(failed_words(self.failed)) if self.failed else ""

    @property
    def is_emptied(self) -> bool:
        """Whether the scope leaves no row at all; False until that was counted."""
        figures = self.figures
        return isinstance(figures, ScopedFigures) and not len(figures.rows)

    @property
    def is_untimed(self) -> bool:
        """Whether rows came, and without times."""
        return bool(self.bus.count) and not self.bus.timed

    @property
    def is_foreign(self) -> bool:
        """Whether all was read and no frame is there: it is no Modbus, or was heard at other settings."""
        return self.bus.whole and not self.bus.frames

    def emptied(self, otherwise: str = "") -> str:
        """Why a view is empty: the scope, or else this."""
        if self.is_foreign and self.source.path is not None:
            return tr("no Modbus frames found; press 0 to see what was captured")
        if not self.scope.narrows or not self.bus.count:
            return tr(otherwise)
        return tr("nothing here matches {scope}; Esc removes it", scope=self.scope_words())

    def tint(self, row: int) -> str:
        """The kind (`paint.INKS`) of the first colour rule that a row passes."""
        number, slot = divmod(row, PIECE)
        return next((kind for test, kind in self.rules if test(self.bus, number, slot, slot + 1)[0]), "")

    def scope_words(self) -> str:
        """What narrows the rows, in words."""
        scope = self.scope
        words = [] if scope.filter is None else [scope.filter.text]
        if scope.span is not None:
            words.append(self.span_words(scope.span))
        return tr(" in ").join(words)

    def span_words(self, span: tuple[int, int]) -> str:
        """`2026-11-21 14:00–16:00 UTC`; on a capture's own clock `10–25 s`."""
        if not self.bus.timed or not is_clock(self.bus.t_first):
            low, high = ((t - self.bus.t_first) / 1e9 for t in span)
            return "–".join(f"{since:.9f}".rstrip("0").rstrip(".") for since in (low, high)) + f" {unit_word('s')}"
        size = 16 if span[1] - span[0] >= _HOUR_NS else 19 if span[1] - span[0] >= _MINUTE_NS else 23
        begin, end = (date_and_time(t, self.zone)[:size] for t in span)
        for zeros in (".000", ":00"):
            if size > 16 and begin.endswith(zeros) and end.endswith(zeros):
                begin, end = begin[: -len(zeros)], end[: -len(zeros)]
        same = 11 if end[:10] == begin[:10] else 5 if end[:4] == begin[:4] else 0
        return f"{begin}–{end[same:]} {zone_name(span[0], self.zone)}"

    def when(self, t_ns: int, exact: bool = False) -> str:
        """A time by itself, as times are shown; `exact`: to the millisecond where it is one of day."""
        if not self.bus.timed:
            return tr("row {number:,}", number=t_ns)
        return (
            date_and_time(t_ns, self.zone)[: 23 if exact else 19]
            if is_clock(self.bus.t_first)
            else f"{seconds(t_ns - self.bus.t_first)} {unit_word('s')}"
        )

    @property
    def notes_by_row(self) -> dict[int, str]:
        """The user's bookmarks and comments, in wire order, of the rows that are there."""
        found = {self.bus.table.row_of_byte(*place): comment for place, comment in self.notes.comments.items()}
        return {row: found[row] for row in sorted(found) if row >= 0}

    def place(self, row: int) -> Place:
        """What a note about a row is kept under."""
        return self.bus.table.value("port", row), self.bus.table.value("start", row)

    def bases(self) -> list[TimeBase]:
        """How times can be shown here."""
        if not self.bus.timed:
            return [TimeBase.START]
        return [
            base
            for base in TimeBase
            if (base is not TimeBase.ABSOLUTE or is_clock(self.bus.t_first))
            and (base is not TimeBase.REFERENCE or self.notes.reference is not None)
        ]

    def next_base(self) -> TimeBase:
        """Show times the next way."""
        bases = self.bases()
        self.base = bases[(bases.index(self.base) + 1) % len(bases)] if self.base in bases else bases[0]
        return self.base

    def time(self, row: int, before: int | None) -> str:
        """When a row began; `before` is the row shown above it."""
        if not self.bus.timed:
            return "-"
        t = self.bus.table.value("t_start_ns", row)
        if self.base is TimeBase.ABSOLUTE:
            return f"{date_and_time(t, self.zone)[5:10]} {time_of_day(t, self.zone)}"
        if self.base is TimeBase.PREVIOUS:
            return short(t - self.bus.table.value("t_start_ns", before)) if before is not None else "-"
        if self.base is TimeBase.REFERENCE:
            return seconds(t - self.reference_ns)
        return seconds(t - self.bus.t_first)

    @property
    def reference_ns(self) -> int:
        """The time that is zero; the start where the user's reference is not there (yet)."""
        place = self.notes.reference
        if place is None:
            return self.bus.t_first
        if self._reference is None or self._reference[0] != place:
            row = self.bus.table.row_of_byte(*place)
            if row < 0:
                return self.bus.t_first
            self._reference = place, self.bus.table.value("t_start_ns", row)
        return self._reference[1]
