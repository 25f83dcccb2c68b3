"""The registry of capture formats.

A format is one file in this folder with a `FORMAT`; nothing else names it. Formats of other distributions are asked
first (entry points of the group `rtuscope.captures`, each the `Format` itself): code that runs with the user's rights.
A broken one is named in a warning, and left out. A file is taken for the format whose content it shows without doubt,
then for the one of its suffix, then for the likeliest by content.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ..chunks import Source
from ..errors import CaptureError
from ..files import EXPORTED, is_exported, other_kind

WHOLLY = 1.0  # a `sniff` that no other outweighs
CERTAIN = 0.9  # a `sniff` at or over this outweighs the suffix
SUSPECT = 0.5  # at or over this it casts doubt on a suffix
LIKELY = 0.1  # at or over this it may do without a suffix
ENTRY_POINTS = "rtuscope.captures"
_ANY_DATA = ".dat"  # a suffix that programs give to logs as well as to the raw bytes of a line
_ASCII_MODE = re.compile(rb"[0-9A-F]{0,512}\r?\n?:[0-9A-F]{6}")  # frames of ASCII mode as they stood on the line


@dataclass(frozen=True, slots=True)
class Format:
    """How one kind of file is recognised, read and written.

    `sniff` says from the first 64 KiB how likely this is the format, 0 to 1. `read` opens a file, raising CaptureError
    where it holds nothing that can be used; it is also given those of the keywords of `captures.open` (`tz`, `baud`,
    `parity`, `bits`, `stop`, `polarity`) that its signature has. `write` puts the blocks of a line into an open file
    (it is given file, LineSettings, blocks, whether they are timed, and `notes` where its signature has that); None
    where the format is only read.
    """

    name: str
    suffixes: tuple[str, ...]
    sniff: Callable[[bytes], float]
    read: Callable[..., Source]
    write: Callable[..., None] | None = None
    write_suffixes: tuple[str, ...] | None = None  # of files to write, where not all of `suffixes`
    sniff_last: bool = False  # it is dear: asked only where no other format is sure


@cache
def formats() -> dict[str, Format]:
    """The formats of this package by name."""
    modules = (importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__))
    return {module.FORMAT.name: module.FORMAT for module in modules}


@cache
def foreign_formats() -> dict[str, Format]:
    """The formats that other distributions bring, by name."""
    from importlib.metadata import entry_points  # slow to import, and seldom needed

    formats_by_name: dict[str, Format] = {}
    for entry in entry_points(group=ENTRY_POINTS):
        try:
            loaded = entry.load()
            if not isinstance(loaded, Format):
                raise TypeError("is not a captures.formats.Format")
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            warnings.warn(f"plug-in {entry.name} ({entry.value}) is skipped: {_error_line(error)}", stacklevel=2)
        else:
            formats_by_name[loaded.name] = loaded
    return formats_by_name


def by_name(name: str) -> Format:
    """The format of this name; CaptureError lists the names there are."""
    named = formats().get(name) or foreign_formats().get(name)
    if named is None:
        raise CaptureError(f"no capture format {name!r}: choose from {_listed([*formats(), *foreign_formats()])}")
    return named


@dataclass(frozen=True, slots=True)
class RecognisedFormat:
    """The format of a file, and what is odd about it where content and suffix disagree."""

    format: Format
    doubt: str | None = None


def recognise(head: bytes, suffix: str, name: str) -> RecognisedFormat:
    """The format of a file that begins like this; CaptureError, about `name`, where there is none.

    In this order: content without doubt, the formats of other distributions first; one of theirs by suffix; files that
    are known to be no capture; one of our own by suffix, but for logs named .dat; the likeliest by content.
    """
    suffix = suffix.lower()
    if is_exported(head):  # numbers in columns are a logic analyser's, too
        raise CaptureError(f"{name}: not a capture but {EXPORTED}")
    foreign = _scores(foreign_formats(), head)
    if foreign and max(foreign.values()) >= CERTAIN:
        return _by_content(foreign, suffix)
    if (namesake := _wholly_namesake(head, suffix)) is not None:
        return RecognisedFormat(namesake)
    own = _scores(formats(), head)
    if own and max(own.values()) >= CERTAIN:
        return _by_content(own, suffix)
    if (by_suffix := _of_suffix(foreign, suffix)) is not None:
        return RecognisedFormat(by_suffix)
    likely = max((scores for scores in (foreign, own) if scores), key=lambda scores: max(scores.values()))
    if kind := other_kind(head, log=max(likely.values()) >= LIKELY):
        raise CaptureError(f"{name}: not a capture but {kind}")
    by_suffix = _of_suffix(own, suffix)
    if suffix == _ANY_DATA and max(likely.values()) >= LIKELY and not _ASCII_MODE.match(head):
        return _by_content(likely, suffix)
    if by_suffix is not None and (own[by_suffix] > 0 or max(likely.values()) < LIKELY):
        return RecognisedFormat(by_suffix, _suspicion(by_suffix, own, head))
    if max(likely.values()) >= LIKELY:
        return _by_content(likely, suffix)
    raise CaptureError(
        f"{name}: neither its content nor its suffix {suffix!r} looks like a capture: rename it to .bin if it holds "
        f"raw bytes of a line, .txt if it is a log (formats: {_listed(list(formats()))})"
    )


def claimed(head: bytes, suffix: str, chosen: Format | None) -> bool:
    """Whether this format, or where none is chosen any, knows a file that begins like this for its own."""
    if chosen is not None:
        return _scores({chosen.name: chosen}, head)[chosen] >= LIKELY
    return _wholly_namesake(head, suffix) is not None or any(
        score >= CERTAIN
        for registered in (foreign_formats(), formats())
        for score in _scores(registered, head).values()
    )


def likely(name: str, head: bytes) -> bool:
    """Whether a file of this name that begins like this may be a capture."""
    try:
        return bool(head) and recognise(head, Path(name).suffix, name) is not None
    except CaptureError:
        return False


def for_writing(path: Path) -> Format:
    """The format that this name's suffix asks for; CaptureError lists the suffixes that can be written."""
    for registry in (formats, foreign_formats):
        for candidate in registry().values():
            if path.suffix.lower() in _written(candidate):
                return candidate
    raise CaptureError(f"{path}: no format writes the suffix {path.suffix!r}: use {_listed(written_suffixes())}")


