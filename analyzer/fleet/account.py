"""What of a lake is this program's to take away, and which folder is a lake at all.

A file goes where it has a name that only a lake's files have, where an account names it, and where no link stands on
the way to it. The account is the manifest, whose entries name all files that finished tasks made, and the folder
`account`, in which each run enters itself before its first file: names hold the number of their run. Everything else
stays, and is told. A folder that holds anything and is no lake is refused, and so is a capture inside the lake.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from captures.files import replacing
from captures.locks import LockedElsewhereError, opened_and_locked

from . import FleetError
from .checkpoints import FOLDER as CHECKPOINT
from .datasets import DATASETS
from .entries import entries_there, read_entry
from .manifest import Manifest
from .sources import LineFiles, readable
from .stores import ACCOUNT, SCRATCH, FolderStore, LakeStore, as_fleet_error, is_remote

_FOLDERS: Final = (*DATASETS, "state", CHECKPOINT, SCRATCH)
_MARK: Final = "lake.json"
_MARKED: Final = {"format": "rtuscope-lake", "version": 1}
_LOCK: Final = ".writing"
_TABLE: Final = rf"(?:{'|'.join(DATASETS)})/(?:site=[^/\\\0]+(?:/day=[^/\\\0]+)?|packed)"
_OWN: Final = re.compile(rf"(?:{_TABLE}|state|{CHECKPOINT}|{SCRATCH})/[0-9a-z-]{{12,}}(?:\.[a-z]+)?")
_RUN: Final = re.compile(r"/[0-9a-z]+-(?P<run>[0-9a-f]{32})-\d+(?:\.[a-z]+)?")
_ACCOUNTED: Final = re.compile(rf"{ACCOUNT}/([0-9a-f]{{32}})\.json")
_BEFORE_MARK: Final = re.compile(rf"{re.escape(_LOCK)}|\.{re.escape(_MARK)}\.\w+\.part")  # a kill may leave these alone


def refuse_unless_lake(store: LakeStore) -> None:
    """Raises FleetError for a place that holds something and is no lake: nothing may be written there."""
    there = [name for name in store.top() if not _BEFORE_MARK.fullmatch(name)]
    if there and not _is_lake(store):
        raise FleetError(f"{store.root}: is neither empty nor a lake: give another folder")


def _is_lake(store: LakeStore) -> bool:
    with suppress(FleetError, OSError, ValueError, RecursionError):
        mark = json.loads(store.read(_MARK))
        if isinstance(mark, dict) and mark.items() >= _MARKED.items():
            return True
    first = next(entries_there(store), None)
    return first is not None and bool(read_entry(store, first[1][0]))  # one of before lakes had a mark


def refuse_sources_inside(store: LakeStore, lines: Iterable[LineFiles]) -> None:
    """Raises FleetError for a capture inside the lake."""
    remote = is_remote(store.root)
    for url in (file.url for line in lines for file in line.files):
        if is_remote(url) != remote:
            continue
        place = url if remote else Path(os.path.realpath(url)).as_posix()
        if place.startswith(f"{Path(store.root).as_posix() if not remote else store.root}/"):
            raise FleetError(f"{readable(url)}: is inside the lake: keep captures elsewhere")


@contextmanager
def writing(store: LakeStore) -> Iterator[None]:
    """Only one batch writes a lake at a time, as far as the system can tell. What is empty becomes a lake.

    Raises FleetError where another batch writes it, and where it is none and not empty.
    """
    refuse_unless_lake(store)
    if not isinstance(store, FolderStore):
        if _MARK not in store.top():
            store.write(_MARK, json.dumps(_MARKED).encode())
        yield
        return
    folder = Path(store.root)
    with as_fleet_error(folder):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            descriptor = opened_and_locked(folder / _LOCK)
        except LockedElsewhereError:
            raise FleetError(f"{store.root}: another batch is writing to this lake") from None
    try:
        refuse_unless_lake(store)  # nobody else makes one of it from now on
        if not os.path.lexists(folder / _MARK):
            with replacing(folder / _MARK) as file:
                file.write(json.dumps(_MARKED).encode())
        yield
    finally:
        os.close(descriptor)


def remove_waste(manifest: Manifest) -> list[str]:
    """Take away what killed or repeated tasks left, and what later entries took the place of; what stays, told.

    At the beginning of a batch, so that who reads what the one before replaced has until then.
    """
    store, named = manifest.store, manifest.named()
    runs = {found[1]: name for name in store.names(ACCOUNT) if (found := _ACCOUNTED.fullmatch(name))}
    there = [name for folder in _FOLDERS for name in store.names(folder) if name not in named]
    waste = [name for name in there if _is_own(name, manifest, runs)]
    kept = store.remove(waste)
    manifest.catalog.forget_replaced(kept)
    needed = {run for name in kept if (run := _run_of(name))}
    store.remove(name for run, name in runs.items() if run not in needed)
    told = [f"{readable(store.url(name))}: could not be removed: {reason}" for name, reason in kept.items()]
    if others := sorted({*there} - {*waste}):
        words = f"kept files that were not written by this lake: {len(others):,} (the first: {readable(others[0])})"
        told.append(f"{store.root}: {words}")
    return told


def _is_own(name: str, manifest: Manifest, runs: Iterable[str]) -> bool:
    return _OWN.fullmatch(name) is not None and (_run_of(name) in {*runs} or manifest.catalog.was_named(name))


def _run_of(name: str) -> str | None:
    """The number of the run that a name holds."""
    found = _RUN.search(name)
    return found["run"] if found is not None and found.end() == len(name) else None
