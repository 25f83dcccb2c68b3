"""Arrays in plain Python, where numpy is not to be had: in a browser, for the little that a paste holds.

It has what reading a paste calls, with numpy's names and numpy's results, and nothing else: what is missing is an
AttributeError. A test reads pastes with it and with numpy.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from itertools import accumulate, chain, compress
from typing import Any

from . import typing as typing
from .array import asarray as _asarray
from .array import handed, made, ndarray, spread, typed
from .elementwise import binary, divided, max_of, min_of, unary
from .places import broadcast_shape
from .types import BOOL, FLOAT, INT, together, type_of
from .types import bool_ as bool_
from .types import dtype as dtype
from .types import float32 as float32
from .types import float64 as float64
from .types import floating as floating
from .types import generic as generic
from .types import iinfo as iinfo
from .types import int8 as int8
from .types import int16 as int16
from .types import int32 as int32
from .types import int64 as int64
from .types import integer as integer
from .types import intp as intp
from .types import uint8 as uint8
from .types import uint16 as uint16
from .types import uint32 as uint32
from .types import uint64 as uint64
from .types import void as void

__version__ = "2.0.0"
inf, nan, newaxis = math.inf, math.nan, None


def _shape(given: Any) -> tuple[int, ...]:
    return (int(given),) if isinstance(given, int) else tuple(map(int, given))


def full(shape: Any, value: Any, dtype: Any = None) -> ndarray:
    kind = type_of(value)[0] if dtype is None else _dtype(dtype)
    wanted = (*_shape(shape), *kind.shape)
    plain = _dtype(kind.type)
    return made(plain, [value] * math.prod(wanted), wanted)


_dtype = dtype


def zeros(shape: Any, dtype: Any = float) -> ndarray:
    return full(shape, 0, dtype)


def ones(shape: Any, dtype: Any = float) -> ndarray:
    return full(shape, 1, dtype)


empty = zeros


def zeros_like(array: ndarray, dtype: Any = None) -> ndarray:
    return full(array.shape, 0, array.dtype if dtype is None else dtype)


empty_like = zeros_like


def array(value: Any, dtype: Any = None, copy: bool = True) -> ndarray:
    found = _asarray(value, dtype)
    return found.copy() if copy and found is value else found


def asarray(value: Any, dtype: Any = None) -> ndarray:
    return _asarray(value, dtype)


ascontiguousarray = asarray


def frombuffer(data: Any, dtype: Any = float, count: int = -1, offset: int = 0) -> ndarray:
    kind = _dtype(dtype)
    memory: Any = memoryview(data).cast("B")[offset:]
    memory = memory[: len(memory) // kind.itemsize * kind.itemsize if count < 0 else count * kind.itemsize]
    memory = memory if kind.format == "B" else memory.cast(kind.format)
    return ndarray(memory, kind, (len(memory),))


def arange(start: Any, stop: Any = None, step: Any = 1, dtype: Any = None) -> ndarray:
    first, last = (0, start) if stop is None else (start, stop)
    if all(isinstance(each, int) for each in (first, last, step)):
        return made(INT if dtype is None else _dtype(dtype), list(range(first, last, step)))
    count = max(math.ceil((last - first) / step), 0)
    return made(FLOAT if dtype is None else _dtype(dtype), [first + number * step for number in range(count)])


def tri(rows: int, dtype: Any = float) -> ndarray:
    return made(_dtype(dtype), [column <= row for row in range(rows) for column in range(rows)], (rows, rows))


def concatenate(parts: Sequence[Any], axis: int = 0, dtype: Any = None) -> ndarray:
    arrays = [_asarray(part) for part in parts]
    kind = together([(each.dtype, False) for each in arrays]) if dtype is None else _dtype(dtype)
    axis %= arrays[0].ndim
    shape = list(arrays[0].shape)
    shape[axis] = sum(each.shape[axis] for each in arrays)
    outer = math.prod(shape[:axis])
    pieces = []
    for at in range(outer):
        for each in arrays:
            size = math.prod(each.shape[axis:])
            pieces.append(each.memory[at * size : (at + 1) * size].tolist())
    return made(kind, list(chain.from_iterable(pieces)), tuple(shape))


def stack(parts: Sequence[Any], axis: int = 0) -> ndarray:
    arrays = [_asarray(part) for part in parts]
    if axis:
        raise NotImplementedError("stacking along another axis")
    return concatenate([each.reshape(1, *each.shape) for each in arrays])


def append(one: Any, two: Any) -> ndarray:
    return concatenate([_asarray(one).ravel(), _asarray(two).ravel()])


def where(condition: Any, yes: Any = None, no: Any = None) -> Any:
    condition = _asarray(condition)
    if yes is None:
        return condition.nonzero()
    one, two = _asarray(yes), _asarray(no)
    shape = broadcast_shape([condition.shape, one.shape, two.shape])
    columns = zip(spread(condition, shape), spread(one, shape), spread(two, shape), strict=True)
    return made(together([typed(yes), typed(no)]), [a if chosen else b for chosen, a, b in columns], shape)


def broadcast_to(value: Any, shape: Any) -> ndarray:
    found = _asarray(value)
    return made(found.dtype, spread(found, _shape(shape)), _shape(shape))


def pad(array: ndarray, width: tuple[int, int]) -> ndarray:
    before, behind = (made(array.dtype, [0] * count) for count in width)
    return concatenate([before, array, behind])


def flatnonzero(value: Any) -> ndarray:
    return _asarray(value).ravel().nonzero()[0]


def count_nonzero(value: Any) -> int:
    return sum(map(bool, _asarray(value).memory.tolist()))


def repeat(value: Any, counts: Any) -> ndarray:
    return _asarray(value).reshape(-1).repeat(counts)


def searchsorted(array: Any, values: Any, side: str = "left", sorter: Any = None) -> Any:
    return _asarray(array).searchsorted(values, side, sorter)


def digitize(values: Any, edges: Any) -> ndarray:
    found: ndarray = _asarray(edges).searchsorted(values, "right")
    return found


def sort(value: Any, kind: str = "") -> ndarray:  # noqa: ARG001
    found = _asarray(value)
    return made(found.dtype, sorted(found.memory.tolist()))


def argsort(value: Any, kind: str = "", stable: bool = True) -> ndarray:  # noqa: ARG001
    return _asarray(value).argsort()


def lexsort(keys: Sequence[Any]) -> ndarray:
    columns = [_asarray(key).memory.tolist() for key in reversed(list(keys))]
    rows = list(zip(*columns, strict=True))
    return made(INT, sorted(range(len(rows)), key=rows.__getitem__))


def argmax(value: Any, axis: int | None = None) -> Any:
    return _asarray(value).argmax(axis)


def argmin(value: Any, axis: int | None = None) -> Any:
    return _asarray(value).argmin(axis)


def cumsum(value: Any, out: ndarray | None = None, dtype: Any = None) -> Any:
    return handed(_asarray(value).cumsum(dtype), out)


def diff(value: Any, prepend: Any = None, append: Any = None) -> ndarray:
    found = concatenate([_asarray(each).reshape(-1) for each in (prepend, value, append) if each is not None])
    flat, step = found.memory.tolist(), operator.ne if found.dtype.kind == "b" else operator.sub
    return made(found.dtype, list(map(step, flat[1:], flat)))


def bincount(values: Any, weights: Any = None, minlength: int = 0) -> ndarray:
    numbers = _asarray(values).memory.tolist()
    counts: list[Any] = [0] * max(max(numbers, default=-1) + 1, minlength)
    for number, weight in zip(
        numbers, [1] * len(numbers) if weights is None else _asarray(weights).memory.tolist(), strict=True
    ):
        counts[number] += weight
    return made(INT if weights is None else FLOAT, counts)


def unique(
    value: Any,
    return_index: bool = False,
    return_inverse: bool = False,
    return_counts: bool = False,
    axis: int | None = None,
) -> Any:
    found = _asarray(value)
    items = found.memory.tolist() if axis is None else [tuple(each) for each in (found.T if axis else found).tolist()]
    first: dict[Any, int] = {}
    counts: dict[Any, int] = {}
    for at, item in enumerate(items):
        first.setdefault(item, at)
        counts[item] = counts.get(item, 0) + 1
    ordered = sorted(first)
    extras: dict[str, Callable[[], list[int]]] = {
        "index": lambda: [first[item] for item in ordered],
        "inverse": lambda: list(map({item: at for at, item in enumerate(ordered)}.__getitem__, items)),
        "counts": lambda: [counts[item] for item in ordered],
    }
    asked = compress(extras.values(), (return_index, return_inverse, return_counts))
    told = (_unique_rows(found, ordered, axis), *(made(INT, column()) for column in asked))
    return told if len(told) > 1 else told[0]


def _unique_rows(found: ndarray, ordered: list[Any], axis: int | None) -> ndarray:
    if axis is None:
        return made(found.dtype, ordered)
    width = found.shape[1 - axis] if found.ndim == 2 else 0
    table = made(found.dtype, list(chain.from_iterable(ordered)), (len(ordered), width))
    return table.T if axis == 1 else table


def union1d(one: Any, two: Any) -> Any:
    return unique(append(one, two))


def intersect1d(one: Any, two: Any) -> ndarray:
    other = set(_asarray(two).memory.tolist())
    found = unique(one)
    return made(found.dtype, [each for each in found.memory.tolist() if each in other])


def isin(value: Any, among: Any) -> ndarray:
    found, wanted = (
        _asarray(value),
        set(_asarray(list(among) if isinstance(among, (set, frozenset)) else among).memory.tolist()),
    )
    return made(BOOL, [each in wanted for each in found.memory.tolist()], found.shape)


def clip(value: Any, low: Any, high: Any) -> Any:
    return minimum(maximum(value, low), high)


def median(value: Any) -> float:
    from statistics import median as middle

    flat = _asarray(value).memory.tolist()
    return float64(middle(flat)) if flat else float64(nan)


def _real(op: Callable[[float], float]) -> Callable[[Any], Any]:
    def of(value: Any) -> Any:
        kind = value.dtype if isinstance(value, ndarray) and value.dtype.kind == "f" else FLOAT
        return unary(op, value, kind)

    return of


def _log(op: Callable[[float], float]) -> Callable[[float], float]:
    return lambda x: op(x) if x > 0 else (-inf if x == 0 else nan)


log, log2, exp2 = _real(_log(math.log)), _real(_log(math.log2)), _real(math.exp2)
rint = _real(lambda x: float(round(x)) if math.isfinite(x) else x)
sqrt = _real(lambda x: math.sqrt(x) if x >= 0 else nan)


def isfinite(value: Any) -> Any:
    return math.isfinite(value) if isinstance(value, (int, float)) else unary(math.isfinite, value, BOOL)


def isnan(value: Any) -> Any:
    return value != value if isinstance(value, (int, float)) else unary(math.isnan, value, BOOL)


def abs(value: Any) -> Any:
    return unary(operator.abs, value)


class _TwoPlaced:
    """A function of two with what goes along an array."""

    def __init__(self, op: Callable[[Any, Any], Any], kind: dtype | None = None) -> None:
        self._op, self._kind = op, kind

    def __call__(self, one: Any, two: Any, out: ndarray | None = None) -> Any:
        return handed(binary(self._op, one, two, self._kind), out)

    def accumulate(self, value: Any, out: ndarray | None = None) -> Any:
        array = _asarray(value)
        return handed(made(self._kind or array.dtype, list(accumulate(array.memory.tolist(), self._op))), out)

    def reduce(self, value: Any) -> Any:
        flat = _asarray(value).memory.tolist()
        found: Any = 0 if not flat else list(accumulate(flat, self._op))[-1]
        return found

    def reduceat(self, value: Any, begins: Any) -> ndarray:
        array = _asarray(value)
        flat, at = array.memory.tolist(), _asarray(begins).memory.tolist()
        ends = [*at[1:], len(flat)]
        parts = [flat[a:b] if a < b else [flat[a]] for a, b in zip(at, ends, strict=True)]
        return made(self._kind or array.dtype, [list(accumulate(part, self._op))[-1] for part in parts])


maximum, minimum = _TwoPlaced(max_of), _TwoPlaced(min_of)
bitwise_xor, bitwise_or, bitwise_and = _TwoPlaced(operator.xor), _TwoPlaced(operator.or_), _TwoPlaced(operator.and_)
add, subtract = _TwoPlaced(operator.add), _TwoPlaced(operator.sub)
divide = _TwoPlaced(divided, FLOAT)
logical_or = _TwoPlaced(lambda one, two: bool(one or two), BOOL)
logical_and = _TwoPlaced(lambda one, two: bool(one and two), BOOL)


class errstate:
    """Nothing is said here of divisions by nought."""

    def __init__(self, **_: str) -> None: ...

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...
