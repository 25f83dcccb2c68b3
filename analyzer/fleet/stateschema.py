"""What may stand in a state: the classes that annotations reach from its root, each with the kinds of its fields.

A class whose objects are kept declares every attribute in its body (`_frames: int`), dataclass, named tuple or plain.
Nothing lists these classes: a hint is a class, or a container of hints. Where a hint is a protocol, the schema is told
what may stand there. What no annotation reaches is in no state, neither written nor read.
"""

from __future__ import annotations

import dataclasses
import enum
import hashlib
import types
import typing
from collections import Counter, OrderedDict, defaultdict, deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Final, Literal

import numpy as np

DTYPES: Final = tuple(
    np.dtype(name).name for name in ("?", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8")
)  # of arrays in a state
_SCALARS: Final = {int: ("int",), float: ("float", "int"), bool: ("bool",), str: ("str",), type(None): ("null",)}
_OCTETS: Final = {bytes: "bytes", bytearray: "bytearray"}
_SETS: Final = {list: "list", set: "set", frozenset: "frozenset", deque: "deque"}
_MAPPINGS: Final = (dict, Mapping, OrderedDict)


@dataclass(eq=False, slots=True)
class StateKind:
    """What a value may be: by the tag that it is written with, the kinds inside it.

    Of a list or set that of its items, of a dict those of keys and values, of a tuple one an item (`...` behind the
    only one: any number); of an array its dtypes, of a text the only ones allowed, if any. `factory`: what a
    defaultdict makes.
    """

    inside: dict[str, tuple[Any, ...]] = field(default_factory=dict)
    factory: Callable[[], Any] | None = None


@dataclass(eq=False)
class StateClass:
    """A class whose objects may stand in a state: its fields in order, each with its kind. `name` stands in files."""

    name: str
    cls: type
    fields: dict[str, StateKind] = field(default_factory=dict)

    @property
    def is_tuple(self) -> bool:
        return issubclass(self.cls, tuple)

    @property
    def is_enum(self) -> bool:
        return issubclass(self.cls, enum.Enum)

    @cached_property
    def members(self) -> tuple[enum.Enum, ...]:
        """Of an enumeration."""
        return tuple(self.cls) if issubclass(self.cls, enum.Enum) else ()

    @cached_property
    def derived(self) -> frozenset[str]:
        """Attributes that are made of the others when they are wanted."""
        return frozenset(n for c in self.cls.__mro__ for n, v in vars(c).items() if isinstance(v, cached_property))


class Schema:
    """The classes that may stand below `root`.

    `open_kinds`: what may stand where a hint is such a protocol, classes or functions, these by their names.
    `elsewhere`: classes that hints name and that their modules import for the type checker alone.
    """

    def __init__(
        self, root: type, open_kinds: Mapping[type, Iterable[Any]], elsewhere: Mapping[str, type] | None = None
    ) -> None:
        self.classes: dict[str, StateClass] = {}
        self.named: dict[str, Any] = {}  # functions
        self._open = {protocol: tuple(members) for protocol, members in open_kinds.items()}
        self._elsewhere = dict(elsewhere or {})
        self._kinds: dict[Any, StateKind] = {}
        self.root = self.kind(root)
        for entry in _as_they_come(self.classes):  # more are found on the way
            if not entry.is_enum:
                entry.fields = {field: self.kind(hint) for field, hint in self._hints(entry.cls).items()}

    def name_of(self, thing: Any) -> str:
        """What a class or function is called in files."""
        return f"{thing.__module__}.{thing.__qualname__}"

    @cached_property
    def digest(self) -> str:
        """What tells this schema from others."""
        numbers = {id(kind): number for number, kind in enumerate(self._kinds.values())}

        def told(kind: StateKind) -> str:
            inside = {
                tag: [numbers.get(id(each), 0) if isinstance(each, StateKind) else str(each) for each in parts]
                for tag, parts in kind.inside.items()
            }
            return repr(sorted(inside.items()))

        lines = [told(kind) for kind in self._kinds.values()]
        for name, entry in self.classes.items():
            lines.append(f"{name}: " + ", ".join(f"{of} {told(kind)}" for of, kind in entry.fields.items()))
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:16]

    def kind(self, hint: Any) -> StateKind:
        """The kind of a hint; TypeError where it says nothing that could be checked."""
        if hint in self._kinds:
            return self._kinds[hint]
        kind = self._kinds[hint] = StateKind()
        for tag, inside in self._tags(hint, kind):
            if kind.inside.setdefault(tag, inside) != inside:
                raise TypeError(f"{hint}: what is written as {tag} may be either of two things")
        return kind

    def _tags(self, hint: Any, kind: StateKind) -> Iterable[tuple[str, tuple[Any, ...]]]:
        hint = type(None) if hint is None else _written_out(hint)
        origin, arguments = typing.get_origin(hint), typing.get_args(hint)
        if hint in _SCALARS or hint in _OCTETS:
            return [(tag, ()) for tag in _SCALARS.get(hint, (_OCTETS.get(hint, ""),))]
        if origin in (types.UnionType, typing.Union):
            return self._union(arguments, kind)
        if origin is Literal and all(isinstance(each, str) for each in arguments):
            return [("str", arguments)]
        if hint is Hashable:
            return [("int", ()), ("str", ()), ("tuple", (kind, ...))]
        if origin is np.ndarray:
            return [("array", self._dtypes(arguments[1]))]
        if origin is not None:
            return self._container(hint, origin, arguments, kind)
        if isinstance(hint, type):
            return [self._member(each) for each in self._open.get(hint, (hint,))]
        raise TypeError(f"{hint} says nothing that could be checked")

    def _union(self, hints: Iterable[Any], kind: StateKind) -> Iterable[tuple[str, tuple[Any, ...]]]:
        for each in map(self.kind, hints):
            kind.factory = kind.factory or each.factory
            yield from each.inside.items()

    def _container(
        self, hint: Any, origin: Any, arguments: tuple[Any, ...], kind: StateKind
    ) -> Iterable[tuple[str, tuple[Any, ...]]]:
        if origin in _SETS:
            return [(_SETS[origin], (self.kind(arguments[0]),))]
        if origin is tuple:
            return [("tuple", tuple(each if each is ... else self.kind(each) for each in arguments))]
        if origin is Sequence:
            item = self.kind(arguments[0])
            octets = [("bytes", ()), ("bytearray", ())] if arguments[0] is int else []
            return [("list", (item,)), ("tuple", (item, ...)), *octets]
        if origin is Counter:
            return [("counter", (self.kind(arguments[0]), self.kind(int)))]
        if origin in (*_MAPPINGS, defaultdict):
            inside = (self.kind(arguments[0]), self.kind(arguments[1]))
            made = typing.get_origin(arguments[1]) or arguments[1]
            kind.factory = made if isinstance(made, type) else None
            return [("dict", inside), ("defaultdict", inside)]
        raise TypeError(f"{hint}: no container that a state has")

    @staticmethod
    def _dtypes(hint: Any) -> tuple[str, ...]:
        (scalar,) = typing.get_args(hint)
        return DTYPES if scalar is Any else (np.dtype(scalar).name,)

    def _member(self, thing: Any) -> tuple[str, tuple[Any, ...]]:
        """A class, or a function that is known by its name."""
        name = self.name_of(thing)
        if not isinstance(thing, type):
            self.named[name] = thing
        elif thing is object or getattr(thing, "_is_protocol", False):
            raise TypeError(f"{name} says nothing that could be checked")
        elif name not in self.classes:
            self.classes[name] = StateClass(name, thing)
        return name, ()

    def _hints(self, cls: type) -> dict[str, Any]:
        hints = typing.get_type_hints(cls, localns=self._elsewhere)
        hints = {name: hint for name, hint in hints.items() if typing.get_origin(hint) is not ClassVar}
        if not hints and not dataclasses.is_dataclass(cls) and cls.__init__ is not object.__init__:  # type: ignore[misc]
            raise TypeError(f"{cls.__module__}.{cls.__qualname__} declares no fields, so none of it can be kept")
        return hints


def _as_they_come(classes: Mapping[str, StateClass]) -> Iterator[StateClass]:
    done = 0
    while done < len(classes):
        yield list(classes.values())[done]
        done += 1


def _written_out(hint: Any) -> Any:
    """What an alias of a type statement stands for: numpy's `NDArray` is one from Python 3.12 on."""
    alias = typing.get_origin(hint)
    return alias.__value__[typing.get_args(hint)] if hasattr(alias, "__value__") else hint
