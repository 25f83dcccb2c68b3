"""Which captures there are: folders, globs and prefixes of object stores; whose site and line each is.

What has a capture's name and is no file that can be read is one as well: with its `trouble`, so that it is told.

Files of a ring (`captures.recording.ring`) are slices of one line. Which site a capture is from says, in this order:
the option, the pattern of `--site-from` (or, by `--site-from header`, the capture's own header), a folder named
`site=NAME`, else the folder that the capture is in.
"""

from __future__ import annotations

import os
import re
import stat
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any, Final

from captures.errors import os_reason

from . import FleetError
from .stores import entity_tag, fetched, filesystem, is_remote

_RING: Final = re.compile(r"(?P<line>.+)-\d{8}T\d{6}\.\d{3}Z")
_PACKED: Final = (".gz", ".bz2", ".xz", ".zst", ".zip")
_TRUTH: Final = ".truth.jsonl"  # beside what `simulate` makes
_SITE: Final = "site="
HEADER: Final = "header"  # in place of a pattern, which has a group at least: the site is a note of the capture's own
_GLOB: Final = re.compile(r"[*?\[]")


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A capture's file: where, how large, and what changes when its content does (a time or an entity tag).

    `trouble`: why it cannot be read, where that was seen without opening it.
    """

    url: str
    size: int
    stamp: str
    trouble: str | None = None

    @property
    def name(self) -> str:
        """Without folders."""
        return PurePosixPath(self.url).name

    def to_json(self) -> dict[str, Any]:
        """As plain values: what it is known by."""
        return {"url": self.url, "size": self.size, "stamp": self.stamp}


@dataclass(frozen=True, slots=True)
class LineFiles:
    """The files of one line, oldest first; `sliced` where more of them may come, as of a ring."""

    site: str
    line: str
    files: tuple[SourceFile, ...]
    sliced: bool


def readable(text: str) -> str:
    """A name as text that may be written anywhere: bytes that are no UTF-8 as `\\xe9`."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def found(sources: Iterable[str], refused: list[str] | None = None) -> list[SourceFile]:
    """The files that these name, once each, by name.

    Folders in them that cannot be looked into are told in `refused`. Raises FleetError where a source names nothing,
    and for such a folder if nobody takes it.
    """

    def refuse(error: OSError) -> None:
        words = f"{error.filename}: {os_reason(error)}"
        if refused is None:
            raise FleetError(words)
        refused.append(words)

    files: dict[str, SourceFile] = {}
    for source in sources:
        here = {file.url: file for file in (_remote(source) if is_remote(source) else _local(source, refuse))}
        if not here and not refused:
            raise FleetError(f"{source}: no captures there")
        files |= here
    return [files[url] for url in sorted(files)]


def settled(files: Iterable[SourceFile], quiet_s: float) -> list[SourceFile]:
    """Those of this machine that nobody wrote to for so long; in an object store a file is there when it is whole."""
    until_ns = time.time_ns() - round(quiet_s * 1e9)
    return [file for file in files if is_remote(file.url) or file.trouble or int(file.stamp) <= until_ns]


def lines_of(
    files: Iterable[SourceFile], site: str | None = None, pattern: str | None = None, refused: list[str] | None = None
) -> list[LineFiles]:
    """The same by line. `pattern`: a regular expression with a group `site`, and one `line` if need be; or `HEADER`.

    What it does not fit, and what would be two lines of one name, is told in `refused` and left out. Raises FleetError
    for that where nobody takes it, and where the pattern is none, or fits nothing.
    """
    expression = None if pattern is None or pattern == HEADER else _compiled(pattern)
    grouped: dict[tuple[str, str], list[tuple[str, SourceFile, bool]]] = defaultdict(list)
    troubles: list[str] = []
    for file in files:
        named = None if expression is None else expression.search(file.url)
        if expression is not None and named is None:
            troubles.append(f"{readable(file.url)}: --site-from {pattern!r} does not match it")
            continue
        own_site, own_line, sliced = _of(file)
        groups: Mapping[str, str | None] = named.groupdict() if named is not None else {}
        if pattern == HEADER and not site:
            own_site = _header_site(file) or own_site
        whole = groups.get("line")
        key = (readable(site or groups.get("site") or own_site), readable(whole or own_line))
        folder = "" if whole else str(PurePosixPath(file.url).parent)
        grouped[key].append((folder, file, sliced or whole is not None))
    lines = []
    for key, members in sorted(grouped.items()):
        line = _line_of_members(*key, members)
        if isinstance(line, LineFiles):
            lines.append(line)
        else:
            troubles.append(line)
    if troubles and (refused is None or not grouped):
        raise FleetError(troubles[0])
    if refused is not None:
        refused += troubles
    return lines


def _header_site(file: SourceFile) -> str | None:
    """The site that a capture's header names (a note `site`); None where it names none, or cannot be read."""
    import captures
    from captures.errors import CaptureError

    if file.trouble:
        return None
    try:
        with fetched(file.url) as path:
            return captures.open(path).line.notes.get("site")
    except (CaptureError, FleetError, OSError):
        return None  # the batch says what is the matter with it


