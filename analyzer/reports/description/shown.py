"""Whether a capture shows what type a register has, however sure its readings alone make it.

Confidence weighs what moved. What never moved, or hardly ever and only with all the rest, may be a part of its
neighbour or have nothing to do with it: there the capture shows less than the odds say, and two readings are told, or
none.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from ...registers.readings import BlockReadings, Words
from ...registers.roles import OtherReading, RegisterValue

_BOUND_SURE: Final = 0.99  # confidence, where a word that never moved, or never alone, may be of a number or not,
_SLOW_SURE: Final = 0.998  # and where one hardly moved
_EITHER_SURE: Final = 0.97  # of two readings together
_MOVED_SURE: Final = 0.9  # of one of them, where both registers moved
_SLOW: Final = 2  # moves, each together with the register beside: too few to tell that it is no high word
_TORN: Final = 2  # moves of a high word alone, which no number of two words makes


class Shown:
    """The readings of a bus, asked about values of it."""

    def __init__(self, blocks: Iterable[BlockReadings]) -> None:
        self._blocks: dict[tuple[int, str], list[BlockReadings]] = {}
        for block in blocks:
            self._blocks.setdefault((block.unit, block.area), []).append(block)

    def __call__(self, value: RegisterValue) -> bool:
        """Whether the type of a value that moved is shown."""
        if value.kind == "text":
            return True
        read = self._read(value)
        if read is None or not _can_be(value, *read):
            return False
        return value.number_confidence >= _asked(value, *read)

    def either(self, value: RegisterValue) -> OtherReading | None:
        """The one other reading that a value may be, where a register never moved, or never alone: its high word, or
        none of it."""
        other, read = value.runner_up, self._read(value)
        if other is None or read is None or {value.words, other.words} != {1, 2} or value.same_number:
            return None
        whole = "float" not in (value.kind, other.kind) and _can_be(value, *read)
        bound = _has_still_word(value, *read) or (value.confidence >= _MOVED_SURE and _asked(value, *read) > 0)
        return other if whole and bound and value.confidence + other.confidence >= _EITHER_SURE else None

    def _read(self, value: RegisterValue) -> tuple[Words, int, int] | None:
        """The readings (rows) of the longest block that holds a value whole, the value's first column, and the block's
        first address."""
        end = value.address + value.words
        blocks = self._blocks.get((value.unit, value.area), ())
        whole = [each for each in blocks if each.address <= value.address and end <= each.address + each.quantity]
        if not whole:
            return None
        block = max(whole, key=lambda each: (each.count, each.quantity))
        rows, beginning = block.series
        return rows[:beginning], value.address - block.address, block.address


def _can_be(value: RegisterValue, rows: Words, at: int, _: int) -> bool:
    """Whether its moves are those of such a value."""
    torn = value.words == 2 and value.kind != "float" and _is_torn(rows, at, value.order)
    return not torn and _moved_by_itself(rows, at, value.words)


def _moved_by_itself(rows: Words, at: int, words: int) -> bool:
    """Whether a value moved other than from or to 0 together with a register beside it."""
    own, end = rows[:, at : at + words], at + words
    moved = (own[1:] != own[:-1]).any(axis=1)
    turned = own[1:].any(axis=1) != own[:-1].any(axis=1)
    near = rows[:, [n for n in (at - 1, end) if 0 <= n < rows.shape[1]]]
    beside = ((near[1:] == 0) != (near[:-1] == 0)).any(axis=1)
    return bool((moved & ~(turned & beside)).any())


def _is_torn(rows: Words, at: int, order: str | None) -> bool:
    """Whether the high word of two moved while the low one stood."""
    high, low = (at, at + 1) if order in ("ABCD", "BADC") else (at + 1, at)
    moved = rows[1:] != rows[:-1]
    return int((moved[:, high] & ~moved[:, low]).sum()) >= _TORN


def _asked(value: RegisterValue, rows: Words, at: int, begin: int) -> float:
    """The confidence from which such readings show a type; 0: any."""
    moves = _moves_along(rows, at) if value.words == 1 else 0
    if 0 < moves <= _SLOW:
        return _SLOW_SURE
    return _BOUND_SURE if moves or _has_still_word(value, rows, at, begin) else 0.0


def _moves_along(rows: Words, at: int) -> int:
    """The fewest moves of a register or of one beside it that moved, but never without the other; 0: there is none."""
    moved = rows[1:] != rows[:-1]
    pairs = [pair for near in (at - 1, at + 1) if 0 <= near < rows.shape[1] for pair in ((at, near), (near, at))]
    bound = [int(moved[:, one].sum()) for one, other in pairs if not (moved[:, one] & ~moved[:, other]).any()]
    return min(filter(None, bound), default=0)


def _has_still_word(value: RegisterValue, rows: Words, at: int, begin: int) -> bool:
    """Whether a word of a value, or of what else it may be, has been the same all the time, and not 0; readings of
    nothing but 0 aside."""
    columns = set(range(at, at + value.words))
    if value.runner_up is not None:
        first = value.runner_up.address - begin
        columns |= set(range(max(first, 0), min(first + value.runner_up.words, rows.shape[1])))
    words = rows[:, sorted(columns)]
    words = words[words.any(axis=1)]
    return bool(((words == words[:1]).all(axis=0) & words.any(axis=0)).any())
