"""Arrays in plain Python do what numpy's do, as far as pastes need it; and every paste is read alike with both."""

from __future__ import annotations

import json
import operator
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from paste_chats import CHATS
from paste_forums import FORUMS
from paste_issues import ISSUES
from paste_posts import POSTS
from paste_shapes import SHAPES
from paste_tools import DECODERS, TOOLS
from paste_writings import WRITINGS
from pastes import STYLES, messages
from running import ROOT

from analyzer import plainarrays as plain

SHAPES_OF_PASTES = {**STYLES, **SHAPES, **FORUMS, **POSTS, **TOOLS, **DECODERS, **ISSUES, **WRITINGS, **CHATS}
TYPES = ["uint8", "int16", "uint16", "int32", "int64", "bool_"]
CORPUS = ROOT.parent / "shared" / "corpus"
_READ = """
import json, sys
import numpy
from analyzer.reference.page.reading import printed
assert hasattr(numpy, "array"), numpy
told = [printed(text, language) for language, text in json.load(sys.stdin)]
json.dump([numpy.__file__, told], sys.stdout)
"""


def numbers(kind: str) -> st.SearchStrategy[list[int]]:
    low, high = (0, 1) if kind == "bool_" else (np.iinfo(kind).min, np.iinfo(kind).max)
    return st.lists(st.integers(max(low, -(1 << 40)), min(high, 1 << 40)), max_size=12)


@st.composite
def pairs(draw: st.DrawFn) -> tuple[Any, Any]:
    """The same array twice: numpy's, and the plain one."""
    kind = draw(st.sampled_from(TYPES))
    values = draw(numbers(kind))
    return np.array(values, kind), plain.array(values, kind)


def same(one: Any, two: Any) -> None:
    """Two results are alike: values, type and shape."""
    if isinstance(one, tuple):
        for a, b in zip(one, two, strict=True):
            same(a, b)
        return
    if isinstance(one, np.ndarray):
        assert (one.tolist(), one.shape) == (two.tolist(), two.shape)
        assert one.dtype.name == two.dtype.name
    else:
        assert one == two or (one != one and two != two)


