"""Lines that say a register each: entries of a list, constants with comments.

    40101: Level, uint16, 0.1 cm, R
    - **0x0010** Supply temperature (int16, 0.1 °C)
    #define FLOW 0x20  /* R, uint32, 0.001 m3/h */

Behind address and name a line has parts in any order. The judge of columns says of a part alone whether it is the type,
the unit, the factor or the access; of which it knows nothing, that is what most lines have in this place. An entry's
name ends where the first part begins that is known. Lines between are titles.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from .roles import roles_of_part
from .sheets import MapSheet, notes_of_cut
from .vocabulary import form

_LONGEST: Final = 300  # characters of a line that says one thing
_FEW: Final = 2
_MARK: Final = re.compile(r"\s*(?:[;|()\[\]]|,(?!\d)|:\s|\s[-–—]\s|\s{2,}|\t)\s*")
_COLUMNS: Final = ("address", "name", "type", "unit", "scale", "access", "description")


@dataclass(frozen=True, slots=True)
class _RegisterLine:
    """What a line says: behind the name `parts`, and what each may be by itself."""

    address: str
    name: str
    parts: Sequence[str]
    is_entry: bool = False

    @property
    def roles(self) -> list[Sequence[str]]:
        """The roles that each part may have, the surest first."""
        return [roles_of_part(part) for part in self.parts]


def line_sheets(text: str, most: int) -> Iterator[MapSheet]:
    """The registers that lines say, with the titles between them, as a sheet; none where a line at most does.

    Many lines begin with a number: of entries, most must name a type.
    """
    every = text.splitlines()
    shown = [line[:_LONGEST] for line in every[:most]]
    found = [_constant(line) or _entry(line) for line in shown]
    lines = [line for line in found if line is not None]
    if len(lines) < _FEW or not _are_typed([line for line in lines if line.is_entry]):
        return
    places = Counter((at, may[0]) for line in lines for at, may in enumerate(line.roles) if may)
    usual = {at: role for (at, role), _ in reversed(places.most_common())}
    titles = [form("title", line).get("title", "") for line in shown]
    rows = [[title] if line is None else _cells(line, usual) for line, title in zip(found, titles, strict=True)]
    first = next(at for at, line in enumerate(found) if line is not None)
    rows = [*rows[:first], list(_COLUMNS), *rows[first:]]
    yield MapSheet("", rows, notes=notes_of_cut(len(every) > most, most, "rows"))


def _are_typed(entries: Sequence[_RegisterLine]) -> bool:
    """Whether most of them name a type."""
    return 2 * sum(any("type" in may for may in entry.roles) for entry in entries) >= len(entries)


def _constant(line: str) -> _RegisterLine | None:
    """A name for an address, with a comment."""
    said = form("declared", line)
    if not said:
        return None
    parts = [part for _, part in _parts(f"{said['type']}, {said['rest'].rstrip('*/) ')}")]
    return _RegisterLine(said["address"], said["name"], parts)


def _entry(line: str) -> _RegisterLine | None:
    """An address with its name behind it."""
    said = form("entry", line)
    if not said:
        return None
    text = said["rest"]
    parts = [*_parts(text), (len(text), "")]
    known = next(at for at, (_, part) in enumerate(parts) if (at and roles_of_part(part)) or not part)
    name = text[: parts[known][0]].rstrip(" \t([,;:|-–—").strip("*_` ")
    return _RegisterLine(said["address"], name, [part for _, part in parts[known:-1]], is_entry=True)


def _parts(text: str) -> list[tuple[int, str]]:
    """What marks part in a text, and where each begins."""
    marks = [*_MARK.finditer(text)]
    starts, ends = [0, *(mark.end() for mark in marks)], [*(mark.start() for mark in marks), len(text)]
    return [(start, text[start:end]) for start, end in zip(starts, ends, strict=True) if end > start]


def _cells(line: _RegisterLine, usual: dict[int, str]) -> list[str]:
    cells = {"": "", "address": line.address, "name": line.name, "description": ""}
    for at, (part, may) in enumerate(zip(line.parts, line.roles, strict=True)):
        common = usual.get(at, "")
        role = common if common in (may or [common]) else may[0]
        if role in cells:
            cells["description"] = f"{cells['description']} {part}".strip()
        else:
            cells[role] = part
    return [cells.get(column, "") for column in _COLUMNS]
