"""Why a value is read as it is, in words for an engineer."""

from __future__ import annotations

from collections.abc import Sequence

from .cutting import Cut
from .hypotheses import HYPOTHESES

_SHOWN = 0.6  # below this confidence two readings are shown
_NAMED = 4  # units


def type_words(number: int) -> str:
    """A hypothesis in words."""
    hypothesis = HYPOTHESES[number]
    return f"{16 * hypothesis.words}-bit{' float' if hypothesis.is_float else ''}" + (
        f" {hypothesis.order}" if hypothesis.order else ""
    )


def reasons(cut: Cut, words: list[list[int]], *, shared: str | None, sisters: Sequence[int] = ()) -> str:
    """One line about a value that moved; `words` are the first and the last reading of its registers, `sisters` the
    units that speak for it too."""
    hypothesis = HYPOTHESES[cut.number]
    first, last = words
    lines = []
    if hypothesis.words > 1:
        quiet = [offset for offset in range(hypothesis.words) if not cut.run.moved[cut.at + offset]]
        if quiet:
            names = ", ".join(f"r{cut.run.address + cut.at + offset}" for offset in quiet)
            lines.append(f"{names} has been {'/'.join(f'{first[offset]:04X}' for offset in quiet)} all the time")
        elif hypothesis.is_float:
            lines.append("the registers move as one float")
        else:
            lines.append("the low word runs through, the high word carries")
        if shared:
            lines.append(shared)
    elif first != last or cut.moved:
        lines.append("moves by itself")
    if sisters:
        lines.append(f"weighed together with {_units(sisters)}, asked the same and answering alike")
    if cut.second and cut.confidence < _SHOWN:
        at, number, share = cut.second
        rival = f"{type_words(number)} at {cut.run.address + at} ({share:.0%})"
        lines.append(f"{type_words(cut.number)} ({cut.confidence:.0%}) or {rival}")
    return "; ".join(lines)


def _units(units: Sequence[int]) -> str:
    if len(units) > _NAMED:
        return f"{len(units)} other units"
    return f"unit {units[0]}" if len(units) == 1 else f"units {', '.join(map(str, units))}"
