"""A filter ready for use, and the check of one that is still being typed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from .errors import FilterError
from .evaluation import passing, resolved
from .parsing import parsed
from .table import Table
from .tree import Node, tests


@dataclass(frozen=True, slots=True)
class Filter:
    """A filter.

    `fields` are the names of the fields that it speaks of. `settled` says that one of them is only known once later
    frames have come (findings, retries, late and missing answers): on rows as they come, it finds less.
    """

    text: str
    fields: frozenset[str]
    settled: bool
    node: Node | None = field(repr=False)

    def mask(self, table: Table) -> NDArray[np.bool_]:
        """Which rows of a table pass (bool, one a row).

        Raises FilterError where it counts in characters and the table's line has no known speed.
        """
        return np.ones(len(table), np.bool_) if self.node is None else passing(self.node, table)


def compile_filter(text: str, line: LineSettings | None = None) -> Filter:
    """A filter from its text; an empty one lets everything pass.

    With `line` it is also checked that times in characters can be told there. Raises FilterError.
    """
    node = parsed(text)
    if node is None:
        return Filter(text, frozenset(), False, None)
    if line is not None:
        resolved(node, line, 0)
    used = [test.field for test in tests(node)]
    return Filter(text, frozenset(each.name for each in used), any(each.settled for each in used), node)


def check(text: str, line: LineSettings | None = None) -> FilterError | None:
    """What is wrong with a filter; None for nothing."""
    try:
        compile_filter(text, line)
    except FilterError as error:
        return error
    return None
