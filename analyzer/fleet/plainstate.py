"""Objects as plain data and back, by a schema: arrays and a tree of names and numbers in one .npz, and no code.

    tree     JSON: {"form": 1, "schema": digest, "root": [7], "objects": [...]}
    int64    all arrays of that type, end to end (and so for each type)

A value is null, a number, a text, or the place of an object in `objects` as a list of one number. An object is its tag
and what it holds: `["list", [1, 2, [4]]]`, `["dict", [key, value, key, value]]`, `["bytes", "0a0b"]`,
`["array", "int64", [2, 256]]` (the next of its column), `["analyzer.core.Analyzer", {"_frames": 12}]`. What is one
object in memory is one object in the file.

Whatever a file says, reading it calls nothing but what makes empty objects, lists, dicts and the like: the tree is
checked against the schema first, then objects of the schema's classes are made without their `__init__` and filled.
Enumerations go by value, so a state is the same for every version of Python.
"""

from __future__ import annotations

import enum
import io
import json
import types
import zipfile
from collections import Counter, OrderedDict, defaultdict, deque
from collections.abc import Callable, Iterable
from itertools import cycle, repeat
from math import prod
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from .stateschema import DTYPES, Schema, StateKind

_FORM: Final = 1
_TREE: Final = "tree"
_MOST: Final = 1 << 29  # bytes that a state may be unpacked: the largest known has some megabytes
_MOST_TREE: Final = 1 << 26  # and its tree
_PLAIN: Final = {bool: "bool", int: "int", float: "float", str: "str", type(None): "null"}
_TAGS: Final = {
    list: "list", tuple: "tuple", dict: "dict", OrderedDict: "dict", types.MappingProxyType: "dict", set: "set",
    frozenset: "frozenset", deque: "deque", Counter: "counter", defaultdict: "defaultdict", bytes: "bytes",
    bytearray: "bytearray", np.ndarray: "array",
}  # fmt: skip
_KEYED: Final = frozenset({"dict", "counter", "defaultdict"})
_UNORDERED: Final = frozenset({"set", "frozenset"})
_ITEMED: Final = frozenset({"list", "tuple", "set", "frozenset", "deque"})
_EMPTY: Final[dict[str, Callable[[], Any]]] = {
    "list": list, "set": set, "deque": deque, "dict": dict, "counter": Counter, "bytearray": bytearray,
}  # fmt: skip
_AXES: Final = 4  # of an array
_MISSING: Final = object()

Tree = dict[str, Any]
ArrayColumns = dict[str, NDArray[Any]]


class StateError(Exception):
    """What is no state of this schema: why."""


def _damaged(detail: str) -> StateError:
    return StateError(f"it is damaged ({detail})")


def encoded(root: Any, schema: Schema) -> bytes:
    """An object of the schema's root and all that hangs on it. StateError where a part has no place in the schema."""
    writer = _StateWriter(schema)
    tree = {"form": _FORM, "schema": schema.digest, "root": writer.node(root), "objects": writer.objects}
    _CheckedTree(schema, tree)
    text = json.dumps(tree, separators=(",", ":")).encode()
    columns = {name: np.concatenate(parts) for name, parts in writer.columns.items()}
    out = io.BytesIO()
    np.savez_compressed(out, allow_pickle=False, **{_TREE: np.frombuffer(text, np.uint8), **columns})
    return out.getvalue()


def decoded(data: bytes, schema: Schema) -> Any:
    """What `encoded` was given, made anew. StateError where these bytes are anything else; nothing in them is run."""
    tree, columns = _unpacked(data)
    if tree.get("form") != _FORM or tree.get("schema") != schema.digest:
        raise StateError("another version of rtuscope made it")
    checked = _CheckedTree(schema, tree)
    try:
        return _Maker(schema, checked, columns).made()
    except (TypeError, ValueError, OverflowError, MemoryError) as error:  # as of what cannot be a key
        raise _damaged(f"{error}") from error


