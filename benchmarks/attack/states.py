"""Hostile states of lines: bytes spoilt at random, trees changed at will, archives that say too much of themselves.

What a reader makes of them is a state or an error of one line; while it reads, nothing of the project is called but
the reader itself.
"""

from __future__ import annotations

import io
import json
import struct
import sys
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from random import Random
from types import FrameType
from typing import Any, Final

import numpy as np

from attack.target import LINE, Target, conversation, folder
from captures import Capture, CaptureError, Chunk

_OURS: Final = ("analyzer", "captures", "dissectors")
_READERS: Final = ("analyzer.fleet.plainstate", "analyzer.fleet.linestate", "analyzer.fleet.stateschema")
_WORDS: Final = (
    "os.system", "builtins.eval", "subprocess.Popen", "analyzer.cli.app.main", "dissectors.registry.load_file",
    "analyzer.core.Analyzer", "analyzer.options.Options", "list", "tuple", "dict", "set", "counter", "defaultdict",
    "array", "bytes", "bytearray", "frozenset", "deque", "__class__", "__reduce__", "",
)  # fmt: skip
_BOMB: Final = 40_000_000  # bytes of nothing in an archive, or what a small one says of itself


def _taken(capture: Capture) -> Any:
    """The state of a line that took this capture, in blocks small enough to go on with."""
    from analyzer.core import EvenBlocks
    from analyzer.fleet.datasets import LakeFiles
    from analyzer.fleet.linestate import LineState
    from analyzer.fleet.stores import store
    from analyzer.options import Options

    state = LineState(capture.line, Options(), noise=False)
    state.even = EvenBlocks(64)
    files = LakeFiles(store(str(folder() / "lake")), "site", "line", "x")
    for _ in state.slice(capture, capture.blocks(), files):
        pass
    return state


def made(chance: Random, count: int) -> bytes:
    """A state of a conversation."""
    now, chunks = 0, list[Chunk]()
    for chunk in conversation(chance, count):
        now = max(now, chunk.t_ns) if abs(chunk.t_ns) < 1 << 60 else now
        chunks.append(Chunk(now, chunk.data, chunk.port, chunk.mark, chunk.errors))
    kept: bytes = _taken(Capture.of(LINE, chunks)).kept()
    return kept


@cache
def _seeds() -> Sequence[bytes]:
    return [made(Random(count), count) for count in (1, 8, 60)]


