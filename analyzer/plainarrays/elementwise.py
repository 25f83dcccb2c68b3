"""What is done element by element, and the operators of arrays, which this module gives them."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from .array import asarray, made, ndarray, spread, typed
from .places import broadcast_shape
from .storage import stored
from .types import BOOL, FLOAT, INT, dtype, together


def binary(op: Callable[[Any, Any], Any], one: Any, two: Any, kind: dtype | None = None) -> Any:
    """A function of two, element by element; the type is that which holds both unless given."""
    if kind is None:
        kind = together([typed(one), typed(two)])
    a, b = asarray(one), asarray(two)
    if a.shape == b.shape:
        shape, left, right = a.shape, a.memory.tolist(), b.memory.tolist()
    else:
        shape = broadcast_shape([a.shape, b.shape])
        left, right = spread(a, shape), spread(b, shape)
    values = list(map(op, left, right))
    if not shape:
        return kind.scalar(stored(kind, values)[0])
    return made(kind, values, shape)


def unary(op: Callable[[Any], Any], array: Any, kind: dtype | None = None) -> Any:
    """The same of one."""
    if isinstance(array, (int, float)):
        return (FLOAT if kind is None and isinstance(array, float) else kind or INT).type(op(array))
    array = asarray(array)
    return made(array.dtype if kind is None else kind, list(map(op, array.memory.tolist())), array.shape)


def max_of(one: Any, two: Any) -> Any:
    return one if one != one or one >= two else two


def min_of(one: Any, two: Any) -> Any:
    return one if one != one or one <= two else two


def divided(one: Any, two: Any) -> float:
    """As IEEE 754 divides."""
    if two:
        return float(one / two)
    if not one or one != one:
        return float("nan")
    return float("inf") if one > 0 else float("-inf")


def floored(one: Any, two: Any) -> Any:
    return one // two if two else 0


def left_over(one: Any, two: Any) -> Any:
    return one % two if two else 0


_OPERANDS = (ndarray, int, float, list, tuple)


def _arithmetic(name: str, op: Callable[[Any, Any], Any], only: dtype | None = None) -> None:
    def forward(self: ndarray, other: Any) -> Any:
        return binary(op, self, other, only) if isinstance(other, _OPERANDS) else NotImplemented

    def backward(self: ndarray, other: Any) -> Any:
        return binary(op, other, self, only)

    def inplace(self: ndarray, other: Any) -> ndarray:
        self[...] = forward(self, other)
        return self

    setattr(ndarray, f"__{name}__", forward)
    if only is not BOOL:
        setattr(ndarray, f"__r{name}__", backward)
        setattr(ndarray, f"__i{name}__", inplace)


def _true_division(one: Any, two: Any) -> Any:
    kind = together([typed(one), typed(two)])
    return binary(divided, one, two, kind if kind.kind == "f" else FLOAT)


for _name, _op in {"add": operator.add, "sub": operator.sub, "mul": operator.mul, "floordiv": floored, "mod": left_over,
                   "and": operator.and_, "or": operator.or_, "xor": operator.xor, "lshift": operator.lshift,
                   "rshift": operator.rshift, "pow": operator.pow}.items():  # fmt: skip
    _arithmetic(_name, _op)
for _name in ("eq", "ne", "lt", "le", "gt", "ge"):
    _arithmetic(_name, getattr(operator, _name), BOOL)


def _truediv(self: ndarray, other: Any) -> Any:
    return _true_division(self, other)


def _rtruediv(self: ndarray, other: Any) -> Any:
    return _true_division(other, self)


def _itruediv(self: ndarray, other: Any) -> Any:
    self[...] = _true_division(self, other)
    return self


def _invert(self: ndarray) -> Any:
    return unary(operator.not_ if self.dtype.kind == "b" else operator.invert, self)


def _clip(self: ndarray, low: Any = None, high: Any = None) -> Any:
    found = self if low is None else binary(max_of, self, low)
    return found if high is None else binary(min_of, found, high)


_OTHERS: dict[str, Callable[..., Any]] = {
    "truediv": _truediv,
    "rtruediv": _rtruediv,
    "itruediv": _itruediv,
    "invert": _invert,
    "neg": lambda self: unary(operator.neg, self),
    "abs": lambda self: unary(abs, self),
}
for _name, _of in _OTHERS.items():
    setattr(ndarray, f"__{_name}__", _of)
ndarray.clip = _clip