def written_suffixes() -> list[str]:
    """The suffixes of files that the formats of this package write."""
    return [suffix for candidate in formats().values() for suffix in _written(candidate)]


def _written(format: Format) -> tuple[str, ...]:
    """The suffixes of files of a format that are written."""
    if format.write is None:
        return ()
    return format.suffixes if format.write_suffixes is None else format.write_suffixes


@cache
def _namesake(suffix: str) -> Format | None:
    """The format whose file in this folder is named as its suffix: alone it is loaded some 80 ms sooner than all."""
    if suffix[1:] not in {module.name for module in pkgutil.iter_modules(__path__)}:
        return None
    format: Format = importlib.import_module(f"{__name__}.{suffix[1:]}").FORMAT
    return format if suffix in format.suffixes else None


def _wholly_namesake(head: bytes, suffix: str) -> Format | None:
    """The same where the content is wholly its own."""
    namesake = _namesake(suffix.lower())
    return namesake if namesake is not None and _score(namesake, head) >= WHOLLY else None


def _scores(known: dict[str, Format], head: bytes) -> dict[Format, float]:
    scores = {candidate: _score(candidate, head) for candidate in known.values() if not candidate.sniff_last}
    sure = max(scores.values(), default=0.0) >= CERTAIN
    last = {candidate: 0.0 if sure else _score(candidate, head) for candidate in known.values() if candidate.sniff_last}
    return scores | last


def _of_suffix(scores: dict[Format, float], suffix: str) -> Format | None:
    """The likeliest of those with this suffix; of several that do not know the content, the one that reads the most."""
    named = [candidate for candidate in scores if suffix in candidate.suffixes]
    return max(named, key=lambda candidate: (scores[candidate], candidate.sniff_last), default=None)


def _by_content(scores: dict[Format, float], suffix: str) -> RecognisedFormat:
    best = max(scores, key=lambda candidate: scores[candidate])
    others = [other.name for other in formats().values() if suffix in other.suffixes]
    if suffix in best.suffixes or not others:
        return RecognisedFormat(best)
    return RecognisedFormat(best, f"named {suffix}, but its content is that of {best.name}: read as such")


def _suspicion(chosen: Format, scores: dict[Format, float], head: bytes) -> str | None:
    """What a file may be rather than what its suffix says; ASCII mode in raw bytes is lines of hex, too."""
    best = max(scores, key=lambda candidate: scores[candidate])
    if scores[best] < SUSPECT or scores[chosen] >= LIKELY or head.startswith(b":"):
        return None
    return (
        f"read as {chosen.name} by its suffix, though it looks like {best.name}: --input-format {best.name} reads it so"
    )


def _score(format: Format, head: bytes) -> float:
    try:
        return float(format.sniff(head))
    except Exception as error:
        warnings.warn(f"capture format {format.name} is skipped: {_error_line(error)}", stacklevel=2)
        return 0.0


def _error_line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def _listed(words: list[str]) -> str:
    return ", ".join(sorted(words))
