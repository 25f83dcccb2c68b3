"""A line's state between two batches: plain data that runs nothing, and goes on exactly where it was."""

from __future__ import annotations

import ast
import inspect
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from lakes import batch, bus, plain, ring, same
from scripts import package

import captures
from analyzer.cli import main
from analyzer.core import EvenBlocks
from analyzer.fleet import FleetError, linestate, plainstate
from analyzer.fleet.datasets import LakeFiles
from analyzer.fleet.linestate import LineState, resumed
from analyzer.fleet.stateschema import Schema
from analyzer.fleet.stores import store
from analyzer.options import Options

ROOT = Path(linestate.__file__).parents[2]
CODE_IN_DATA = {"pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve", "jsonpickle", "joblib"}


def sources():
    for folder in ("analyzer", "captures", "dissectors"):
        yield from sorted((ROOT / folder).rglob("*.py"))


def test_nothing_in_the_product_reads_objects_that_bring_their_code():
    for path in sources():
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not CODE_IN_DATA & {name.split(".")[0] for name in names}, path
            if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                assert isinstance(node.value, ast.Constant) and node.value.value is False, path
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("np.load", "numpy.load"):
                assert any(word.arg == "allow_pickle" for word in node.keywords), path
            if isinstance(node, ast.Call):
                assert ast.unparse(node.func) not in ("eval", "yaml.load", "yaml.unsafe_load"), path


def assigned(cls):
    """The attributes that methods of a class give to `self`."""
    module = inspect.getmodule(cls)
    assert module is not None
    tree = ast.parse(inspect.getsource(module))
    (node,) = [each for each in ast.walk(tree) if isinstance(each, ast.ClassDef) and each.name == cls.__name__]
    for each in ast.walk(node):
        match each:
            case ast.Attribute(value=ast.Name(id="self"), attr=name, ctx=ast.Store()):
                yield name


def test_classes_whose_objects_are_kept_declare_all_that_they_have():
    """So that whoever adds an attribute is told here, and not a user by the batch that would have kept it."""
    classes = linestate._schema().classes.values()
    assert len(classes) > 90
    for entry in classes:
        assert set(assigned(entry.cls)) <= {*entry.fields, *entry.derived}, entry.name


def test_the_schema_is_the_same_whenever_it_is_made():
    linestate._schema.cache_clear()
    first = linestate._schema().digest
    linestate._schema.cache_clear()
    assert linestate._schema().digest == first


def state_of(capture, tmp_path, room):
    """A state in the middle of things: blocks of few bytes, so that engines, pairers and rules have begun."""
    state = LineState(capture.line, Options(), noise=False)
    state.even = EvenBlocks(room)
    for _ in state.slice(capture, capture.blocks(), files_in(tmp_path)):
        pass
    return state


def files_in(tmp_path):
    return LakeFiles(store(str(tmp_path)), "site", "line", "x")


def ascii_bus():
    frames = (b":1103006B00037E\r\n", b":110306AE415652434049\r\n", b":1103006B00037E\r\n")
    return captures.Capture.of(
        captures.LineSettings(baud=9600), [captures.Chunk(i * 10**8, frame) for i, frame in enumerate(frames * 30)]
    )


def tcp_bus():
    request, answer = bytes.fromhex("0001000000061103006b0003"), bytes.fromhex("000100000009110306022b00000064")
    chunks = [captures.Chunk(i * 10**7, (request, answer)[i % 2], i % 2) for i in range(120)]
    return captures.Capture.of(captures.LineSettings(), chunks)


