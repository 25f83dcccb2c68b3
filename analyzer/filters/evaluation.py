"""Which rows pass: a tree over columns, slice by slice.

Cheap tests look at whole slices. A dear one (bytes, contents, words) is asked only where the ones before it have left
the matter open, in blocks of rows, so that a conjunction with a cheap test in it stays cheap.

A filter over an analysis as it streams by: exports and reports see only what passes. A row passes or not by itself. A
transaction passes with its request or with its answer, whole, so that a request is never called unanswered because its
answer was filtered away. Findings pass with the row that they stand on; those about the bus as a whole stay.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..languages import tr
from ..tables.columns import decode
from ..tables.transactions import TransactionRows
from . import FilterError
from .fields import Cost, cost
from .slices import BLOCK, Each, Mask, TableSlice
from .table import BatchTable, FilterTable, narrowed
from .tree import And, Bound, Chars, Node, Not, Or, Same, Since, Spans, Test, parts, tests

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps

    from ..core import Analysed
    from ..tables.schema import Rows

_SLICE: Final = 1 << 16  # rows
_FURTHEST: Final = 1 << 62


def passing(node: Node, table: FilterTable) -> Mask:
    """Which rows of a table pass. Raises FilterError where a test cannot be made of it."""
    node = resolved(node, table.line, table.origin_ns)
    passed = np.empty(len(table), np.bool_)
    for first in range(0, len(table), _SLICE):
        last = min(first + _SLICE, len(table))
        passed[first:last] = _passing(node, TableSlice(table, first, last), None)
    return passed


def resolved(node: Node, line: LineSettings, origin_ns: int) -> Node:
    """The same with all bounds as numbers. Raises FilterError for characters where the line's speed is not known."""
    if isinstance(node, Test):
        if not isinstance(node.wanted, Spans):
            return node
        spans = (
            replace(span, low=_bound_value(span.low, line, origin_ns), high=_bound_value(span.high, line, origin_ns))
            for span in node.wanted.spans
        )
        return replace(node, wanted=Spans(tuple(spans)))
    inner = tuple(resolved(part, line, origin_ns) for part in parts(node))
    return replace(node, parts=inner) if isinstance(node, And | Or) else replace(node, part=inner[0])


def _bound_value(bound: Bound | None, line: LineSettings, origin_ns: int) -> int | float | None:
    if isinstance(bound, Chars):
        character_ns = line.nominal_character_ns
        if character_ns is None:
            raise FilterError(tr("the line's speed is not known here: give the time in us or ms"), bound.column)
        return bound.count * character_ns
    number = bound.ns + origin_ns if isinstance(bound, Since) else bound
    return max(-_FURTHEST, min(number, _FURTHEST)) if isinstance(number, int) else number


def _passing(node: Node, section: TableSlice, requested: Mask | None) -> Mask:
    """Which rows pass, of those that are asked for (None: all); what is said of others means nothing."""
    if isinstance(node, Not):
        return ~_passing(node.part, section, requested)
    if isinstance(node, And):
        for part in node.parts:
            if requested is not None and not requested.any():
                break
            mask = _passing(part, section, requested)
            requested = mask if requested is None else requested & mask
        assert requested is not None
        return requested
    if isinstance(node, Or):
        passed = np.zeros(len(section), np.bool_)
        for part in node.parts:
            dear = cost(part) >= Cost.BYTES
            passed |= _passing(
                part, section, (~passed if requested is None else requested & ~passed) if dear else requested
            )
        return passed
    if cost(node) >= Cost.BYTES and len(section) > BLOCK:
        return _by_blocks(node, section, requested)
    if isinstance(node, Same):
        return _same(node, section, requested)
    values = node.field.get(section, requested)
    if node.wanted is None:
        return values.valid()
    good = values.passing(node.wanted)
    return values.valid() & ~good if node.negated else good


def _same(node: Same, section: TableSlice, requested: Mask | None) -> Mask:
    """Rows with a value of which all is true."""
    mask = np.zeros(len(section), np.bool_)
    some = section.some(requested)
    each = section.each if some is None else Each(decode(some[0]))
    good = each.rows[_of_values(node.part, each)]
    if some is not None:
        good = some[1][good]
    mask[good[good >= 0]] = True
    return mask


