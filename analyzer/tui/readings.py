"""What a poll carries, on a line: values by what they mean, or the registers themselves where the user wants these.

A name is told once: of the next one only the words that differ, as `Voltage L1 230.1 V, L2 229.8 V`. Values without a
name have their register's number, the first of a run alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, cast

from rich.cells import cell_len

from dissectors.values import Area, harmless, logical

from .paint import StyledText

if TYPE_CHECKING:
    from ..model.meanings import NamedReading
    from ..model.polls import TransactionValues
    from .desk import ViewState

_WORD: Final = 5  # columns of a register's value
_BIT_AREAS: Final = "01"


def carried_values(
    desk: ViewState, poll: TransactionValues, room: int, *, only_changed: bool = False
) -> list[StyledText]:
    """The values in about `room` columns; one that is another than last time has a star, and stands out. With
    `only_changed` those alone, as they were and as they are."""
    if desk.raw or not desk.meanings.means(poll):
        return _changed_words(poll) if only_changed else _words(poll, room)
    readings = desk.meanings.readings(poll)
    return list(_named_changes(readings, room) if only_changed else _named(readings, room))


def _named(readings: Iterator[NamedReading], room: int) -> Iterator[StyledText]:
    before: NamedReading | None = None
    for reading in readings:
        if room < 0:
            return
        label = told_label(reading, before)
        text = f"{'*' if reading.changed else ' '}{harmless(reading.text)} "
        if label:
            room -= cell_len(label) + 1
            yield StyledText(f" {label}", "place")
        yield StyledText(text, "moved" if reading.changed else "dim" if reading.meaning.is_plain else "")
        room -= cell_len(text)
        before = reading


def _named_changes(readings: Iterator[NamedReading], room: int) -> Iterator[StyledText]:
    before: NamedReading | None = None
    for reading in readings:
        if not reading.changed:
            continue
        if room < 0:
            return
        label, was = told_label(reading, before, alone=True), reading.before
        measure = f" {reading.meaning.measure}" if reading.meaning.measure else ""
        if measure and was.endswith(measure) and reading.text.endswith(measure):
            was = was.removesuffix(measure)
        text = f"{harmless(was)}→{harmless(reading.text)} "
        room -= cell_len(label) + cell_len(text) + 2
        yield StyledText(f" {label} ", "place")
        yield StyledText(text, "moved")
        before = reading


def told_label(reading: NamedReading, before: NamedReading | None, *, alone: bool = False) -> str:
    """What a value is called behind the one `before` it; `alone`: values between may be left out, so that one without
    a name always has its number."""
    if not reading.meaning.name:
        follows = reading.at == 0 or (before is not None and not before.meaning.name)  # the line has the first number
        return "" if follows and not alone else reading.register
    words = harmless(reading.meaning.name).split()
    shared = 0
    if before is not None and before.meaning.name:
        for own, other in zip(words[:-1], harmless(before.meaning.name).split()[:-1], strict=False):
            if own != other:
                break
            shared += 1
    return " ".join(words[shared:])


def _words(poll: TransactionValues, room: int) -> list[StyledText]:
    """Registers below each other."""
    width = 1 if poll.register[:1] in _BIT_AREAS and len(poll.register) > 1 else _WORD
    out = []
    for i, value in enumerate(poll.values[: room // (width + 1) + 2]):
        star = "*" if i in poll.changed else " "
        out.append(StyledText(f"{star}{value:>{width}}", "moved" if i in poll.changed else ""))
    return out


def _changed_words(poll: TransactionValues) -> list[StyledText]:
    """Only the registers that changed, by number: `40101 230→231`."""
    out = []
    for i in sorted(poll.changed):
        number = logical(int(poll.register[1:]) - 1 + i, cast(Area, f"{poll.register[0]}x"))
        out += [StyledText(f" {number} ", "place"), StyledText(f"{poll.before[i]}→{poll.values[i]} ", "moved")]
    return out
