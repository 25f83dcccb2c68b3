"""An entry of a lake's manifest as it is on the disk: which files are entries, and whether one is whole.

A lake comes from anywhere, and disks fail: what an entry does not say, or says of a file outside of the lake, is told
in one line, and nothing is read or taken away by it.
"""

from __future__ import annotations

import gc
import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Final

import orjson

from captures.errors import os_reason

from . import FleetError
from .stores import LakeStore

FOLDER: Final = "manifest"
_ENDING: Final = ".json"
_OUTSIDE: Final = ("//", "/./", "/../", "\\", "\0")  # in no name below a lake, with a slash on each side
_Check = Callable[[Any], bool]


def entries_there(store: LakeStore) -> Iterator[tuple[int, tuple[str, str]]]:
    """The number of each entry, with its name and its stamp, in order; other files there are none."""
    for name, stamp in store.stamps(FOLDER):
        stem = name.removeprefix(f"{FOLDER}/").removesuffix(_ENDING)
        if name.endswith(_ENDING) and stem.isascii() and stem.isdecimal():
            yield int(stem), (name, stamp)


def read_entry(store: LakeStore, name: str) -> dict[str, Any]:
    """An entry, of which all is there and of its kind. Raises FleetError."""
    try:
        entry = _parsed(store.read(name))
    except OSError as error:
        raise FleetError(f"{store.url(name)}: {os_reason(error)}") from error
    except (ValueError, RecursionError):
        entry = None
    check = _PACKING if isinstance(entry, dict) and "packs" in entry else _TASK
    if not isinstance(entry, dict) or not check(entry) or not in_lake(_listed_in(entry)):
        raise FleetError(f"{store.url(name)}: is damaged or not an entry of a lake's manifest")
    return entry


@contextmanager
def reading_many() -> Iterator[None]:
    """While many entries are read nothing is looked for that could be freed: it would be done again and again."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()


def _parsed(data: bytes) -> Any:
    try:
        return orjson.loads(data)
    except orjson.JSONDecodeError:
        return json.loads(data)  # which reads names of files that are no UTF-8, too


def lines_in(entry: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    """What an entry says of each line that it is of."""
    return entry.get("lines", ()) if "packs" in entry else (entry,)


def _listed_in(entry: Mapping[str, Any]) -> set[str]:
    """The files that an entry names."""
    listed = {pack["name"] for pack in entry.get("packs", ())} | {*filter(None, (entry.get("checkpoint"),))}
    for line in lines_in(entry):
        for files in (*line["files"].values(), *line["tail"].values()):
            listed.update([name for name, _ in files])
        if line["state"]:
            listed.add(line["state"])
    return listed


def in_lake(names: Collection[str]) -> bool:
    """Whether they can only be files below the lake."""
    joined = f"/{'/'.join(names)}/"
    return not names or not any(each in joined for each in _OUTSIDE)


def _of(*kinds: type) -> _Check:
    return lambda value: type(value) in kinds


def _list(check: _Check) -> _Check:
    return lambda value: isinstance(value, list) and all(map(check, value))


def _form(form: Mapping[str, _Check]) -> _Check:
    """Whether what must be there is, and what is there is of its kind; `?` marks what entries of before lack."""
    checks = [(key.rstrip("?"), check) for key, check in form.items()]
    needed = {key for key in form if not key.endswith("?")}

    def fits(value: Any) -> bool:
        if not isinstance(value, dict) or not needed <= value.keys():
            return False
        return all(check(value[key]) for key, check in checks if key in value)

    return fits


def _optional(check: _Check) -> _Check:
    return lambda value: value is None or check(value)


def _members(value: Any) -> bool:
    """Names of files, each with how many rows; many of them."""
    if type(value) is not list or not ({*map(type, value)} <= {list} and {*map(len, value)} <= {2}):
        return False
    names, rows = zip(*value, strict=True) if value else ((), ())
    return {*map(type, names)} <= {str} and {*map(type, rows)} <= {int} and min(rows, default=0) >= 0


def _tables(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_members, value.values()))


def _count(value: Any) -> bool:
    return type(value) is int and value >= 0


def _span(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_optional_number, value))


_text: Final = _of(str)
_optional_number: Final = _of(int, type(None))
_SLICE: Final = _form(
    {
        "url": _text,
        "size": _count,
        "stamp": _text,
        "sha256": _optional(_text),
        "state": _text,
        "damage": _list(_text),
        "bytes": _count,
        "span": _span,
        "steps": _list(_text),
        "chunks?": _count,
        "chunk_digest?": _text,
    }
)
_TASK: Final = _form(
    {
        "site": _text,
        "line": _text,
        "version": _text,
        "options": _text,
        "after": _optional(_count),
        "slices": _list(_SLICE),
        "files": _tables,
        "tail": _tables,
        "state": _optional(_text),
        "rules?": lambda value: isinstance(value, dict) and all(map(_count, value.values())),
        "tail_frames?": _count,
        "trouble?": _optional(_text),
    }
)
_PACKING: Final = _form(
    {
        "packs": _list(_form({"table": _text, "name": _text, "members": _members})),
        "lines?": _list(_TASK),
        "checkpoint?": _text,
    }
)