def _by_blocks(node: Test | Same, section: TableSlice, requested: Mask | None) -> Mask:
    mask = np.zeros(len(section), np.bool_)
    for first in range(0, len(section), BLOCK):
        selected = None if requested is None else requested[first : first + BLOCK]
        if selected is None or selected.any():
            mask[first : first + BLOCK] = _passing(node, section.block(first // BLOCK), selected)
    return mask


def _of_values(node: Node, each: Each) -> Mask:
    """Which single values pass."""
    if isinstance(node, Test):
        assert node.field.each is not None
        values = node.field.each(each)
        if node.wanted is None:
            return values.valid()
        good = values.passing(node.wanted)
        return values.valid() & ~good if node.negated else good
    masks = [_of_values(part, each) for part in parts(node)]
    if isinstance(node, Not):
        return ~masks[0]
    joined: Mask = (np.logical_and if isinstance(node, And) else np.logical_or).reduce(masks)
    return joined


# A filter ready for use, and the check of one that is still being typed.


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

    def mask(self, table: FilterTable) -> NDArray[np.bool_]:
        """Which rows of a table pass (bool, one a row).

        Raises FilterError where it counts in characters and the table's line has no known speed.
        """
        return np.ones(len(table), np.bool_) if self.node is None else passing(self.node, table)


def compile_filter(text: str, line: LineSettings | None = None, charts: UnitMaps | None = None) -> Filter:
    """A filter from its text; an empty one lets everything pass.

    With `line` it is also checked that times in characters can be told there; `charts` are the register maps of units,
    which `value("NAME")` and `name` need. Raises FilterError.
    """
    from .parsing import parsed  # the parser's library takes a moment to import

    node = parsed(text, charts)
    if node is None:
        return Filter(text, frozenset(), False, None)
    if line is not None:
        resolved(node, line, 0)
    used = [test.field for test in tests(node)]
    return Filter(text, frozenset(each.name for each in used), any(each.settled for each in used), node)


def check(text: str, line: LineSettings | None = None, charts: UnitMaps | None = None) -> FilterError | None:
    """What is wrong with a filter; None for nothing."""
    try:
        compile_filter(text, line, charts)
    except FilterError as error:
        return error
    return None


def filtered(analysed: Iterable[Analysed], wanted: Filter, line: LineSettings) -> Iterator[Analysed]:
    """What passes of each batch, as batches of its own, some of them empty. Raises FilterError."""
    passing = _FilteredPairs(wanted, line)
    return (passing.of(each) for each in analysed)


class _FilteredPairs:
    """Holds what spans two batches: transactions whose answer is still to come."""

    def __init__(self, wanted: Filter, line: LineSettings) -> None:
        self._wanted = wanted
        self._line = line
        self._origin_ns: int | None = None
        self._open: TransactionRows = TransactionRows.zeros(0)
        self._request_passed = np.zeros(0, np.bool_)  # of those: whether the request passed
        self._behind = 0

    def of(self, analysed: Analysed) -> Analysed:
        batch, rows = analysed.batch, analysed.batch.rows
        if self._origin_ns is None and len(rows):
            self._origin_ns = int(rows.t_start_ns[0])
        self._behind = max(self._behind, int(rows.index.max(initial=-1)) + 1)
        pairs = TransactionRows.joined((self._open, analysed.transactions))
        mask = self._wanted.mask(BatchTable(batch, self._line, transactions=pairs, origin_ns=self._origin_ns))
        part = narrowed(batch, mask)
        passed = np.concatenate((self._request_passed, np.zeros(len(analysed.transactions), np.bool_)))
        passed |= _among(pairs.request, part.rows) | _among(pairs.response, part.rows)
        settled = pairs.response < self._behind
        self._open, self._request_passed = pairs[~settled], passed[~settled]
        findings = analysed.findings if part.findings is None else part.findings
        return replace(analysed, batch=part, transactions=pairs[settled & passed], findings=findings)


def _among(indices: NDArray[np.int64], rows: Rows) -> NDArray[np.bool_]:
    """Which frames, by index, are among rows."""
    among: NDArray[np.bool_] = (indices >= 0) & np.isin(indices, rows.index)
    return among