UNARY = {
    "sum": lambda np, a: a.sum(),
    "any": lambda np, a: a.any(),
    "nonzero": lambda np, a: np.flatnonzero(a),
    "cumsum": lambda np, a: np.cumsum(a),
    "unique": lambda np, a: np.unique(a, return_index=True, return_inverse=True, return_counts=True),
    "sorted": lambda np, a: np.sort(a),
    "argsort": lambda np, a: np.argsort(a, kind="stable"),
    "reversed": lambda np, a: a[::-1],
    "invert": lambda np, a: ~a,
    "wide": lambda np, a: a.astype(np.int64) << 3,
    "column": lambda np, a: a[:, None] == a[None, :],
    "accumulate": lambda np, a: np.maximum.accumulate(a),
    "bytes": lambda np, a: np.frombuffer(a.tobytes(), np.uint8),
    "halved": lambda np, a: a / 2,
    "appended": lambda np, a: np.concatenate((a, a[:2])),
    "repeated": lambda np, a: np.repeat(a, 2),
    "mask": lambda np, a: a[a > 3],
    "where": lambda np, a: np.where(a > 2, a, 0),
    "diff": lambda np, a: np.diff(a.astype(np.int64), prepend=-1, append=-1),
    "isin": lambda np, a: np.isin(a, [1, 2, 3]),
    "rows": lambda np, a: a[: len(a) // 2 * 2].reshape(-1, 2).sum(axis=1),
    "columns": lambda np, a: a[: len(a) // 2 * 2].reshape(-1, 2)[:, 0],
    "transposed": lambda np, a: a[: len(a) // 2 * 2].reshape(-1, 2).T,
    "log": lambda np, a: np.log2(np.abs(a.astype(np.float64)) + 1),
}


@pytest.mark.parametrize("what", sorted(UNARY))
@given(pair=pairs())
def test_one_array_is_treated_alike(what, pair):
    theirs, ours = pair
    same(UNARY[what](np, theirs), UNARY[what](plain, ours))


BINARY = ["add", "sub", "mul", "and_", "or_", "xor", "eq", "lt", "ge", "floordiv", "mod"]


@pytest.mark.parametrize("what", BINARY)
@given(first=st.sampled_from(TYPES[:-1]), second=st.sampled_from(TYPES[:-1]), data=st.data())
def test_two_arrays_are_joined_alike(what, first, second, data):
    count = data.draw(st.integers(0, 8))
    values = [data.draw(st.lists(st.integers(0, 100), min_size=count, max_size=count)) for _ in range(2)]
    op = getattr(operator, what)
    with np.errstate(all="ignore"):
        theirs = op(np.array(values[0], first), np.array(values[1], second))
    same(theirs, op(plain.array(values[0], first), plain.array(values[1], second)))
    with np.errstate(all="ignore"):
        same(op(np.array(values[0], first), 7), op(plain.array(values[0], first), 7))


@given(pair=pairs(), data=st.data())
def test_stretches_are_views_in_both(pair, data):
    theirs, ours = pair
    first, last = sorted(data.draw(st.tuples(st.integers(0, 12), st.integers(0, 12))))
    step = data.draw(st.integers(1, 3))
    theirs[first:last:step][...] = 1
    ours[first:last:step][...] = 1
    same(theirs, ours)
    which = data.draw(st.lists(st.integers(0, max(len(theirs) - 1, 0)), max_size=4 if len(theirs) else 0))
    theirs[which], ours[which] = 0, 0
    same(theirs, ours)
    same(theirs[which], ours[which])


@given(pair=pairs(), values=st.lists(st.integers(-300, 300), max_size=5), side=st.sampled_from(["left", "right"]))
def test_places_are_found_alike(pair, values, side):
    theirs, ours = np.sort(pair[0]).astype(np.int64), plain.sort(pair[1]).astype(plain.int64)
    same(np.searchsorted(theirs, values, side=side), plain.searchsorted(ours, values, side=side))


def test_types_combine_alike():
    kinds = ["bool_", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64"]
    for one in kinds:
        for two in kinds:
            theirs = np.concatenate([np.ones(1, one), np.ones(1, two)])
            ours = plain.concatenate([plain.ones(1, one), plain.ones(1, two)])
            assert ours.dtype.name == theirs.dtype.name, (one, two)


def read_by(folder: str, texts: list[tuple[str, str]]) -> list[list[str]]:
    """The texts as a process prints them whose numpy is the one in a folder, or the installed one."""
    path = os.pathsep.join(filter(None, (folder, str(ROOT))))
    done = subprocess.run(
        [sys.executable, "-c", _READ],
        input=json.dumps(texts),
        capture_output=True,
        text=True,
        encoding="utf-8",
        env={**os.environ, "PYTHONPATH": path, "PYTHONUTF8": "1"},
        check=True,
    )
    where, told = json.loads(done.stdout)
    assert Path(where).is_relative_to(folder) == bool(folder) if folder else "site-packages" in where
    return list(told)


@pytest.fixture(scope="module")
def stand_in(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A folder in which the plain arrays are called numpy, as in the page's archive."""
    folder = tmp_path_factory.mktemp("plain")
    shutil.copytree(Path(str(plain.__file__)).parent, folder / "numpy", ignore=shutil.ignore_patterns("__pycache__"))
    return str(folder)


def spoilt(text: str, rng: random.Random) -> str:
    """The same with a digit changed here and there."""
    signs = list(text)
    for at in rng.sample(range(len(signs)), k=min(2, len(signs))):
        if signs[at] in "0123456789abcdefABCDEF":
            signs[at] = rng.choice("0123456789ABCDEF")
    return "".join(signs)


def test_pastes_of_every_shape_are_read_alike(stand_in):
    texts: list[tuple[str, str]] = []
    for number, name in enumerate(sorted(SHAPES_OF_PASTES)[::3]):
        rng = random.Random(f"{name} {number}")
        text = SHAPES_OF_PASTES[name](messages(rng, 2 + number % 2), rng)
        texts.append((("en", "ru")[number % 2], text if number % 3 else spoilt(text, rng)))
    assert len(texts) > 50
    by_numpy, by_plain = read_by("", texts), read_by(stand_in, texts)
    assert [text for text, a, b in zip(texts, by_numpy, by_plain, strict=True) if a != b] == []
    assert sum(bool(printed) for printed, _ in by_plain) > 40


@pytest.mark.skipif(not CORPUS.is_dir(), reason="the shared corpus is not beside the project")
def test_pastes_of_the_corpus_are_read_alike(stand_in):
    files = sorted(CORPUS.glob("pastes*/*.txt"))
    texts = [("en", path.read_text(encoding="utf-8", errors="replace")) for path in files]
    assert len(texts) > 60
    by_numpy, by_plain = read_by("", texts), read_by(stand_in, texts)
    assert [path.name for path, a, b in zip(files, by_numpy, by_plain, strict=True) if a != b] == []
