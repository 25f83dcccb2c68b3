"""What the user adds to a capture: bookmarks, comments and a time reference, in a file beside it.

`bus.mcap` has `bus.mcap.rtuscope.json`. A note belongs to a row's bytes (port and offset), which stay the same however
the capture is analysed. The file is written whole or not at all, with what another window has noted there meanwhile.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

import captures
from captures.files import opened

from .errors import RtuscopeError

_VERSION = 1
_LONGEST = 64 << 20  # bytes
K = TypeVar("K")
Place = tuple[int, int]  # port, offset of the row's first byte
_Kept = tuple[dict[Place, str], Place | None, dict[tuple[int, int, int], str]]  # comments, reference, types


class NotesError(RtuscopeError):
    """A file of notes that cannot be read; the message says which and why."""


@dataclass
class Notes:
    """Notes by place: an empty comment is a mere bookmark. `path` None: kept in memory only."""

    path: Path | None = None
    comments: dict[Place, str] = field(default_factory=dict)
    reference: Place | None = None
    types: dict[tuple[int, int, int], str] = field(default_factory=dict)  # of registers: unit, area, address
    _before: list[tuple[Place, str | None]] = field(default_factory=list, compare=False)  # changed, to undo
    _kept: _Kept = field(default_factory=lambda: ({}, None, {}), compare=False)  # as they stood in the file last

    @classmethod
    def beside(cls, capture: Path | None) -> Notes:
        """The notes of a capture, none where there is no file of them yet; NotesError."""
        if capture is None:
            return cls()
        notes = cls._read(capture.with_name(capture.name + ".rtuscope.json"))
        notes._kept = notes._values
        return notes

    @classmethod
    def _read(cls, path: Path) -> Notes:
        try:
            if not path.exists():
                return cls(path)
            with opened(path) as file:  # no folder, nor a pipe that would be waited for
                text = file.read(_LONGEST + 1)
        except captures.CaptureError as error:
            raise NotesError(str(error)) from error
        except OSError as error:  # such as a name that is too long
            raise NotesError(f"{path}: cannot be read: {error.strerror}") from error
        try:
            if len(text) > _LONGEST:
                raise ValueError("too long")
            document = json.loads(text)
            if document["version"] != _VERSION:
                version = str(document["version"])[:20]
                raise NotesError(f"{path}: notes version {version} is not supported: left unchanged")
            comments = {_note_place(note): str(note.get("comment", "")) for note in document["bookmarks"]}
            reference = document.get("time_reference")
            types = {_register(text): str(words) for text, words in dict(document.get("types", {})).items()}
            return cls(path, comments, None if reference is None else _note_place(reference), types)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise NotesError(f"{path}: holds no notes of this program: left unchanged") from error

    @classmethod
    def of_capture(cls, capture: Path | None) -> Notes:
        """The same, for who only reads them: none where they cannot be read."""
        try:
            return cls.beside(capture)
        except NotesError:
            return cls()

    def toggle(self, place: Place) -> bool:
        """Set a bookmark or take it away, with its comment; whether it is there now."""
        self._before.append((place, self.comments.get(place)))
        if place in self.comments:
            del self.comments[place]
        else:
            self.comments[place] = ""
        self._save()
        return place in self.comments

    def comment(self, place: Place, text: str) -> None:
        """Say something of a row."""
        self._before.append((place, self.comments.get(place)))
        self.comments[place] = text
        self._save()

    def undo(self) -> Place | None:
        """Take back the newest change of a bookmark or comment; its place, None where there is none."""
        if not self._before:
            return None
        place, text = self._before.pop()
        if text is None:
            self.comments.pop(place, None)
        else:
            self.comments[place] = text
        self._save()
        return place

    def refer(self, place: Place | None) -> None:
        """Count times from there; None: no longer."""
        self.reference = place
        self._save()

    def choose_type(self, register: tuple[int, int, int], words: str) -> None:
        """How a register is read from now on; empty: as it is told."""
        self.types.pop(register, None)
        if words:
            self.types[register] = words
        self._save()

    def _save(self) -> None:
        """Raises captures.CaptureError where it cannot be written; the notes stay in memory."""
        if self.path is None:
            return
        self._take_in_others(self.path)
        bookmarks = [
            {"port": port, "start": start, **({"comment": text} if text else {})}
            for (port, start), text in sorted(self.comments.items())
        ]
        document: dict[str, object] = {"version": _VERSION, "bookmarks": bookmarks}
        if self.reference is not None:
            document["time_reference"] = {"port": self.reference[0], "start": self.reference[1]}
        if self.types:
            document["types"] = {":".join(map(str, spot)): words for spot, words in sorted(self.types.items())}
        with captures.replacing(self.path, private=True) as out:
            text = json.dumps(document, indent=2, ensure_ascii=False) + "\n"
            out.write(text.encode(errors="backslashreplace"))  # half a surrogate pair comes out as JSON writes it
        self._kept = self._values

    @property
    def _values(self) -> _Kept:
        return dict(self.comments), self.reference, dict(self.types)

    def _take_in_others(self, path: Path) -> None:
        """What another window has changed in the file since this one read or wrote it; CaptureError."""
        comments, reference, types = self._kept
        try:
            theirs = self._read(path)._values if path.exists() else self._kept
        except NotesError as error:
            raise captures.CaptureError(str(error)) from error
        _take_changes(self.comments, comments, theirs[0])
        _take_changes(self.types, types, theirs[2])
        if theirs[1] != reference == self.reference:
            self.reference = theirs[1]


def _take_changes(mine: dict[K, str], kept: Mapping[K, str], theirs: Mapping[K, str]) -> None:
    """Into `mine` what differs between `kept` and `theirs`, where mine has not changed it, too."""
    changed = {key for key, _ in kept.items() ^ theirs.items()}
    taken = {key for key in changed if mine.get(key) == kept.get(key)}
    for key in taken:
        mine.pop(key, None)
    mine |= {key: theirs[key] for key in taken & theirs.keys()}


def _register(text: str) -> tuple[int, int, int]:
    """A register's unit, area and address; ValueError where none can be."""
    unit, area, address = (int(part) for part in text.split(":"))
    if not (0 <= unit < 256 and 0 <= area < 4 and 0 <= address < 1 << 16):
        raise ValueError("no register is there")
    return unit, area, address


def _note_place(note: dict[str, object]) -> Place:
    """Where a note belongs; ValueError where no row can be."""
    port, start = note["port"], note["start"]
    if not (isinstance(port, int) and isinstance(start, int) and 0 <= port < 256 and 0 <= start < 1 << 63):
        raise ValueError("no row is there")
    return port, start


def marked_rows(notes: Notes, ports: NDArray[np.integer[Any]], starts: NDArray[np.integer[Any]]) -> dict[int, str]:
    """The rows, given by their ports and offsets, that bear a bookmark, with their comments (empty for none)."""
    if not notes.comments:
        return {}
    candidates = np.isin(starts, [start for _, start in notes.comments]).nonzero()[0].tolist()
    comments = {row: notes.comments.get((int(ports[row]), int(starts[row]))) for row in candidates}
    return {row: comment for row, comment in comments.items() if comment is not None}
