"""The slices of one line into rows of a lake: what a batch asks for a line, and what comes of it.

A pure function of its files and of the state that the line had, so it may run anywhere, and twice.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import captures
from captures.chunks import Capture
from captures.errors import CaptureError, os_reason

from ..options import Options
from ..version import RULES, __version__
from . import FleetError, LakeWriteError
from .catalog import HAVE_ROWS
from .datasets import CAPTURES, DATASETS, LakeFiles, NewRows
from .linestate import ChunkDigest, LineState, NotGrownError, behind, resumed
from .plainstate import StateError
from .sources import SourceFile, as_it_is, readable
from .stores import LakeStore, PackMember, fetched

_PIECE: Final = 1 << 20
_SOURCES: Final = "captures"  # the table with a row a source


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """How captures are read: keywords of `captures.open`, options of the analysis, files that declare functions."""

    reading: Mapping[str, Any] = field(default_factory=dict)
    analysis: Options = field(default_factory=Options)
    functions: tuple[str, ...] = ()
    noise: bool = False

    def mark(self) -> str:
        """What tells these options from others: rows made with others are others. Raises FleetError."""
        try:
            functions = [(path, _digest(Path(path))) for path in self.functions]
        except OSError as error:
            raise FleetError(f"{error.filename}: {os_reason(error)}") from error
        told = (sorted(self.reading.items()), self.analysis, functions, self.noise)
        return hashlib.sha256(repr(told).encode()).hexdigest()[:12]


@dataclass(frozen=True, slots=True)
class KeptRows:
    """Files of tables of a line that no changed rule touches: they stay, and the other tables are made anew.

    `slices`: what is known of the captures that they are of, the task's first ones. `tail`: of these files those that
    the next slice replaces.
    """

    files: Mapping[str, Sequence[PackMember]]
    tail: Mapping[str, Sequence[PackMember]]
    slices: tuple[Mapping[str, Any], ...]


@dataclass(frozen=True, slots=True)
class LineTask:
    """The slices of one line to be taken in, after those that `state` remembers."""

    lake: str
    site: str
    line: str
    files: tuple[SourceFile, ...]
    options: BatchOptions
    known: frozenset[str] = frozenset()  # sha256 of captures that the lake has of this site
    state: str | None = None  # name of the file in the lake
    sliced: bool = False  # more of the line may come
    after: int | None = None  # the manifest's entry that this one goes on from
    tail: Mapping[str, Sequence[PackMember]] = field(default_factory=dict)  # of that: stays where `state` is of no use
    tail_frames: int = 0  # in it
    kept: KeptRows | None = None
    grown: Mapping[str, Any] | None = None  # what the manifest says of the first file: `state` remembers its beginning
    anew: LineTask | None = None  # the whole line, should that not be so, or the state be of no use

    @property
    def size(self) -> int:
        """Bytes of its files."""
        return sum(file.size for file in self.files)

    def knowing(self, contents: Collection[str]) -> LineTask:
        """The same once another line of the site has these captures, by their SHA-256."""
        anew = None if self.anew is None else self.anew.knowing(contents)
        return replace(self, known=self.known.union(contents), anew=anew)


@dataclass(frozen=True, slots=True)
class TaskPlace:
    """Where a task writes, and the rows of its lines that `waiting` are to be written together."""

    store: LakeStore
    waiting: list[NewRows] | None


def line_key(site: str, line: str) -> str:
    """A short name of a line, for files."""
    return hashlib.sha256(f"{site}\0{line}".encode()).hexdigest()[:12]


def line_entry(task: LineTask, place: TaskPlace) -> dict[str, Any]:
    _declare(task.options.functions)
    run = _LineRun(task, place)
    if run.unusable is not None and task.anew is not None:
        return _done_anew(task.anew, place, run.unusable)
    try:
        entry = run.entry()
    except NotGrownError:
        if task.anew is not None:
            return line_entry(task.anew, place)
        left = _as_it_was(task)
        entry = _LineRun(replace(task, grown=None, files=task.files[1:]), place, left=left).entry()
    except (CaptureError, FleetError, OSError):
        raise
    except Exception as error:
        if not run.goes_on:
            raise
        return _without_state(task, place, f"the state of the line cannot be used: {type(error).__name__}: {error}")
    if task.kept is not None and any(
        now[key] != then[key]
        for now, then in zip(entry["slices"], task.kept.slices, strict=False)
        for key in ("sha256", "state")
    ):  # a capture is not what it was: nothing of its rows may stay
        return _LineRun(replace(task, kept=None), place).entry()
    return entry


def _without_state(task: LineTask, place: TaskPlace, words: str) -> dict[str, Any]:
    """The same where the analysis breaks on what the state says: only then is it known to be of no use."""
    if task.anew is None:
        return _LineRun(task, place, unusable=words).entry()
    return _done_anew(task.anew, place, words)


def _done_anew(task: LineTask, place: TaskPlace, words: str) -> dict[str, Any]:
    """The whole line, since all its captures are still there; why is told."""
    return line_entry(task, place) | {"trouble": f"{words}: all captures of the line were read again"}


def _as_it_was(task: LineTask) -> dict[str, Any]:
    """What is known of a slice that others took the place of, known by what it is now."""
    return {**(task.grown or {}), **task.files[0].to_json()}


@cache
def _declare(files: tuple[str, ...]) -> None:
    """Functions that plug-ins and these files declare, once a process."""
    from dissectors.functions import load_entry_points, load_file

    load_entry_points()
    for path in files:
        load_file(path)


class _LineRun:
    """A line on its way."""

    def __init__(
        self,
        task: LineTask,
        place: TaskPlace,
        *,
        left: Mapping[str, Any] | None = None,
        unusable: str | None = None,
    ) -> None:
        """`left`: what is known of the task's first file where it is no longer what was taken, and stays as it was.

        `unusable`: why the line's state cannot be used, where that is known.
        """
        self.task = task
        self.store = place.store
        self.state, self.unusable = self._resumed() if unusable is None else (None, unusable)
        self.trouble = self.unusable and f"starts afresh after what the lake already has: {self.unusable}"
        self.goes_on = self.state is not None
        self._before = (self.state.frames + task.tail_frames, self.state.octets) if self.state else (0, 0)
        self.files = LakeFiles(self.store, task.site, task.line, line_key(task.site, task.line), place.waiting)
        self.slices: list[dict[str, Any]] = []
        if left is not None:
            self.slices = [dict(left)]
            words = "has changed since, and older slices of its line are gone: left unchanged"
            self.trouble = "; ".join(each for each in (self.trouble, f"{readable(left['url'])}: {words}") if each)
        self._known = set(task.known)
        self._row: Any = None  # of the newest slice, for `captures`

    def _resumed(self) -> tuple[LineState | None, str | None]:
        """The state to go on from, or why it cannot be used."""
        if self.task.state is None:
            return None, None
        try:
            return resumed(self.store.read(self.task.state)), None
        except (FleetError, OSError) as error:
            return None, f"its state: {os_reason(error)}" if isinstance(error, OSError) else str(error)

    def entry(self) -> dict[str, Any]:
        task, kept = self.task, self.task.kept
        if kept is not None:
            self.files.tables = self.files.tables.difference(kept.files)
        for number, file in enumerate(task.files):
            self._put_row()
            if kept is not None and number == len(kept.slices):
                self.files.tables = frozenset(DATASETS)
            self.slices.append(self._slice(file, task.grown if number == 0 else None))
        if not task.sliced:
            self._put_row()
        done = self.files.close()
        self._put_row()  # of the newest slice: should it grow, another takes its place
        state, settled = None, 0
        if self.state is not None:
            settled = self.state.frames
            if task.sliced:
                state = self._keep(self.state)
            self.state.close(self.files)
        tail = self.files.close()
        if kept is not None:
            done = {table: [*kept.files.get(table, ()), *done.get(table, ())] for table in {*kept.files, *done}}
            if len(task.files) == len(kept.slices):
                tail |= {table: list(files) for table, files in kept.tail.items()}
            else:
                done[_SOURCES] = [*kept.tail.get(_SOURCES, ()), *done.get(_SOURCES, ())]
        if self.goes_on and task.grown is None:
            where = done if task.files else tail
            where[_SOURCES] = [*task.tail.get(_SOURCES, ()), *where.get(_SOURCES, ())]
        if not self.goes_on:  # the tail is all that is known of what stood at the seam
            stays = {table: files for table, files in task.tail.items() if task.grown is None or table != _SOURCES}
            done = {table: [*stays.get(table, ()), *done.get(table, ())] for table in {*stays, *done}}
        frames, octets = (self.state.frames, self.state.octets) if self.state else (0, 0)
        return {
            "site": task.site,
            "line": task.line,
            "version": __version__,
            "rules": dict(RULES),
            "options": task.options.mark(),
            "after": task.after,
            "slices": self.slices,
            "files": done,
            "tail": tail,
            "tail_frames": frames - settled,
            "state": state,
            "trouble": self.trouble,
            "frames": frames - self._before[0],
            "bytes": octets - self._before[1],
        }

    def _keep(self, state: LineState) -> str | None:
        """Write the state down; its name."""
        name = self.store.fresh(f"state/{line_key(self.task.site, self.task.line)}")
        try:
            self.store.write(name, state.kept())
        except StateError as error:  # the rows are none the worse for it
            self.trouble = f"the state of the line cannot be saved: {error}"
            return None
        return name

    def _slice(self, file: SourceFile, grown: Mapping[str, Any] | None) -> dict[str, Any]:
        """Take in one file, whatever it is, or what `grown` does not know of it; what is known of it then.

        Raises LakeWriteError, and NotGrownError where it is another than `grown` tells of.
        """
        about: dict[str, Any] = {**file.to_json(), "sha256": None, "state": "unreadable", "damage": []}
        span, seen, steps = _SliceSpan(), ChunkDigest(), list[str]()
        if grown is not None:
            span, steps = _SliceSpan(grown["bytes"], *grown["span"]), grown["steps"]
            self._known.discard(grown["sha256"])
        capture: Capture | None = None
        try:
            now = as_it_is(file)
            about |= now.to_json()
            if now.trouble is not None:
                raise FleetError(now.trouble)
            with fetched(file.url) as path:
                about["sha256"] = _digest(path)
                if about["sha256"] in self._known:
                    about["state"] = "twice"
                else:
                    capture = _opened(path, self.task.options)
                    for octets, first, last in self._fed(capture, grown, seen):
                        span.add(octets, first, last)
                    about["state"] = "whole"
                    self._known.add(about["sha256"])
            after = as_it_is(file)
            if after != now and after.trouble is None and not (self.task.sliced and after.size > now.size):
                raise FleetError("changed while being read")
        except LakeWriteError:
            raise
        except (CaptureError, FleetError, OSError) as error:
            about["damage"] = [_without(os_reason(error) if isinstance(error, OSError) else str(error), file)]
            about["state"] = "damaged" if span.octets else "unreadable"
            if self.state is not None:
                self.state.broken(self.files)
        if capture is not None:
            steps = steps if self.state is None else [*steps, *self.state.steps]
            about["damage"] += [*steps, *(readable(str(each)) for each in capture.damage)]
            if about["damage"] and about["state"] == "whole":
                about["state"] = "damaged"
        self._tell(about, span, capture)
        about |= {"bytes": span.octets, "span": [span.first, span.last], "steps": steps}
        return about | {"chunks": seen.count, "chunk_digest": seen.text()}

    def _fed(
        self, capture: Capture, grown: Mapping[str, Any] | None, seen: ChunkDigest
    ) -> Iterator[tuple[int, int, int]]:
        if self.state is None:
            self.state = LineState(capture.line, self.task.options.analysis, self.task.options.noise)
        count, digest = (0, "") if grown is None else (grown["chunks"], grown["chunk_digest"])
        return self.state.slice(capture, behind(capture.blocks(), count, digest, seen), self.files)

    def _tell(self, about: dict[str, Any], span: _SliceSpan, capture: Capture | None) -> None:
        """The row of the table `captures`."""
        import pyarrow as pa

        line = None if capture is None else capture.line
        row = {
            "t_ns": span.first or 0,
            "t_last_ns": span.last,
            "source": readable(about["url"]),
            "sha256": about["sha256"],
            "size": about["size"],
            "format": None if capture is None else capture.format,
            "bytes": span.octets,
            **{name: getattr(line, name, None) for name in ("baud", "char_bits", "parity", "tap")},
            "version": __version__,
            "state": about["state"],
            "damage_count": max(len(about["damage"]), 0 if capture is None else capture.damage_count),
            "damage": about["damage"],
        }
        self._row = pa.record_batch([pa.array([row[f.name]], f.type) for f in CAPTURES], schema=CAPTURES)

    def _put_row(self) -> None:
        if self._row is not None:
            self.files.add(_SOURCES, self._row)
            self._row = None


@dataclass(slots=True)
class _SliceSpan:
    """What blocks come to."""

    octets: int = 0
    first: int | None = None
    last: int | None = None

    def add(self, octets: int, first: int, last: int) -> None:
        self.octets += octets
        self.first = first if self.first is None else min(self.first, first)
        self.last = last if self.last is None else max(self.last, last)


def _opened(path: Path, options: BatchOptions) -> Capture:
    from ..paste import judge

    return captures.open(path, judge=judge, **options.reading)


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(_PIECE):
            digest.update(piece)
    return digest.hexdigest()


def _without(text: str, file: SourceFile) -> str:
    """A complaint without the name that it begins with, a temporary file's it may be: the source stands beside it."""
    at = text.find(f"{file.name}: ")
    return readable(text if at < 0 else text[at + len(file.name) + 2 :])


def contents_taken(entry: Mapping[str, Any]) -> list[str]:
    """The captures that an entry has rows of, by their SHA-256."""
    return [one["sha256"] for one in entry["slices"] if one["state"] in HAVE_ROWS]