class _StateWriter:
    """Gives each object its place in a tree; what an object needs to be made stands before it."""

    def __init__(self, schema: Schema) -> None:
        self.objects: list[list[Any]] = []
        self.columns: dict[str, list[NDArray[Any]]] = {}
        self._classes = {entry.cls: entry for entry in schema.classes.values()}
        self._named = {thing: name for name, thing in schema.named.items()}
        self._places: dict[int, int] = {}

    def node(self, root: Any) -> Any:
        """The tree's word for an object, which is in the tree then with all that hangs on it."""
        entered: set[int] = set()
        order: list[Any] = []
        stack = [(root, False)]
        while stack:  # no recursion: paths of a lattice are long chains
            thing, is_left = stack.pop()
            if is_left:
                self._places[id(thing)] = len(order)
                order.append(thing)
            elif type(thing) not in _PLAIN and not isinstance(thing, np.generic) and id(thing) not in entered:
                entered.add(id(thing))
                stack.append((thing, True))
                stack += [(part, False) for part in self._parts(thing)]
        self.objects = [self._entry(thing) for thing in order]
        return self._word(root)

    def _parts(self, thing: Any) -> Iterable[Any]:
        tag = _TAGS.get(type(thing))
        if tag in _KEYED:
            return [part for pair in thing.items() for part in pair]
        if tag in _UNORDERED:
            return sorted(thing, key=repr)  # a set of bytes has another order each time, the same state has one
        if tag in _ITEMED:
            return list(thing)
        return [] if tag or self._is_named(thing) else self._fields(thing).values()

    def _is_named(self, thing: Any) -> bool:
        return isinstance(thing, types.FunctionType) and thing in self._named

    def _fields(self, thing: Any) -> dict[str, Any]:
        entry = self._classes.get(type(thing))
        if entry is None:
            raise StateError(f"a {type(thing).__qualname__} cannot be part of a state")
        if entry.is_enum:
            return {}
        held = thing._asdict() if entry.is_tuple else getattr(thing, "__dict__", {})
        if undeclared := held.keys() - entry.fields.keys() - entry.derived:
            raise StateError(f"{entry.name} does not declare {', '.join(sorted(undeclared))}")
        try:
            return {name: getattr(thing, name) for name in entry.fields}
        except AttributeError as error:
            raise StateError(f"{entry.name} did not make everything it declares: {error}") from error

    def _word(self, thing: Any) -> Any:
        if isinstance(thing, np.generic):
            return thing.item()
        return thing if type(thing) in _PLAIN else [self._places[id(thing)]]

    def _entry(self, thing: Any) -> list[Any]:
        tag = _TAGS.get(type(thing))
        if tag in _KEYED or tag in _ITEMED:
            if getattr(thing, "maxlen", None) is not None:
                raise StateError("a deque with a greatest length cannot be part of a state")
            return [tag, [self._word(part) for part in self._parts(thing)]]
        if tag == "array":
            return [tag, *self._array(thing)]
        if tag is not None:
            return [tag, thing.hex()]
        if self._is_named(thing):
            return [self._named[thing], None]
        name = self._classes[type(thing)].name
        if self._classes[type(thing)].is_enum:
            return [name, thing.value]
        return [name, {field: self._word(value) for field, value in self._fields(thing).items()}]

    def _array(self, array: NDArray[Any]) -> tuple[str, list[int]]:
        name = array.dtype.name
        if name not in DTYPES:
            raise StateError(f"an array of {name} cannot be part of a state")
        flat = np.ascontiguousarray(array).reshape(-1)
        self.columns.setdefault(name, []).append(flat.astype(array.dtype.newbyteorder("="), copy=False))
        return name, list(array.shape)


