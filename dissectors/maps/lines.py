"""Lines that say a register each: entries of a list with what stands indented below them, constants with comments.

    40101: Level, uint16, 0.1 cm, R
    - **0x0010** Supply temperature (int16, 0.1 °C)
    4.1. Register 40004-40005 - Energy
         32 bits unsigned. Scale 0.1. Unit: kWh. Read only.
    #define FLOW 0x20  /* R, uint32, 0.001 m3/h */

Behind address and name a line has parts in any order. A part that begins with the heading of a column is of that; else
the judge of columns says of it alone whether it is the type, the unit, the factor or the access; of which it knows
nothing, that is what most lines have in this place. An entry's name ends where the first part begins that is known.
Lines between are titles.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from .roles import WHOLE, heading_bits, plain_heading, roles_of_part
from .sheets import MapSheet, notes_of_cut
from .vocabulary import form, roles
from .written import numbers_in

_LONGEST: Final = 300  # characters of a line that says one thing
_MOST_BELOW: Final = 8  # lines of one entry
_FEW: Final = 2
_MARK: Final = re.compile(r"\s*(?:[;|()\[\]]|,(?!\d)|(?<=[^\s.])\.(?=\s|$)|:\s|\s[-–—]\s|\s{2,}|\t)\s*")
_COLUMNS: Final = ("address", "name", "type", "unit", "scale", "access", "description")


@dataclass(frozen=True, slots=True)
class _RegisterLine:
    """What a line says: behind the name `parts`, each with the roles that it may have, the surest first."""

    address: str
    name: str
    parts: Sequence[tuple[str, Sequence[str]]]
    is_entry: bool = False


def line_sheets(text: str, most: int) -> Iterator[MapSheet]:
    """The registers that lines say, with the titles between them, as a sheet; none where a line at most does.

    Many lines begin with a number: of entries, most must tell more than a name.
    """
    every = text.splitlines()
    shown = [*_with_those_below([line[:_LONGEST] for line in every[:most]])]
    found: list[_RegisterLine | None] = []
    for line in shown:
        before = next((one for one in reversed(found[-_MOST_BELOW:]) if one is not None), None)
        found.append(_constant(line) or _implied(line, before) or _entry(line))
    lines = [line for line in found if line is not None]
    told = [any(may for _, may in line.parts) for line in lines if line.is_entry]
    if len(lines) < _FEW or 2 * sum(told) < len(told):
        return
    places = Counter((at, may[0]) for line in lines for at, (_, may) in enumerate(line.parts) if may)
    usual = {at: role for (at, role), _ in reversed(places.most_common())}
    titles = [form("title", line).get("title", "") for line in shown]
    rows = [[title] if line is None else _cells(line, usual) for line, title in zip(found, titles, strict=True)]
    first = next(at for at, line in enumerate(found) if line is not None)
    rows = [*rows[:first], list(_COLUMNS), *rows[first:]]
    yield MapSheet("", rows, notes=notes_of_cut(len(every) > most, most, "rows"))


def _with_those_below(lines: Sequence[str]) -> Iterator[str]:
    """The lines; what is indented below an entry stands behind it."""
    entry, depth, below = "", 0, 0
    for line in lines:
        deeper = form("deeper", line)
        if entry and deeper and len(deeper["blank"]) > depth and below < _MOST_BELOW:
            entry, below = f"{entry}; {deeper['text']}", below + 1
            continue
        yield from [entry] * bool(entry)
        said = form("entry", line)
        entry, depth, below = line * bool(said), len(said.get("blank", "")), 0
        yield from [line] * (not said)
    yield from [entry] * bool(entry)


def _constant(line: str) -> _RegisterLine | None:
    """A name for an address, with a comment."""
    said = form("declared", line)
    if not said:
        return None
    parts = [_told(part) for _, part in _parts(f"{said['type']}, {said['rest'].rstrip('*/) ')}")]
    return _RegisterLine(said["address"], said["name"], parts)


def _implied(line: str, before: _RegisterLine | None) -> _RegisterLine | None:
    """A name of an enumeration without its number, which is one more than that before."""
    said = form("implied", line) if before is not None and not before.is_entry else {}
    if before is None or not said:
        return None
    parts = [_told(part) for _, part in _parts(said["rest"].rstrip("*/) "))]
    return _RegisterLine(hex(numbers_in(before.address)[0] + 1), said["name"], parts)


def _entry(line: str) -> _RegisterLine | None:
    """An address with its name behind it."""
    said = form("entry", line)
    if not said:
        return None
    text = said["rest"]
    parts = [(at, *_told(part)) for at, part in _parts(text)]
    known = next((at for at, (_, _, may) in enumerate(parts) if at and may), len(parts))
    name = text[: parts[known][0] if known < len(parts) else len(text)].rstrip(" \t([,;:|-–—").strip("*_` ")
    return _RegisterLine(said["address"], name, [(part, may) for _, part, may in parts[known:]], is_entry=True)


def _parts(text: str) -> list[tuple[int, str]]:
    """What marks part in a text, and where each begins; no colon behind the heading of a column."""
    marks = [*_MARK.finditer(text)]
    before = [0, *(mark.end() for mark in marks)]
    marks = [
        mark
        for mark, at in zip(marks, before, strict=False)
        if mark[0].strip() != ":" or not _headed(text[at : mark.start()])
    ]
    starts, ends = [0, *(mark.end() for mark in marks)], [*(mark.start() for mark in marks), len(text)]
    return [(start, text[start:end]) for start, end in zip(starts, ends, strict=True) if end > start]


def _told(part: str) -> tuple[str, Sequence[str]]:
    """A part without the heading that it begins with, and what it may be."""
    said = form("labelled", part)
    named = _headed(said.get("label", ""))
    return (said["value"], named) if named else (part, roles_of_part(part))


def _headed(text: str) -> Sequence[str]:
    """The columns of which a text is the heading."""
    heading = plain_heading(text)
    return [role for role in roles() if heading_bits(heading, role) >= WHOLE and role in _COLUMNS]


def _cells(line: _RegisterLine, usual: dict[int, str]) -> list[str]:
    cells = {"": "", "address": line.address, "name": line.name, "description": ""}
    for at, (part, may) in enumerate(line.parts):
        common = usual.get(at, "")
        role = common if common in (may or [common]) else may[0]
        if role in cells:
            cells["description"] = f"{cells['description']} {part}".strip()
        else:
            cells[role] = part
    return [cells.get(column, "") for column in _COLUMNS]
