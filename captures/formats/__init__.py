"""The registry of capture formats.

A format is one file in this folder with a `FORMAT`; nothing else names it. A file is taken for the format whose content
it shows without doubt, then for the one of its suffix, then for the likeliest by content. Where none fits, formats of
other distributions are asked (entry points of the group `rtuscope.captures`, each the `Format` itself).
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import BinaryIO

from captures.chunks import Block, Source
from captures.errors import CaptureError
from captures.files import other_kind, read_head
from captures.line import LineSettings

CERTAIN = 0.9  # a `sniff` at or over this outweighs the suffix
ENTRY_POINTS = "rtuscope.captures"


@dataclass(frozen=True, slots=True)
class Format:
    """How one kind of file is recognised, read and written.

    `sniff` says from the first 64 KiB how likely this is the format, 0 to 1. `read` opens a file, raising CaptureError
    where it holds nothing that can be used. `write` puts blocks into an open file; None where the format is only read.
    """

    name: str
    suffixes: tuple[str, ...]
    sniff: Callable[[bytes], float]
    read: Callable[[Path], Source]
    write: Callable[[BinaryIO, LineSettings, Iterable[Block], bool], None] | None = None


@cache
def formats() -> dict[str, Format]:
    """The formats of this package by name."""
    modules = (importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__))
    return {module.FORMAT.name: module.FORMAT for module in modules}


@cache
def foreign_formats() -> dict[str, Format]:
    """The formats that other distributions bring, by name; one that fails to load is left out."""
    from importlib.metadata import entry_points  # slow to import, and seldom needed

    found: dict[str, Format] = {}
    for entry in entry_points(group=ENTRY_POINTS):
        try:
            loaded = entry.load()
        except Exception:
            continue
        if isinstance(loaded, Format):
            found[loaded.name] = loaded
    return found


def by_name(name: str) -> Format:
    """The format of this name; CaptureError lists the names there are."""
    found = formats().get(name) or foreign_formats().get(name)
    if found is None:
        raise CaptureError(f"no capture format named {name!r}: there are {_listed([*formats(), *foreign_formats()])}")
    return found


def recognise(path: Path) -> Format:
    """The format of an existing file; CaptureError where there is none."""
    head = read_head(path)
    if kind := other_kind(head):
        raise CaptureError(f"{path}: not a capture but {kind}")
    for registry in (formats, foreign_formats):
        known = registry()
        scores = {name: float(known[name].sniff(head)) for name in known}
        likeliest = max(known, key=lambda name: scores[name], default=None)
        if likeliest and scores[likeliest] >= CERTAIN:
            return known[likeliest]
        if (by_suffix := _by_suffix(known, path, scores)) is not None:
            return by_suffix
        if likeliest and scores[likeliest] > 0:
            return known[likeliest]
    raise CaptureError(
        f"{path}: neither its content nor its suffix {path.suffix!r} is that of a capture: name it .bin if it is the "
        f"raw bytes of a line, .txt if it is a log (formats: {_listed(list(formats()))})"
    )


def for_writing(path: Path) -> Format:
    """The format that this name's suffix asks for; CaptureError lists the suffixes that can be written."""
    for registry in (formats, foreign_formats):
        writable = {name: found for name, found in registry().items() if found.write is not None}
        if (found := _by_suffix(writable, path, {})) is not None:
            return found
    suffixes = [suffix for found in formats().values() if found.write for suffix in found.suffixes]
    raise CaptureError(f"{path}: no format to write with suffix {path.suffix!r}: use {_listed(suffixes)}")


def _by_suffix(known: dict[str, Format], path: Path, scores: dict[str, float]) -> Format | None:
    named = [name for name in known if path.suffix.lower() in known[name].suffixes]
    return known[max(named, key=lambda name: scores.get(name, 0.0))] if named else None


def _listed(words: list[str]) -> str:
    return ", ".join(sorted(words))