class _CheckedTree:
    """A tree that fits its schema: objects with known tags, each field and item of a kind that may stand there."""

    def __init__(self, schema: Schema, tree: Tree) -> None:
        """Raises StateError where it does not fit."""
        self._classes, self._named = schema.classes, schema.named
        self.root = tree.get("root")
        objects = tree.get("objects")
        if not isinstance(objects, list):
            raise _damaged("no objects")
        self.objects: list[Any] = objects
        self.factories: dict[int, Callable[[], Any]] = {}  # of defaultdicts, by their places
        waiting: list[tuple[Any, StateKind, str]] = [(self.root, schema.root, "the root")]
        seen: set[tuple[int, int]] = set()
        while waiting:
            word, kind, where = waiting.pop()
            place, tag, held = self._thing(word, where)
            inside = () if self._is_number(tag, kind) else kind.inside.get(tag)
            if inside is None or (tag == "str" and inside and held not in inside):
                raise _damaged(f"{where} is not a {tag}")
            if place is None or (place, id(kind)) in seen:
                continue
            seen.add((place, id(kind)))
            if tag == "defaultdict":
                self.factories[place] = self._factory(kind, where)
            waiting += self._inside(tag, held, inside, where)
        if len({place for place, _ in seen}) < len(self.objects):
            raise _damaged("it holds what nothing refers to")

    def _thing(self, word: Any, where: str) -> tuple[int | None, str, Any]:
        """Of a word its object's place, or None; a tag, what is held."""
        if type(word) in _PLAIN:
            if type(word) is int and not -(1 << 63) <= word < 1 << 64:
                raise _damaged(f"{where} is a number of too many digits")
            return None, _PLAIN[type(word)], word
        if type(word) is list and len(word) == 1 and type(word[0]) is int and 0 <= word[0] < len(self.objects):
            entry = self.objects[word[0]]
            if type(entry) is list and len(entry) > 1 and type(entry[0]) is str:
                return word[0], entry[0], entry[1:]
        raise _damaged(f"{where} refers to nothing")

    def _is_number(self, tag: str, kind: StateKind) -> bool:
        """Whether this is a member of an enumeration of integers, where any integer may stand."""
        return "int" in kind.inside and tag in self._classes and issubclass(self._classes[tag].cls, enum.IntEnum)

    @staticmethod
    def _factory(kind: StateKind, where: str) -> Callable[[], Any]:
        if kind.factory is None:
            raise _damaged(f"{where} has no default")
        return kind.factory

    def _inside(
        self, tag: str, held: list[Any], inside: tuple[Any, ...], where: str
    ) -> Iterable[tuple[Any, StateKind, str]]:
        """What stands in an object, each with its kind."""
        first = held[0]
        if tag in self._classes:
            return self._fields(tag, first, where)
        if tag == "array":
            self._check_array(held, inside, where)
        elif tag in _ITEMED or tag in _KEYED:
            if type(first) is not list:
                raise _damaged(f"{where} holds nothing")
            return zip(first, self._kinds_of(tag, first, inside, where), repeat(where))
        elif type(first) is not (type(None) if tag in self._named else str):
            raise _damaged(f"{where} is not a {tag}")
        return ()

    def _fields(self, tag: str, held: Any, where: str) -> Iterable[tuple[Any, StateKind, str]]:
        entry = self._classes[tag]
        if entry.is_enum:
            if type(held) not in _PLAIN or held not in [member.value for member in entry.members]:
                raise _damaged(f"{where} is not a {tag}")
            return ()
        if type(held) is not dict or held.keys() != entry.fields.keys():
            raise _damaged(f"{where} is not a {tag}")
        name = entry.cls.__qualname__
        return [(held[field], kind, f"{name}.{field}") for field, kind in entry.fields.items()]

    @staticmethod
    def _check_array(held: list[Any], inside: tuple[Any, ...], where: str) -> None:
        fits = len(held) == 2 and held[0] in inside and type(held[1]) is list and len(held[1]) <= _AXES
        if not fits or not all(type(size) is int and 0 <= size < _MOST for size in held[1]):
            raise _damaged(f"{where} is not such an array")

    @staticmethod
    def _kinds_of(tag: str, items: list[Any], inside: tuple[Any, ...], where: str) -> Iterable[StateKind]:
        if tag in _KEYED and len(items) % 2 == 0:
            return cycle(inside)
        if tag in _ITEMED and (tag != "tuple" or inside[-1:] == (...,)):
            return repeat(inside[0])
        if tag == "tuple" and len(inside) == len(items):
            return inside
        raise _damaged(f"{where} holds too little or too much")


