"""Types of numbers and how they combine, as numpy 2 has them (NEP 50)."""

from __future__ import annotations

from functools import cache, reduce
from operator import ge
from types import GenericAlias
from typing import Any, ClassVar, Final


class generic:
    """Any scalar."""

    __slots__ = ()
    __class_getitem__: Any = classmethod(GenericAlias)

    def item(self) -> Any:
        """The same as Python's own."""
        return self.real  # type: ignore[attr-defined]


class integer(generic):
    __slots__ = ()


class floating(generic):
    __slots__ = ()


class int8(int, integer):
    __slots__ = ()


class int16(int, integer):
    __slots__ = ()


class int32(int, integer):
    __slots__ = ()


class int64(int, integer):
    __slots__ = ()


class uint8(int, integer):
    __slots__ = ()


class uint16(int, integer):
    __slots__ = ()


class uint32(int, integer):
    __slots__ = ()


class uint64(int, integer):
    __slots__ = ()


class float32(float, floating):
    __slots__ = ()


class float64(float, floating):
    __slots__ = ()


class bool_(generic):
    __slots__ = ()

    def __new__(cls, value: Any = False) -> Any:
        return bool(value)


class void(generic):
    __slots__ = ()


intp = int64
# scalar type: kind, bytes, format of `array` and `memoryview`
_KINDS: Final[dict[type, tuple[str, int, str]]] = {
    bool_: ("b", 1, "?"),
    int8: ("i", 1, "b"),
    int16: ("i", 2, "h"),
    int32: ("i", 4, "i"),
    int64: ("i", 8, "q"),
    uint8: ("u", 1, "B"),
    uint16: ("u", 2, "H"),
    uint32: ("u", 4, "I"),
    uint64: ("u", 8, "Q"),
    float32: ("f", 4, "f"),
    float64: ("f", 8, "d"),
}
_OF_PYTHON: Final = {bool: bool_, int: int64, float: float64}
_NAMES: Final = {f"{kind}{octets}": scalar for scalar, (kind, octets, _) in _KINDS.items()} | {
    scalar.__name__: scalar for scalar in _KINDS
}
_PLAIN: Final[dict[str, type]] = {"b": bool, "i": int, "u": int, "f": float}


class dtype:
    """A type of elements. One object a type, but for columns of several figures a row (`shape`)."""

    __class_getitem__: Any = classmethod(GenericAlias)
    _made: ClassVar[dict[type, dtype]] = {}

    type: type
    kind: str
    itemsize: int
    format: str
    plain: Any  # Python's own for its values
    scalar: Any  # what one element is
    shape: tuple[int, ...]

    def __new__(cls, given: Any) -> dtype:
        if isinstance(given, dtype):
            return given
        if isinstance(given, tuple):
            made = object.__new__(cls)
            made.__dict__.update(dtype(given[0]).__dict__, shape=tuple(given[1]))
            return made
        scalar = _NAMES.get(given.lstrip("<=|").removeprefix(">")) if isinstance(given, str) else given
        scalar = _OF_PYTHON.get(scalar, scalar)  # type: ignore[arg-type]
        if scalar not in _KINDS:
            raise TypeError(f"no such type here: {given!r}")
        if scalar not in cls._made:
            made = cls._made[scalar] = object.__new__(cls)
            made.type = scalar
            made.kind, made.itemsize, made.format = _KINDS[scalar]
            made.plain = _PLAIN[made.kind]
            made.scalar = made.plain if scalar is bool_ else scalar
            made.shape = ()
        return cls._made[scalar]

    def __eq__(self, other: object) -> bool:
        try:
            return self.type is dtype(other).type
        except TypeError:
            return False

    def __hash__(self) -> int:
        return hash(self.type)

    def __deepcopy__(self, _: Any) -> dtype:
        return self

    @property
    def name(self) -> str:
        return self.type.__name__.rstrip("_")

    def __repr__(self) -> str:
        return f"dtype({self.name!r})"


class iinfo:
    """The least and the greatest integer of a type."""

    def __init__(self, given: Any) -> None:
        kind = dtype(given)
        bits = 8 * kind.itemsize
        self.min = 0 if kind.kind == "u" else -(1 << bits - 1)
        self.max = (1 << bits) - 1 if kind.kind == "u" else (1 << bits - 1) - 1


BOOL: Final = dtype(bool_)
INT: Final = dtype(int64)
UINT: Final = dtype(uint64)
FLOAT: Final = dtype(float64)


def type_of(value: Any) -> tuple[dtype, bool]:
    """The type of a number, and whether it is weak: Python's own numbers take the type of what they meet."""
    if type(value) in _KINDS:
        return dtype(type(value)), False
    if isinstance(value, bool):
        return BOOL, True
    return (FLOAT if isinstance(value, float) else INT), True


# Of each type, the narrowest first: whether it holds fractions, and a sign, and how many bits of any integer.
_REACH: Final = {
    bool_: (0, 0, 1),
    uint8: (0, 0, 8),
    int8: (0, 1, 7),
    uint16: (0, 0, 16),
    int16: (0, 1, 15),
    uint32: (0, 0, 32),
    int32: (0, 1, 31),
    uint64: (0, 0, 64),
    int64: (0, 1, 63),
    float32: (1, 1, 16),
    float64: (1, 1, 64),
}


@cache
def promoted(one: dtype, two: dtype) -> dtype:
    """The narrowest type that holds both."""
    needed = tuple(map(max, _REACH[one.type], _REACH[two.type]))
    return dtype(next(scalar for scalar, reach in _REACH.items() if all(map(ge, reach, needed))))


_RANK: Final = {"b": 0, "u": 1, "i": 1, "f": 2}


def together(types: list[tuple[dtype, bool]]) -> dtype:
    """The type of what is made of arrays and numbers: weak ones only lift the kind."""
    strong = [kind for kind, weak in types if not weak]
    weak = [kind for kind, is_weak in types if is_weak]
    found = reduce(promoted, strong or weak)
    return max((found, *weak), key=lambda kind: _RANK[kind.kind])
