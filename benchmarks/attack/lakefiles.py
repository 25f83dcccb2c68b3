"""Lakes and rings whose own files are spoilt: entries of a manifest, lists of rings, files in a lake's folders.

What holds: a damaged one is told in a line or is of no consequence, and no file of anybody else's is gone.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from random import Random
from typing import Final

import captures
from attack.target import LINE, Target, conversation, folder
from captures import Block, Capture, CaptureError, Chunk
from captures.recording.recorder import Recorder
from captures.recording.ring import RingLimits

_MINE: Final = b"a user's own"
_RUN: Final = "0123456789abcdef" * 2
_PLACES: Final = (
    "captures/monday.jsonl",
    "frames/site=a/0123456789ab-0123456789ab.parquet",
    f"frames/site=site/{_RUN[:12]}-{_RUN}-1.parquet",
    "frames/packed/0123456789abcdef0123456789abcdef.parquet",
    "state/0123456789ab-0123456789ab",
    f"scratch/rows-{_RUN}-1.part",
    "scratch/notes.part",
    "manifest/notes.txt",
    "notes.txt",
)


@cache
def _lake() -> Path:
    """A small lake, to be copied."""
    from analyzer.fleet.batch import run_batch
    from analyzer.fleet.linetask import BatchOptions
    from analyzer.fleet.runners import in_this_process
    from analyzer.fleet.sources import found, lines_of
    from analyzer.fleet.stores import store

    source = folder() / "site" / "bus.jsonl"
    source.parent.mkdir()
    captures.write(source, Capture.of(LINE, conversation(Random(1), 6)))
    lake = folder() / "whole"
    run_batch(store(str(lake)), lines_of(found([str(source)])), BatchOptions(), in_this_process)
    return lake


def _entries() -> Sequence[bytes]:
    whole = (_lake() / "manifest" / "00000001.json").read_bytes()
    packing = {"packs": [{"table": "frames", "name": "frames/packed/a.parquet", "members": [["b", 3]]}]}
    return [whole, json.dumps(packing).encode()]


def _spoilt_lake(data: bytes, chance: Random) -> None:
    """The entry of a manifest, and files of a user's in the lake's folders."""
    from analyzer.fleet.account import refuse_unless_lake, remove_waste
    from analyzer.fleet.manifest import Manifest
    from analyzer.fleet.stores import store

    lake = folder() / "lake"
    shutil.rmtree(lake, ignore_errors=True)
    if chance.random() < 0.8:
        (lake / "manifest").mkdir(parents=True)
        for name in ("lake.json", "manifest/00000001.json"):
            (lake / name).write_bytes((_lake() / name).read_bytes())
    mine = []
    for place in chance.sample(_PLACES, chance.randint(1, len(_PLACES))):
        path = lake / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(_MINE)
        mine.append(path)
    entry = lake / "manifest" / f"{chance.choice((1, 1, 2, 3)):08d}.json"
    entry.parent.mkdir(exist_ok=True)
    entry.write_bytes(data)
    listed = _names(data)
    try:
        lake_store = store(str(lake))
        refuse_unless_lake(lake_store)
        manifest = Manifest(lake_store)
        remove_waste(manifest)
        manifest.named()
    finally:
        for path in mine:
            if path.relative_to(lake).as_posix() not in listed:
                assert path.read_bytes() == _MINE, path


def _names(data: bytes) -> str:
    """What the entry itself may name, and so give away."""
    with suppress(ValueError, RecursionError):
        return json.dumps(json.loads(data), ensure_ascii=False)
    return ""


@cache
def _lists() -> Sequence[bytes]:
    place = folder() / "listed"
    place.mkdir()
    _record(place, 4)
    return [(place / "bus.ring").read_bytes()]


def _record(place: Path, count: int) -> None:
    limits = RingLimits(size=1, keep_bytes=3000)
    recorder = Recorder(place / "bus.mcap", LINE, limits=limits, about={"ports": "a"}, tell=lambda _: None)
    for number in range(count):
        recorder.write(Block.from_chunks([Chunk(10**18 + number, bytes([number]) * 50)]))
        recorder._commit()
        recorder._next()
    recorder.close()


def _spoilt_ring(data: bytes, chance: Random) -> None:
    """The list of a ring, with files of a user's named like the ring's."""
    place = folder() / "ring"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    if chance.random() < 0.5:
        _record(place, 2)
    mine = [place / f"bus-2020010{day}T000000.000Z.mcap" for day in range(1, 4)]
    for path in mine:
        path.write_bytes(_MINE)
    names = [path.name.encode() for path in mine]
    data = data.replace(b"NAME", chance.choice(names))
    (place / "bus.ring").write_bytes(data)
    before = set(place.iterdir())
    _record(place, 3)
    assert all(path.read_bytes() == _MINE for path in mine)
    assert before - set(place.iterdir()) <= {path for path in before if path.suffix == ".mcap" and path not in mine}


def lake_targets() -> list[Target]:
    """What this file adds to the campaign."""
    from analyzer.fleet import FleetError

    tokens = (b'"after":', b'"files":', b"null", b"../", b'"packs":', b"[[", b"frames/site=a/x.parquet", b"-1")
    lines = (b'{"file":"NAME"}\n', b'{"ring":"x","ports":"a"}\n', b"\n", b'{"format":"rtuscope-ring","version":1}\n')
    return [
        Target("lake manifest", cache(_entries), _spoilt_lake, (FleetError,), tokens, share=1, seconds=10.0),
        Target("ring list", _lists, _spoilt_ring, (CaptureError,), lines, share=1, seconds=10.0),
    ]
