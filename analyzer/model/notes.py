"""What the user adds to a capture: bookmarks, comments and a time reference, in a file beside it.

`bus.mcap` has `bus.mcap.rtuscope.json`. A note belongs to a row's bytes (port and offset), which stay the same however
the capture is analysed. The file is written whole or not at all.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import captures

_VERSION = 1
Place = tuple[int, int]  # port, offset of the row's first byte


class NotesError(Exception):
    """A file of notes that cannot be read; the message says which and why."""


@dataclass
class Notes:
    """Notes by place: an empty comment is a mere bookmark. `path` None: kept in memory only."""

    path: Path | None = None
    comments: dict[Place, str] = field(default_factory=dict)
    reference: Place | None = None

    @classmethod
    def beside(cls, capture: Path | None) -> Notes:
        """The notes of a capture, none where there is no file of them yet; NotesError."""
        if capture is None:
            return cls()
        path = capture.with_name(capture.name + ".rtuscope.json")
        try:
            text = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return cls(path)
        except (OSError, ValueError) as error:
            raise NotesError(f"{path}: cannot be read: {error}") from error
        try:
            known = json.loads(text)
            if known["version"] != _VERSION:
                raise NotesError(f"{path}: version {known['version']} of the notes is not known here: left alone")
            comments = {(int(n["port"]), int(n["start"])): str(n.get("comment", "")) for n in known["bookmarks"]}
            reference = known.get("time_reference")
            return cls(path, comments, None if reference is None else (int(reference["port"]), int(reference["start"])))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise NotesError(f"{path}: holds no notes of this program: left alone") from error

    def toggle(self, place: Place) -> bool:
        """Set a bookmark or take it away, with its comment; whether it is there now."""
        if place in self.comments:
            del self.comments[place]
        else:
            self.comments[place] = ""
        self._save()
        return place in self.comments

    def comment(self, place: Place, text: str) -> None:
        """Say something of a row."""
        self.comments[place] = text
        self._save()

    def refer(self, place: Place | None) -> None:
        """Count times from there; None: no longer."""
        self.reference = place
        self._save()

    def _save(self) -> None:
        """Raises captures.CaptureError where it cannot be written; the notes stay in memory."""
        if self.path is None:
            return
        bookmarks = [
            {"port": port, "start": start, **({"comment": text} if text else {})}
            for (port, start), text in sorted(self.comments.items())
        ]
        whole: dict[str, object] = {"version": _VERSION, "bookmarks": bookmarks}
        if self.reference is not None:
            whole["time_reference"] = {"port": self.reference[0], "start": self.reference[1]}
        with captures.replacing(self.path) as out:
            out.write(json.dumps(whole, indent=2, ensure_ascii=False).encode() + b"\n")