class _Maker:
    """Makes the objects of a tree that was checked."""

    def __init__(self, schema: Schema, checked: _CheckedTree, columns: ArrayColumns) -> None:
        self._classes, self._named = schema.classes, schema.named
        self._checked = checked
        self._columns = columns
        self._at = dict.fromkeys(columns, 0)  # how much of each column is taken
        self._things: list[Any] = [_MISSING] * len(checked.objects)

    def made(self) -> Any:
        """The root. Empty objects first, then what is made whole of them, then each is filled, what has keys last."""
        objects = list(enumerate(self._checked.objects))
        for place, (tag, *_) in objects:
            self._things[place] = self._empty(place, tag)
        for place, (tag, *held) in objects:
            if self._things[place] is _MISSING:
                self._things[place] = self._whole(tag, held)
        for keyed in (False, True):
            for place, (tag, *held) in objects:
                if (tag in _KEYED or tag == "set") is keyed:
                    self._fill(self._things[place], tag, held[0])
        return self._value(self._checked.root)

    def _value(self, word: Any) -> Any:
        if type(word) is not list:
            return word
        thing = self._things[word[0]]
        if thing is _MISSING:
            raise _damaged("what is made whole stands before what it is made of")
        return thing

    def _empty(self, place: int, tag: str) -> Any:
        if tag == "defaultdict":
            return defaultdict(self._checked.factories[place])
        if tag in _EMPTY:
            return _EMPTY[tag]()
        if tag in self._named:
            return self._named[tag]
        entry = self._classes.get(tag)
        if entry is None or entry.is_tuple or entry.is_enum:
            return _MISSING
        return object.__new__(entry.cls)

    def _whole(self, tag: str, held: list[Any]) -> Any:
        if tag == "array":
            return self._array(*held)
        if tag == "bytes":
            return bytes.fromhex(held[0])
        if tag in ("tuple", "frozenset"):
            items = map(self._value, held[0])
            return tuple(items) if tag == "tuple" else frozenset(items)
        entry = self._classes[tag]
        if entry.is_enum:
            return entry.cls(held[0])
        return tuple.__new__(entry.cls, [self._value(held[0][field]) for field in entry.fields])

    def _array(self, dtype: str, shape: list[int]) -> NDArray[Any]:
        column, first = self._columns.get(dtype, np.zeros(0, dtype)), self._at.get(dtype, 0)
        last = first + prod(shape)
        if last > len(column):
            raise _damaged("arrays are cut")
        self._at[dtype] = last
        return column[first:last].reshape(shape).copy()

    def _fill(self, thing: Any, tag: str, held: Any) -> None:
        if tag in ("list", "deque"):
            thing.extend(map(self._value, held))
        elif tag == "set":
            thing.update(map(self._value, held))
        elif tag == "bytearray":
            thing += bytes.fromhex(held)
        elif tag in _KEYED:
            for key, value in zip(held[::2], held[1::2], strict=True):
                dict.__setitem__(thing, self._value(key), self._value(value))
        elif tag in self._classes and not (self._classes[tag].is_enum or self._classes[tag].is_tuple):
            for field, value in held.items():
                object.__setattr__(thing, field, self._value(value))


def _unpacked(data: bytes) -> tuple[Tree, ArrayColumns]:
    """The tree and the columns of arrays, no larger than a state may be."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            sizes = {info.filename.removesuffix(".npy"): info.file_size for info in archive.infolist()}
        if not {_TREE} <= sizes.keys() <= {_TREE, *DTYPES} or sum(sizes.values()) > _MOST or sizes[_TREE] > _MOST_TREE:
            raise _damaged("it holds something else")
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            columns = {name: arrays[name] for name in sizes}
        tree = json.loads(columns.pop(_TREE).tobytes())
    except StateError:
        raise
    except Exception as error:  # whatever zip, zlib, NumPy and json make of other bytes
        raise _damaged(f"{type(error).__name__}") from error
    if type(tree) is not dict or any(c.ndim != 1 or c.dtype.name != name for name, c in columns.items()):
        raise _damaged("it holds something else")
    return tree, columns