def _line_of_members(site: str, line: str, members: list[tuple[str, SourceFile, bool]]) -> LineFiles | str:
    """A line, or why these files are not one."""
    first = members[0]
    other = next((each for each in members if each[0] != first[0]), None)
    if other is not None:
        both = " and ".join(readable(each[1].url) for each in (first, other))
        return f"{both} would both be site {site}, line {line}: use --site-from"
    files = sorted((file for _, file, _ in members), key=lambda file: file.name)
    return LineFiles(site, line, tuple(files), all(sliced for *_, sliced in members))


def _of(file: SourceFile) -> tuple[str, str, bool]:
    """Site and line as the path says them, and whether it is a slice."""
    path = PurePosixPath(file.url)
    stem = path.name
    while (suffix := PurePosixPath(stem).suffix) and (suffix.lower() in _PACKED or suffix.lower() in _suffixes()):
        stem = stem.removesuffix(suffix)
    ring = _RING.fullmatch(stem)
    line = ring["line"] if ring else path.name
    for depth, part in enumerate(path.parts):
        if part.startswith(_SITE) and part != _SITE:
            return part.removeprefix(_SITE), "/".join([*path.parts[depth + 1 : -1], line]), ring is not None
    return path.parent.name or "site", line, ring is not None


@cache
def _suffixes() -> frozenset[str]:
    from captures.formats import foreign_formats, formats

    every = (*formats().values(), *foreign_formats().values())
    return frozenset(suffix for each in every for suffix in each.suffixes)


def _compiled(pattern: str) -> re.Pattern[str]:
    try:
        expression = re.compile(pattern)
    except re.error as error:
        raise FleetError(f"--site-from {pattern!r} is not a regular expression: {error}") from error
    if "site" not in expression.groupindex:
        raise FleetError(f"--site-from {pattern!r} has no group (?P<site>...)")
    return expression


def _wanted(name: str) -> bool:
    """Whether a file that nobody named by itself may be a capture, by its name."""
    if name.startswith(".") or name.endswith(_TRUTH):
        return False
    path = PurePosixPath(name.lower())
    return path.suffix in _suffixes() or path.suffix in _PACKED


def _local(source: str, refuse: Callable[[OSError], None]) -> Iterator[SourceFile]:
    path, seen = Path(source.removeprefix("file://")), set[tuple[int, int]]()
    try:
        if path.is_dir():
            yield from _inside(path, refuse, seen)
        elif _GLOB.search(source) and not path.exists():
            anchor = Path(path.anchor)
            for each in sorted(anchor.glob(str(path.relative_to(anchor)))):
                yield from _inside(each, refuse, seen) if each.is_dir() else _file(each)
        else:
            path.stat()
            yield from _file(path)
    except OSError as error:
        raise FleetError(f"{source}: {os_reason(error)}") from error


def _inside(folder: Path, refuse: Callable[[OSError], None], seen: set[tuple[int, int]]) -> Iterator[SourceFile]:
    """What of a folder and those below may be captures; links to folders are followed, each folder is `seen` once."""
    for here, folders, names in os.walk(folder, onerror=refuse, followlinks=True):
        place, status = Path(here), Path(here).stat()
        if (status.st_dev, status.st_ino) in seen:
            folders.clear()
            continue
        seen.add((status.st_dev, status.st_ino))
        folders.sort(key=lambda name: ((place / name).is_symlink(), name))
        wanted = [name for name in names if _wanted(name)]
        for name in wanted:
            yield from _file(place / name)
        if place != folder and not (wanted or folders) and _wanted(place.name):
            yield from _file(place)


def as_it_is(file: SourceFile) -> SourceFile:
    """The same as it is now; one of an object store does not change."""
    return file if is_remote(file.url) else next(_file(Path(file.url)), replace(file, trouble="no longer exists"))


def _file(path: Path) -> Iterator[SourceFile]:
    """One, or none where it is gone since it was listed."""
    try:
        status = path.stat()
    except OSError as error:
        if path.is_symlink():
            yield SourceFile(_absolute(path), 0, "", "is a broken link")
        elif not isinstance(error, FileNotFoundError):
            yield SourceFile(_absolute(path), 0, "", os_reason(error))
        return
    if stat.S_ISDIR(status.st_mode):
        yield SourceFile(_absolute(path), 0, "", "is a folder without captures")
    elif not stat.S_ISREG(status.st_mode):
        yield SourceFile(_absolute(path), 0, "", "is a pipe, a socket or a device, not a file")
    elif not os.access(path, os.R_OK):
        yield SourceFile(_absolute(path), status.st_size, "", "permission denied")
    else:
        yield SourceFile(_absolute(path), status.st_size, str(status.st_mtime_ns))


def _absolute(path: Path) -> str:
    """With its links as they are: a capture is of the folder that it was put in."""
    return Path(os.path.abspath(path)).as_posix()  # noqa: PTH100 - `resolve` follows links, `absolute` leaves ".."


def _remote(source: str) -> Iterator[SourceFile]:
    system, path = filesystem(source)
    scheme = source.partition("://")[0]
    system.invalidate_cache()
    try:
        if _GLOB.search(path):
            details, named = system.glob(path, detail=True), True
        else:
            details, named = system.find(path, detail=True), False
    except Exception as error:
        raise FleetError(f"{source}: {' '.join(str(error).split()) or type(error).__name__}") from error
    for name, about in sorted(details.items()):
        if about["type"] == "file" and (named or name == path or _wanted(PurePosixPath(name).name)):
            yield SourceFile(f"{scheme}://{name}", int(about["size"] or 0), entity_tag(about))
