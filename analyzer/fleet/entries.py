"""An entry of a lake's manifest as it is on the disk: which files are entries, and whether one is whole.

A lake comes from anywhere, and disks fail: what an entry does not say, or says of a file outside of the lake, is told
in one line, and nothing is read or taken away by it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, Final

import orjson

from captures.errors import os_reason

from . import FleetError
from .stores import LakeStore

FOLDER: Final = "manifest"
_ENDING: Final = ".json"
_NO_PART: Final = frozenset(("", ".", ".."))  # of a name below a lake
_NO_LETTER: Final = frozenset(("\\", "\0"))
_Check = Callable[[Any], bool]


def entry_names(store: LakeStore) -> Iterator[tuple[int, str]]:
    """The number and the name of each entry, in order; other files there are none."""
    for name in store.names(FOLDER):
        stem = name.removeprefix(f"{FOLDER}/").removesuffix(_ENDING)
        if name.endswith(_ENDING) and stem.isascii() and stem.isdecimal():
            yield int(stem), name


def read_entry(store: LakeStore, name: str) -> dict[str, Any]:
    """An entry, of which all is there and of its kind. Raises FleetError."""
    try:
        entry = _parsed(store.read(name))
    except OSError as error:
        raise FleetError(f"{store.url(name)}: {os_reason(error)}") from error
    except (ValueError, RecursionError):
        entry = None
    check = _PACKING if isinstance(entry, dict) and "packs" in entry else _TASK
    if not check(entry) or not _in_lake(listed_in(entry)):
        raise FleetError(f"{store.url(name)}: is damaged or not an entry of a lake's manifest")
    whole: dict[str, Any] = entry
    return whole


def _parsed(data: bytes) -> Any:
    try:
        return orjson.loads(data)
    except orjson.JSONDecodeError:
        return json.loads(data)  # which reads names of files that are no UTF-8, too


def lines_in(entry: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    """What an entry says of each line that it is of."""
    return entry.get("lines", ()) if "packs" in entry else (entry,)


def listed_in(entry: Mapping[str, Any]) -> set[str]:
    """The files that an entry names."""
    listed = {pack["name"] for pack in entry.get("packs", ())}
    for line in lines_in(entry):
        for files in (*line["files"].values(), *line["tail"].values()):
            listed |= {name for name, _ in files}
        if line["state"]:
            listed.add(line["state"])
    return listed


def _in_lake(names: Collection[str]) -> bool:
    """Whether they can only be files below the lake."""
    joined = "/".join(names)
    return not names or (_NO_PART.isdisjoint(joined.split("/")) and _NO_LETTER.isdisjoint(joined))


def _of(*kinds: type) -> _Check:
    return lambda value: isinstance(value, kinds) and not (isinstance(value, bool) and bool not in kinds)


def _list(check: _Check) -> _Check:
    return lambda value: isinstance(value, list) and all(map(check, value))


def _form(form: Mapping[str, _Check]) -> _Check:
    """Whether what must be there is, and what is there is of its kind; `?` marks what entries of before lack."""
    checks = [(key.rstrip("?"), check, key.endswith("?")) for key, check in form.items()]
    return lambda value: (
        isinstance(value, dict)
        and all(check(value[key]) if key in value else optional for key, check, optional in checks)
    )


def _optional(check: _Check) -> _Check:
    return lambda value: value is None or check(value)


def _file(value: Any) -> bool:
    """A name, and how many rows."""
    return isinstance(value, list) and len(value) == 2 and isinstance(value[0], str) and _count(value[1])


def _tables(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_FILES, value.values()))


def _count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _span(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(each is None or _of(int)(each) for each in value)


_text: Final = _of(str)
_FILES: Final = _list(_file)
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
    {"packs": _list(_form({"table": _text, "name": _text, "members": _FILES})), "lines?": _list(_TASK)}
)
