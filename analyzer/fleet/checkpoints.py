"""What a manifest comes to as one file of the lake, so that a batch or a question need not read all entries.

A checkpoint `checkpoint/NUMBER-RUN-COUNT.db` holds the catalog of the entries up to that number: a line of JSON about
it, and the tables, compressed. It can be made of the entries again, and counts only where they are still those that it
was made of, by their names, sizes and times, and where its content has the SHA-256 that its head says. Anything else is
no checkpoint, and the entries are read. An entry of the manifest names it, so that it can be taken away once another
takes its place.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

from . import FleetError
from .catalog import PORTABLE, SCHEMA, Catalog
from .stores import LakeStore

FOLDER: Final = "checkpoint"
NEW_ENTRIES: Final = 32  # at least, since the one before
NEW_SHARE: Final = 8  # and so much of all entries: what is written goes by what is new
_EXPANDED: Final = 100  # times as large as it is compressed: what says more is no checkpoint
_ABOUT: Final = {
    "format": "rtuscope-checkpoint",
    "version": 1,  # another where `Catalog.take` makes something else of entries
    "schema": hashlib.sha256(SCHEMA.encode()).hexdigest()[:12],
}

Entries = Mapping[int, tuple[str, str]]  # name and stamp of each, by its number


def newest_checkpoint(store: LakeStore, there: Entries) -> tuple[Catalog, int] | None:
    """The catalog of as many of these entries as one holds, and the last one's number; None where none fits."""
    for name in reversed(store.names(FOLDER)) if PORTABLE else ():
        with suppress(FleetError, OSError, ValueError, KeyError, TypeError, UnicodeError):
            return _read(store, name, there)
    return None


def write_checkpoint(store: LakeStore, catalog: Catalog, there: Entries) -> str:
    """Put down what these entries come to; the name of the file. Raises FleetError."""
    import pyarrow as pa

    if not PORTABLE:
        raise FleetError("this Python's SQLite does not give its tables away")
    newest, data = max(there), catalog.to_bytes()
    packed = pa.compress(data, codec="zstd", asbytes=True)
    about = _about(there, newest) | {"size": len(data), "sha256": hashlib.sha256(packed).hexdigest()}
    name = store.fresh(f"{FOLDER}/{newest:08d}", ".db")
    store.write(name, json.dumps(about).encode() + b"\n" + packed)
    return name


def _read(store: LakeStore, name: str, there: Entries) -> tuple[Catalog, int]:
    import pyarrow as pa

    head, _, packed = store.read(name).partition(b"\n")
    about = json.loads(head)
    newest, size = int(about["newest"]), int(about["size"])
    told = {key: value for key, value in about.items() if key not in ("size", "sha256")}
    if told != _about(there, newest) or size > _EXPANDED * len(packed):
        raise ValueError("of other entries, or of another version")
    if about["sha256"] != hashlib.sha256(packed).hexdigest():
        raise ValueError("damaged")
    data = pa.decompress(packed, decompressed_size=size, codec="zstd", asbytes=True)
    return Catalog.of_bytes(store.root, data), newest


def _about(there: Entries, newest: int) -> dict[str, Any]:
    """What entries a checkpoint is of."""
    listed = "\n".join([f"{number} {stamp}" for number, (_, stamp) in sorted(there.items()) if number <= newest])
    return {
        **_ABOUT,
        "newest": newest,
        "entries": hashlib.sha256(listed.encode("utf-8", "surrogateescape")).hexdigest(),
    }
