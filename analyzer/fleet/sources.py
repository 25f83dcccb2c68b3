"""Which captures there are: folders, globs and prefixes of object stores; whose site and line each is.

Files of a ring (`captures.recording.ring`) are slices of one line. Which site a capture is from says, in this order:
the option, the pattern of `--site-from` (or, by `--site-from header`, the capture's own header), a folder named
`site=NAME`, else the folder that the capture is in.
"""

from __future__ import annotations

import re
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any, Final

from captures.errors import os_reason

from .errors import FleetError
from .stores import fetched, filesystem, is_remote

_RING: Final = re.compile(r"(?P<line>.+)-\d{8}T\d{6}\.\d{3}Z")
_PACKED: Final = (".gz", ".bz2", ".xz", ".zst", ".zip")
_TRUTH: Final = ".truth.jsonl"  # beside what `simulate` makes
_SITE: Final = "site="
HEADER: Final = "header"  # in place of a pattern, which has a group at least: the site is a note of the capture's own
_GLOB: Final = re.compile(r"[*?\[]")


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A capture's file: where, how large, and what changes when its content does (a time or an entity tag)."""

    url: str
    size: int
    stamp: str

    @property
    def name(self) -> str:
        """Without folders."""
        return PurePosixPath(self.url).name

    def to_json(self) -> dict[str, Any]:
        """As plain values, which make the same again."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class LineFiles:
    """The files of one line, oldest first; `sliced` where more of them may come, as of a ring."""

    site: str
    line: str
    files: tuple[SourceFile, ...]
    sliced: bool


def found(sources: Iterable[str]) -> list[SourceFile]:
    """The files that these name, once each, by name. Raises FleetError where one names nothing."""
    files: dict[str, SourceFile] = {}
    for source in sources:
        here = {file.url: file for file in (_remote(source) if is_remote(source) else _local(source))}
        if not here:
            raise FleetError(f"{source}: no capture there")
        files |= here
    return [files[url] for url in sorted(files)]


def settled(files: Iterable[SourceFile], quiet_s: float) -> list[SourceFile]:
    """Those of this machine that nobody wrote to for so long; in an object store a file is there when it is whole."""
    until_ns = time.time_ns() - round(quiet_s * 1e9)
    return [file for file in files if is_remote(file.url) or int(file.stamp) <= until_ns]


def lines_of(files: Iterable[SourceFile], site: str | None = None, pattern: str | None = None) -> list[LineFiles]:
    """The same by line. `pattern`: a regular expression with a group `site`, and one `line` if need be; or `HEADER`.

    Raises FleetError where the pattern is none, or where two lines would have one name.
    """
    expression = None if pattern is None or pattern == HEADER else _compiled(pattern)
    grouped: dict[tuple[str, str], list[tuple[str, SourceFile, bool]]] = defaultdict(list)
    for file in files:
        named = None if expression is None else expression.search(file.url)
        if expression is not None and named is None:
            raise FleetError(f"{file.url}: --site-from {pattern!r} does not fit it")
        own_site, own_line, sliced = _of(file)
        groups: Mapping[str, str | None] = named.groupdict() if named is not None else {}
        if pattern == HEADER and not site:
            own_site = _header_site(file) or own_site
        whole = groups.get("line")
        key = (site or groups.get("site") or own_site, whole or own_line)
        folder = "" if whole else str(PurePosixPath(file.url).parent)
        grouped[key].append((folder, file, sliced or whole is not None))
    return [_line(*key, members) for key, members in sorted(grouped.items())]


def _header_site(file: SourceFile) -> str | None:
    """The site that a capture's header names (a note `site`); None where it names none, or cannot be read."""
    import captures
    from captures.errors import CaptureError

    try:
        with fetched(file.url) as path:
            return captures.open(path).line.notes.get("site")
    except (CaptureError, FleetError, OSError):
        return None  # the batch says what is the matter with it


def _line(site: str, line: str, members: list[tuple[str, SourceFile, bool]]) -> LineFiles:
    first = members[0]
    other = next((each for each in members if each[0] != first[0]), None)
    if other is not None:
        raise FleetError(f"{first[1].url} and {other[1].url} would both be site {site}, line {line}: use --site-from")
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
        raise FleetError(f"--site-from {pattern!r} is no regular expression: {error}") from error
    if "site" not in expression.groupindex:
        raise FleetError(f"--site-from {pattern!r} has no group (?P<site>...)")
    return expression


def _wanted(name: str) -> bool:
    """Whether a file that nobody named by itself may be a capture, by its name."""
    if name.startswith(".") or name.endswith(_TRUTH):
        return False
    path = PurePosixPath(name.lower())
    return path.suffix in _suffixes() or path.suffix in _PACKED


def _local(source: str) -> Iterator[SourceFile]:
    path = Path(source.removeprefix("file://"))
    try:
        if path.is_dir():
            inside: Iterator[Path] = (each for each in path.rglob("*") if _wanted(each.name) and each.is_file())
        elif _GLOB.search(source) and not path.exists():
            anchor = Path(path.anchor)
            inside = (each for each in anchor.glob(str(path.relative_to(anchor))) if each.is_file())
        else:
            inside = iter([path])
        for each in inside:
            status = each.stat()
            yield SourceFile(each.resolve().as_posix(), status.st_size, str(status.st_mtime_ns))
    except OSError as error:
        raise FleetError(f"{source}: {os_reason(error)}") from error


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
            stamp = about.get("ETag") or about.get("etag") or about.get("md5Hash") or about.get("mtime") or ""
            yield SourceFile(f"{scheme}://{name}", int(about["size"] or 0), str(stamp))