def unpacked(state: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """The tree and the arrays of a state."""
    with np.load(io.BytesIO(state)) as arrays:
        columns = {name: arrays[name] for name in arrays.files}
    return json.loads(columns.pop("tree").tobytes()), columns


def packed(tree: Any, columns: dict[str, Any]) -> bytes:
    """A state that says this."""
    out = io.BytesIO()
    text = json.dumps(tree).encode()
    np.savez_compressed(out, allow_pickle=True, **{"tree": np.frombuffer(text, np.uint8), **columns})
    return out.getvalue()


def _places(word: Any) -> Iterator[tuple[Any, Any]]:
    """All lists and dicts in a tree with each of their keys; one that holds itself once."""
    waiting, seen = [word], set[int]()
    while waiting:
        thing = waiting.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        for key in list(thing) if isinstance(thing, dict) else range(len(thing)):
            yield thing, key
            if isinstance(thing[key], (dict, list)):
                waiting.append(thing[key])


def _other(chance: Random, count: int) -> Any:
    """Something that may stand anywhere."""
    return chance.choice((
        None, True, -1, 0, 1 << 40, -(1 << 70), 10**400, 1e300, float("nan"), float("inf"), "", "x" * 300, [], {},
        [chance.randrange(count + 3)], [chance.randrange(count + 3)], [chance.randrange(count + 3)], [-1], [0, 0],
        [[]], [None], chance.choice(_WORDS), [chance.choice(_WORDS), [[0]]], ["array", "int64", [1 << 40]],
    ))  # fmt: skip


def _changed_tree(chance: Random) -> bytes:
    tree, columns = unpacked(chance.choice(_seeds()))
    for _ in range(chance.choice((1, 1, 2, 5))):
        places = list(_places(tree))
        thing, key = chance.choice(places)
        what = chance.random()
        if what < 0.6:
            thing[key] = _other(chance, len(tree.get("objects") or ()))
        elif what < 0.75:
            other, its = chance.choice(places)
            thing[key] = other[its]
        elif what < 0.9 and isinstance(thing, list):
            del thing[key]
        elif isinstance(thing, dict):
            thing[chance.choice(_WORDS)] = thing.pop(key)
        if not isinstance(tree, dict):
            break
    try:
        return packed(tree, columns)
    except (ValueError, RecursionError):  # one that holds itself
        return b""


def _changed_arrays(chance: Random) -> bytes:
    tree, columns = unpacked(chance.choice(_seeds()))
    name = chance.choice(list(columns))
    column = columns[name]
    columns[name] = chance.choice((
        column[: len(column) // 2], column.astype("U8"), column.reshape(1, -1), np.array([_taken, None], object),
        np.zeros_like(column), column[::-1], column.astype(np.complex128),
        np.frombuffer(chance.randbytes(column.nbytes), column.dtype) if column.dtype != np.bool_ else ~column,
    ))  # fmt: skip
    return packed(tree, columns)


def _odd_archive(chance: Random) -> bytes:
    """A zip of other names, of names twice, of arrays that say that they are huge, of very much nothing."""
    out, (tree, columns) = io.BytesIO(), unpacked(_seeds()[0])
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        what = chance.randrange(5)
        if what == 0:
            archive.writestr("tree.npy", bytes(_BOMB))
        elif what == 1:
            header = f"{{'descr': '<i8', 'fortran_order': False, 'shape': ({chance.choice((1 << 40, 1 << 62))},), }}\n"
            head = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode()
            archive.writestr("int64.npy", head)
            archive.writestr("tree.npy", _npy(np.frombuffer(json.dumps(tree).encode(), np.uint8)))
        elif what == 2:
            archive.writestr(chance.choice(("../../x.npy", "/etc/x", "tree", "x.npy")), b"x")
            archive.writestr("tree.npy", _npy(np.frombuffer(json.dumps(tree).encode(), np.uint8)))
        elif what == 3:
            deep = b"[" * chance.choice((10, 100_000)) + b"{}"
            archive.writestr("tree.npy", _npy(np.frombuffer(deep, np.uint8)))
        else:
            tree["objects"] = [["array", "int64", [len(columns["int64"])]]] * 1000 + tree["objects"]
            return packed(tree, columns)
    return out.getvalue()


def _npy(array: Any) -> bytes:
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def hostile(chance: Random) -> bytes:
    """A state that somebody made to harm."""
    from attack.inputs import spoilt

    makers: tuple[Callable[[Random], bytes], ...] = (_changed_tree,) * 12 + (_changed_arrays,) * 3
    if chance.random() < 0.02:
        return _odd_archive(chance)
    if chance.random() < 0.25:
        return spoilt(chance, _seeds(), (b"\x80\x05", b"cos\nsystem\n", b"PK\x03\x04"))
    return chance.choice(makers)(chance)


@contextmanager
def nothing_called() -> Iterator[None]:
    """AssertionError where a function of the project's runs that does not read states."""
    called: list[str] = []

    def look(frame: FrameType, event: str, _: object) -> None:
        module = frame.f_globals.get("__name__", "")
        if event == "call" and module.split(".")[0] in _OURS and module not in _READERS:
            called.append(f"{module}.{frame.f_code.co_qualname}")

    before = sys.getprofile()
    sys.setprofile(look)
    try:
        yield
    finally:
        sys.setprofile(before)
    assert not called, called[0]


def _take(data: bytes, chance: Random) -> None:
    from analyzer.fleet.linestate import resumed

    with nothing_called():
        state = resumed(data)
    if chance.random() < 0.05:  # one that fits goes into a lake again, or what it says is found to be of no use
        _go_on(state, chance)


def _go_on(state: Any, chance: Random) -> None:
    """A state that fits may still say nonsense: going on with it may end by an error, which a task then tells."""
    from analyzer.fleet.datasets import LakeFiles
    from analyzer.fleet.stores import store

    files = LakeFiles(store(str(folder() / "lake")), "site", "line", "x")
    capture = Capture.of(LINE, [Chunk(1 << 60, chunk.data) for chunk in conversation(chance, 3)])
    try:
        for _ in state.slice(capture, capture.blocks(), files):
            pass
        state.close(files)
    except CaptureError:
        raise
    except Exception:  # as analyzer.fleet.tasks does
        return


def state_targets() -> list[Target]:
    """The one target."""
    from analyzer.fleet import FleetError

    return [Target("states", _seeds, _take, (FleetError,), share=10, seconds=5.0, make=hostile)]
