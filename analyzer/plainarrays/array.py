"""The array: elements in a memoryview, so that stretches are views and types can be looked at as others."""

from __future__ import annotations

import array as arrays
import operator
from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate, chain, compress, repeat
from math import prod
from types import GenericAlias
from typing import Any

from .folds import extreme, mean_of
from .places import Shape, grid, lanes, listed, stretched, without_ellipsis
from .storage import Memory, stored, wrapped
from .types import BOOL, FLOAT, INT, UINT, dtype, together, type_of
from .windows import ByteWindows


class ndarray:
    """Elements in C order, `memory`; of one dimension they may lie apart, so that each stretch and column is a view."""

    __class_getitem__: Any = classmethod(GenericAlias)
    __slots__ = ("__weakref__", "dtype", "memory", "shape")
    clip: Any  # as all that is done element by element, from `elementwise`

    def __new__(cls, memory: Any, kind: Any, shape: Any, *more: Any) -> Any:
        return ByteWindows(shape, int(kind[1:])) if more else object.__new__(cls)

    def __init__(self, memory: Memory, kind: dtype, shape: Shape) -> None:
        self.memory, self.dtype, self.shape = memory, kind, shape

    @property
    def size(self) -> int:
        return prod(self.shape)

    @property
    def ndim(self) -> int:
        return len(self.shape)

    @property
    def itemsize(self) -> int:
        return self.dtype.itemsize

    @property
    def nbytes(self) -> int:
        return self.size * self.dtype.itemsize

    @property
    def data(self) -> Memory:
        return self.memory

    @property
    def T(self) -> ndarray:
        if self.ndim < 2:
            return self
        rows, columns = self.shape
        flat = self.memory.tolist()
        return made(self.dtype, [flat[r * columns + c] for c in range(columns) for r in range(rows)], (columns, rows))

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("len() of unsized object")
        return self.shape[0]

    def __iter__(self) -> Iterator[Any]:
        if self.ndim == 1:
            return map(self.dtype.scalar, self.memory.tolist())
        return (self[row] for row in range(len(self)))

    def __bool__(self) -> bool:
        return bool(self.item())

    def __index__(self) -> int:
        if self.size != 1:
            raise TypeError("only arrays of one element are indices")
        return operator.index(self.memory[0])

    def __int__(self) -> int:
        return int(self.item())

    def __float__(self) -> float:
        return float(self.item())

    def __repr__(self) -> str:
        return f"array({self.tolist()}, {self.dtype.name})"

    def __buffer__(self, _: int) -> Memory:
        return self.memory

    def __contains__(self, value: Any) -> bool:
        return value in self.memory.tolist()

    def __copy__(self) -> ndarray:
        return self.copy()

    def __deepcopy__(self, _: Any) -> ndarray:
        return self.copy()

    __hash__ = None  # type: ignore[assignment]

    # taking elements

    def __getitem__(self, key: Any) -> Any:
        if self.ndim == 1:
            if isinstance(key, slice):
                memory = self.memory[key]
                return ndarray(memory, self.dtype, (len(memory),))
            if isinstance(key, int) and not isinstance(key, bool):
                return self.dtype.scalar(self.memory[key])
            if isinstance(key, (ndarray, list)):
                return self._picked(key)
        return self._general(key if isinstance(key, tuple) else (key,))

    def _picked(self, key: Any) -> ndarray:
        """Rows by a mask or by numbers."""
        key = asarray(key) if isinstance(key, ndarray) or key else made(INT, [])
        if key.dtype.kind == "b":
            if len(key) != len(self):
                raise IndexError(f"a mask of {len(key)} for {len(self)} rows")
            if key.ndim == self.ndim:
                return made(self.dtype, list(compress(self.memory.tolist(), key.memory.tolist())))
            key = key.nonzero()[0]
        rows: ndarray = self.take(key, 0)
        return rows

    def _general(self, keys: tuple[Any, ...]) -> Any:
        """By slices, numbers, new axes, masks and lists of numbers, axis by axis."""
        keys = without_ellipsis(keys, self.ndim)
        if any(isinstance(each, (ndarray, list)) for each in keys):
            return self._by_lists(keys)
        places, shape = grid(keys, self.shape)
        if not shape:
            return self.dtype.scalar(self.memory[places[0]])
        if isinstance(places, range):
            return ndarray(self.memory[places.start : places.stop : places.step], self.dtype, shape)
        return self._at(places, shape)

    def _at(self, places: Sequence[int], shape: Shape) -> ndarray:
        flat = self.memory.tolist()
        return made(self.dtype, [flat[place] for place in places], shape)

    def _by_lists(self, keys: tuple[Any, ...]) -> ndarray:
        if len(keys) == 1:
            if isinstance(keys[0], ndarray) and keys[0].ndim > 1 and keys[0].dtype.kind != "b":
                flat: ndarray = self.take(made(INT, keys[0].memory.tolist()), 0)
                return flat.reshape(*keys[0].shape, *self.shape[1:])
            return self._picked(keys[0])
        return self._at(*listed(_numbered(keys), self.shape))

    def __setitem__(self, key: Any, value: Any) -> None:
        if self.ndim == 1 and isinstance(key, int) and not isinstance(key, bool):
            self.memory[key] = wrapped(self.dtype, value.item() if isinstance(value, ndarray) else value)
            return
        places, shape = self._places(key)
        values = stored(self.dtype, spread(asarray(value), shape))
        if isinstance(places, range):
            self.memory[places.start : places.stop : places.step] = values
            return
        for place, each in zip(places, values.tolist(), strict=True):
            self.memory[place] = each

    def _places(self, key: Any) -> tuple[range | list[int], Shape]:
        """Where the elements of any key lie."""
        if isinstance(key, ndarray) and key.dtype.kind == "b" and key.ndim == self.ndim:
            chosen = [at for at, wanted in enumerate(key.memory.tolist()) if wanted]
            return chosen, (len(chosen),)
        keys = without_ellipsis(key if isinstance(key, tuple) else (key,), self.ndim)
        if any(isinstance(each, (ndarray, list)) for each in keys):
            return listed(_numbered(keys), self.shape)
        return grid(keys, self.shape)

    # as other things

    def tolist(self) -> Any:
        flat: list[Any] = self.memory.tolist()
        if not self.shape:
            return flat[0]
        for count in reversed(self.shape[1:]):
            flat = (
                [flat[at : at + count] for at in range(0, len(flat), count)]
                if count
                else [[] for _ in range(len(self))]
            )
        return flat

    def item(self, place: int | None = None) -> Any:
        if place is not None:
            return self.memory[place]
        if self.size != 1:
            raise ValueError("can only convert an array of size 1 to a Python scalar")
        return self.memory[0]

    def tobytes(self) -> bytes:
        return bytes(self.memory.tobytes())

    def copy(self) -> ndarray:
        return made(self.dtype, self.memory.tolist(), self.shape)

    def astype(self, kind: Any, copy: bool = True) -> ndarray:
        kind = dtype(kind)
        if kind is self.dtype and not copy:
            return self
        values = self.memory.tolist()
        if self.dtype.kind == "f" and kind.kind in "iu":
            values = [wrapped(kind, value) for value in values]
        return made(kind, values, self.shape)

    def view(self, kind: Any) -> ndarray:
        kind = dtype(kind)
        memory = (
            self.memory if self.memory.contiguous else memoryview(arrays.array(self.dtype.format, self.memory.tolist()))
        )
        memory = memory.cast("B").cast(kind.format) if kind.format != "B" else memory.cast("B")
        last = self.shape[-1] * self.dtype.itemsize // kind.itemsize
        return ndarray(memory, kind, (*self.shape[:-1], last))

    def reshape(self, *shape: Any) -> ndarray:
        wanted = list(shape[0] if len(shape) == 1 and not isinstance(shape[0], int) else shape)
        if -1 in wanted:
            rest = prod(each for each in wanted if each != -1)
            wanted[wanted.index(-1)] = self.size // rest if rest else 0
        if prod(wanted) != self.size:
            raise ValueError(f"cannot reshape {self.shape} into {tuple(wanted)}")
        return ndarray(self.memory, self.dtype, tuple(wanted))

    def ravel(self) -> ndarray:
        return ndarray(self.memory, self.dtype, (self.size,))

    def fill(self, value: Any) -> None:
        self[...] = value

    # by rows

    def take(self, which: Any, axis: int | None = None, mode: str = "raise", out: ndarray | None = None) -> Any:
        which = asarray(which)
        if mode == "clip":
            last = (self.size if axis is None else self.shape[axis]) - 1
            which = made(INT, [min(max(each, 0), last) for each in which.memory.tolist()], which.shape)
        if out is not None:
            return handed(self.take(which, axis), out)
        if self.ndim > 1 and axis is None:
            return self.ravel().take(which)
        numbers = which.memory.tolist()
        if self.ndim == 1:
            flat = self.memory.tolist()
            if not which.shape:
                return self[numbers[0]]
            return made(self.dtype, [flat[number] for number in numbers], which.shape)
        width, count, flat = prod(self.shape[1:]), len(self), self.memory.tolist()
        rows = [flat[(n % count if n < 0 else n) * width :][:width] for n in numbers]
        if any(not -count <= n < count for n in numbers):
            raise IndexError("a row that is not there")
        return made(self.dtype, list(chain.from_iterable(rows)), (*which.shape, *self.shape[1:]))

    def compress(self, mask: Any, axis: int | None = None) -> ndarray:  # noqa: ARG002
        rows: ndarray = self[asarray(mask).nonzero()[0]]
        return rows

    def put(self, which: Any, values: Any) -> None:
        self.ravel()[asarray(which)] = values

    def repeat(self, counts: Any) -> ndarray:
        counts = asarray(counts)
        times = repeat(int(counts.memory[0])) if counts.size == 1 else counts.memory.tolist()
        pairs = zip(self.memory.tolist(), times, strict=False)
        return made(self.dtype, list(chain.from_iterable(repeat(each, n) for each, n in pairs)))

    def nonzero(self) -> tuple[ndarray, ...]:
        at = [place for place, each in enumerate(self.memory.tolist()) if each]
        if self.ndim == 1:
            return (made(INT, at),)
        steps = [prod(self.shape[i + 1 :]) for i in range(self.ndim)]
        return tuple(
            made(INT, [place // step % count for place in at]) for step, count in zip(steps, self.shape, strict=True)
        )

    def searchsorted(self, values: Any, side: str = "left", sorter: Any = None) -> Any:
        from bisect import bisect_left, bisect_right

        held = (self if sorter is None else self[sorter]).memory.tolist()
        find = bisect_left if side == "left" else bisect_right
        if isinstance(values, (int, float)):
            return INT.type(find(held, values))
        wanted = asarray(values)
        return made(INT, [find(held, each) for each in wanted.memory.tolist()], wanted.shape)

    def argsort(self, kind: str = "", stable: bool = True) -> ndarray:  # noqa: ARG002
        flat = self.memory.tolist()
        return made(INT, sorted(range(len(flat)), key=flat.__getitem__))

    def sort(self, kind: str = "") -> None:  # noqa: ARG002
        self[...] = made(self.dtype, sorted(self.memory.tolist()))

    # over rows

    def _over(self, axis: int | None, fold: Callable[[list[Any]], Any], kind: dtype) -> Any:
        if axis is None or self.ndim == 1:
            return kind.scalar(fold(self.memory.tolist()))
        along, shape = lanes(self.shape, axis % self.ndim)
        flat = self.memory.tolist()
        return made(kind, [fold(flat[lane]) for lane in along], shape)

    def sum(self, axis: int | None = None, dtype: Any = None) -> Any:
        return self._over(axis, sum, self._total(dtype))

    def mean(self, axis: int | None = None) -> Any:
        return self._over(axis, mean_of, FLOAT)

    def any(self, axis: int | None = None) -> Any:
        return self._over(axis, any, BOOL)

    def all(self, axis: int | None = None) -> Any:
        return self._over(axis, all, BOOL)

    def max(self, axis: int | None = None, initial: Any = None) -> Any:
        return self._over(axis, extreme(max, initial), self.dtype)

    def min(self, axis: int | None = None, initial: Any = None) -> Any:
        return self._over(axis, extreme(min, initial), self.dtype)

    def argmax(self, axis: int | None = None) -> Any:
        return self._over(axis, lambda each: each.index(max(each)), INT)

    def argmin(self, axis: int | None = None) -> Any:
        return self._over(axis, lambda each: each.index(min(each)), INT)

    def cumsum(self, dtype: Any = None) -> ndarray:
        kind = self._total(dtype)
        return made(kind, list(accumulate(map(kind.plain, self.memory.tolist()))))

    def _total(self, kind: Any) -> dtype:
        """The type of a sum, unless told."""
        return {"b": INT, "i": INT, "u": UINT, "f": self.dtype}[self.dtype.kind] if kind is None else dtype(kind)


def _numbered(keys: tuple[Any, ...]) -> tuple[Any, ...]:
    """Lists and masks of a key as shapes with numbers; slices as they are."""
    found: list[Any] = []
    for key in keys:
        if isinstance(key, slice):
            found.append(key)
            continue
        numbers = asarray(key)
        numbers = numbers.nonzero()[0] if numbers.dtype.kind == "b" else numbers
        found.append((numbers.shape, numbers.memory.tolist()))
    return tuple(found)


def made(kind: dtype, values: Sequence[Any], shape: Shape | None = None) -> ndarray:
    """A new array."""
    return ndarray(stored(kind, values), kind, (len(values),) if shape is None else shape)


def typed(value: Any) -> tuple[dtype, bool]:
    """The type of what an array is made of, and whether it is weak, as `type_of` has it."""
    return type_of(value) if isinstance(value, (int, float)) else (asarray(value).dtype, False)


def handed(found: Any, out: ndarray | None) -> Any:
    """What was found, in the array that is given for it, if one is."""
    if out is None:
        return found
    out[...] = found
    return out


def asarray(value: Any, kind: Any = None) -> ndarray:
    """An array of whatever it is; the same one where it is one already."""
    if isinstance(value, ndarray):
        return value if kind is None or dtype(kind) is value.dtype else value.astype(kind)
    if isinstance(value, (int, float)):
        return made(type_of(value)[0] if kind is None else dtype(kind), [value], ())
    if isinstance(value, (memoryview, bytearray, bytes)) and not (
        isinstance(value, memoryview) and value.format != "B"
    ):
        return made(dtype("u1" if kind is None else kind), list(value))
    flat, shape = _flattened(list(value))
    found = together([type_of(each) for each in flat]) if kind is None and flat else dtype(kind or float)
    return made(found, flat, shape)


def _flattened(values: list[Any]) -> tuple[list[Any], Shape]:
    if values and isinstance(values[0], (list, tuple, ndarray, range)):
        parts = [
            (each.memory.tolist(), each.shape) if isinstance(each, ndarray) else _flattened(list(each))
            for each in values
        ]
        return list(chain.from_iterable(flat for flat, _ in parts)), (len(values), *parts[0][1])
    return [each.item() if isinstance(each, ndarray) else each for each in values], (len(values),)


def spread(array: ndarray, shape: Shape) -> list[Any]:
    """Its elements, stretched to a shape."""
    flat: list[Any] = array.memory.tolist()
    if array.shape == shape:
        return flat
    if array.size == 1:
        return flat * prod(shape)
    return [flat[place] for place in stretched(array.shape, shape)]
