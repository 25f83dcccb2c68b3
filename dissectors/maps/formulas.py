"""Values that a device's manual computes from others: a column `formula` of numbers, `raw` and other values' names.

    [Voltage offset] + raw / 65535 * [Voltage gain] * {0: 27.5, 1: 55, 11: [Voltage limit]}[Supply type]; V

A name in brackets is the value of that name in the same map, in its unit of measure; a mapping in braces is looked up
by the value behind it. Behind a semicolon stands the unit of the result: the row's own is that of the raw number, which
is all that there is where the others are not known. Nothing else is possible: no call and no power, so that a formula
in a stranger's map does no harm.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Final

_LONGEST: Final = 300  # characters
_NAME: Final = re.compile(r"(\}\s*)?\[([^\[\]]+)\]")
_OPERATORS: Final[Mapping[type, Callable[[float, float], float]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
FORMULA_EXPECTED: Final = "numbers, raw, [names of values] and + - * /, or {states: numbers}[name]"
Values = Callable[[str], float | None]


class FormulaError(ValueError):
    """A text that is no formula."""


class Formula:
    """How a value, in `unit`, follows from its raw number and from other values; `names` are those."""

    def __init__(self, text: str) -> None:
        names: list[str] = []
        computed, _, unit = text.partition(";")

        def variable(match: re.Match[str]) -> str:
            names.append(match[2].strip())
            return f"{match[1]}[v{len(names) - 1}]" if match[1] else f" v{len(names) - 1} "

        try:
            source = _NAME.sub(variable, computed[:_LONGEST])
            self._tree = ast.parse(source.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise FormulaError(text) from None
        self.names, self.unit = tuple(names), unit.strip()
        if len(text) > _LONGEST or not all(map(_is_possible, ast.walk(self._tree))):
            raise FormulaError(text)

    def value(self, raw: float, values: Values) -> float | None:
        """The value of a raw number; None where one that it follows from is not known, or nothing follows."""
        try:
            number = self._of(self._tree, raw, values)
        except (ArithmeticError, LookupError, RecursionError):
            return None
        return float(f"{number:.12g}") if math.isfinite(number) else None

    def _of(self, node: ast.AST, raw: float, values: Values) -> float:
        match node:
            case ast.Constant(value=int() | float() as number):
                return number
            case ast.Name(id="raw"):
                return raw
            case ast.Name(id=name):
                return _known(values(self.names[int(name[1:])]))
            case ast.UnaryOp(operand=inner):
                return -self._of(inner, raw, values)
            case ast.BinOp(left=left, op=operation, right=right):
                return _OPERATORS[type(operation)](self._of(left, raw, values), self._of(right, raw, values))
            case ast.Subscript(value=ast.Dict(keys=keys, values=choices), slice=chosen):
                state = self._of(chosen, raw, values)
                return next(self._chosen(keys, choices, state, raw, values))
        raise LookupError

    def _chosen(
        self, keys: list[ast.expr | None], choices: list[ast.expr], state: float, raw: float, values: Values
    ) -> Iterator[float]:
        for key, choice in zip(keys, choices, strict=True):
            if isinstance(key, ast.Constant) and key.value == state:
                yield self._of(choice, raw, values)
        raise LookupError


def _known(value: float | None) -> float:
    if value is None:
        raise LookupError
    return value


def _is_possible(node: ast.AST) -> bool:
    """Whether a part of a formula is one that it may have."""
    match node:
        case ast.Constant(value=bool() | str() | bytes() | complex() | None):
            return False
        case ast.Name(id=name):
            return re.fullmatch(r"raw|v\d+", name) is not None
        case ast.BinOp(op=operation):
            return type(operation) in _OPERATORS
        case ast.UnaryOp(op=operation):
            return isinstance(operation, ast.USub)
        case ast.Subscript(value=value):
            return isinstance(value, ast.Dict)
        case ast.Constant() | ast.Dict() | ast.operator() | ast.unaryop() | ast.expr_context():
            return True
    return False


@lru_cache(maxsize=256)
def formula_of(text: str) -> Formula:
    """The formula of a cell; FormulaError where it is none."""
    return Formula(text)