def two_ports():
    made = list(bus("hard", 5, 150).chunks())
    return captures.Capture.of(
        captures.LineSettings(baud=9600), [captures.Chunk(c.t_ns, c.data, i // 16 % 2) for i, c in enumerate(made)]
    )


BUSES = {
    "clean": lambda: bus("clean", 1, 200),
    "noisy": lambda: bus("noisy", 2, 300),
    "brutal": lambda: bus("brutal", 3, 200),
    "vendor": lambda: bus("vendor", 4, 200),
    "ascii": ascii_bus,
    "tcp": tcp_bus,
    "two ports": two_ports,
    "nothing": lambda: captures.Capture.of(captures.LineSettings(), [captures.Chunk(0, b"\x11")]),
}


@pytest.mark.parametrize("name", BUSES)
@pytest.mark.parametrize("room", [40, 700, 1 << 19])
def test_a_state_read_back_is_the_state(tmp_path, name, room):
    kept = state_of(BUSES[name](), tmp_path, room).kept()
    again = resumed(kept)
    assert again.kept() == kept
    tree, columns = package("attack.states").unpacked(kept)
    assert package("attack.states").packed(tree, columns)
    assert json.dumps(tree)
    assert all(column.dtype.hasobject is False for column in columns.values())


def test_a_set_has_one_order_however_it_was_filled():
    parts = [bytes((i, i * 7 & 255)) for i in range(200)]
    trees = []
    for filled in (parts, parts[::-1], sorted(parts, key=hash)):
        writer = plainstate._StateWriter(linestate._schema())
        writer.node({"one": set(filled)})
        trees.append(writer.objects)
    assert trees[0] == trees[1] == trees[2]


@pytest.mark.parametrize("name", ["clean", "noisy", "brutal", "ascii", "tcp", "two ports"])
def test_rows_are_the_same_whether_or_not_the_state_was_kept_between_blocks(tmp_path, name, monkeypatch):
    monkeypatch.setattr("analyzer.core._BLOCK", 300)
    monkeypatch.setattr("analyzer.fleet.linestate._LITTLE", 0)  # so that rows come in pieces
    given_ = []
    for keeps in (False, True):
        capture = BUSES[name]()
        files = files_in(tmp_path / str(keeps))
        seen: list[Any] = []
        monkeypatch.setattr(files, "add", lambda name, records, seen=seen: seen.append((name, plain(records))))
        state = LineState(capture.line, Options(), noise=True)
        state.even = EvenBlocks(300)
        chunks = list(capture.chunks())
        for first in range(0, len(chunks), len(chunks) // 7):
            part = captures.Capture.of(capture.line, chunks[first : first + len(chunks) // 7])
            for _ in state.slice(part, part.blocks(), files):
                pass
            state = resumed(state.kept()) if keeps else state
        state.close(files)
        given_.append([each for each in seen if each[1]])
    assert len(given_[0]) > 5
    assert repr(given_[0]) == repr(given_[1])


def test_a_pickle_is_refused_unread_and_in_one_line():
    class Evil:
        def __reduce__(self):
            return pytest.fail, ("called",)

    for protocol in range(2, 6):
        with pytest.raises(FleetError, match="pickle from an older rtuscope") as told:
            resumed(pickle.dumps([Evil()], protocol))
        assert "\n" not in str(told.value)


def hostile(number):
    from random import Random

    return package("attack.states").hostile(Random(number))


@given(st.integers(0, 2**32))
@example(7)
@settings(max_examples=75, deadline=None, suppress_health_check=list(HealthCheck))
def test_whatever_a_state_says_reading_it_calls_nothing_and_ends_in_one_line(number):
    data = hostile(number)
    with package("attack.states").nothing_called():
        try:
            resumed(data)
        except FleetError as error:
            assert len(str(error).splitlines()) == 1
            assert str(error).startswith("the state of the line cannot be used: ")


@given(st.binary(max_size=400))
@settings(max_examples=90, deadline=None)
def test_any_bytes_are_refused(data):
    with pytest.raises(FleetError):
        resumed(data)


def test_the_schema_refuses_what_says_nothing():
    class Loose:
        def __init__(self):
            self.anything = 1

    class Wide:
        anything: object

    for wrong in (Loose, Wide):
        with pytest.raises(TypeError):
            Schema(wrong, {})


def test_a_state_of_another_schema_is_refused(tmp_path):
    states = package("attack.states")
    tree, columns = states.unpacked(state_of(bus(), tmp_path, 700).kept())
    assert resumed(states.packed(tree, columns)).octets > 0
    with pytest.raises(FleetError, match="another version of rtuscope"):
        resumed(states.packed(tree | {"schema": "0" * 16}, columns))


@pytest.mark.parametrize("what", ["emptied", "negative", "huge"])
def test_a_state_that_fits_and_is_nonsense_costs_no_rows(tmp_path, what, capsys):
    """Only going on with it shows that it is of no use: that is told, the line is done anew, the status is 1."""
    states = package("attack.states")
    _, paths = ring(tmp_path)
    later = paths[2].rename(tmp_path / "later.mcap")
    command = ["batch", str(paths[0].parent), "-o", str(tmp_path / "lake"), "--resume", "--workers", "1"]
    assert main(command) == 0
    later.rename(paths[2])
    (path,) = (tmp_path / "lake" / "state").iterdir()
    tree, columns = states.unpacked(path.read_bytes())
    value = {"emptied": None, "negative": -(1 << 40), "huge": (1 << 64) - 1}[what]
    for entry in tree["objects"]:
        if entry[0] == "array" and what == "emptied":
            entry[2] = [0]
        elif isinstance(entry[1], dict) and value is not None:
            entry[1] = {n: value if type(v) is int and n[0] == "_" else v for n, v in entry[1].items()}
    path.write_bytes(states.packed(tree, columns))
    capsys.readouterr()
    assert main(command) == 1
    told = capsys.readouterr().err
    assert told.count("the state of the line cannot be used") == 1 and "Traceback" not in told
    batch(tmp_path / "whole", *paths)
    assert same(tmp_path / "lake", tmp_path / "whole")


def test_arrays_of_any_shape_come_back_as_their_own(tmp_path):
    state = state_of(bus("noisy"), tmp_path, 700)
    again = resumed(state.kept())
    mine, other = (np.concatenate([p.data for p in s.even._parts] or [np.zeros(0)]) for s in (state, again))
    assert (mine == other).all()
    for part in again.even._parts:
        part.data[:] = 0  # writable, and nobody else's
