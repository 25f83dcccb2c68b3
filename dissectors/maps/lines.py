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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate, pairwise
from typing import Final

from .roles import OF_PARTS, WHOLE, heading_bits, plain_heading, roles_of_part
from .sheets import MapSheet, notes_of_cut
from .vocabulary import expression, form, roles, tidied, vocabulary
from .written import area_words, numbers_in

_LONGEST: Final = 300  # characters of a line that says one thing
_MOST_BELOW: Final = 8  # lines of one entry
_FEW: Final = 2
_HEAD: Final = 4000  # characters in which sentences speak of all
_MARK: Final = re.compile(r"\s*(?:[;|()\[\]]|,(?!\d)|(?<=[^\s.])\.(?=[\s;]|$)|:\s|\s[-–—]\s|\s{2,}|\t)\s*")
_OCTETS: Final = {"char": 1, "8": 1, "16": 2, "32": 4, "64": 8, "float": 4, "double": 8}
_COLUMNS: Final = ("address", "name", "type", "unit", "scale", "access", "description", "area")


@dataclass(frozen=True, slots=True)
class _RegisterLine:
    """What a line says: behind the name `parts`, each with the roles that it may have, the surest first."""

    address: str
    name: str
    parts: Sequence[tuple[str, Sequence[str]]]
    is_entry: bool = False
    area: str = ""
    block: Sequence[int] = ()  # the address of registers that are read at once
    is_part: bool = False  # one of these


def line_sheets(text: str, most: int) -> Iterator[MapSheet]:
    """The registers that lines say, with the titles between them, as a sheet; none where a line at most does.

    Many lines begin with a number: of entries, most must tell more than a name, or none counts.
    """
    placed = partial(_placed, bases=_bases(text[:_HEAD]))
    every = expression(vocabulary()["image"]).sub(placed, tidied.__wrapped__("lines", text)).splitlines()
    shown = [*_with_those_below([line[:_LONGEST] for line in every[:most]])]
    every_line = _registers(shown)
    told = [any(may for _, may in line.parts) for line in filter(None, every_line) if line.is_entry]
    is_list = 2 * sum(told) >= len(told)
    found = [line if line and line.is_entry <= is_list else None for line in every_line]
    lines = list(filter(None, found))
    if len(lines) < _FEW:
        return
    places = Counter((at, role) for line in lines for at, (_, may) in enumerate(line.parts) for role in may[:1])
    usual = {at: role for (at, role), _ in reversed(places.most_common())}
    titles = [form("title", line).get("title", "") for line in shown]
    rows = [_cells(line, usual) if line else [title] for line, title in zip(found, titles, strict=True)]
    rows.insert(found.index(lines[0]), list(_COLUMNS))
    yield MapSheet("", rows, notes=notes_of_cut(len(every) > most, most, "rows"))


def _bases(text: str) -> dict[str | None, int]:
    """Where the registers of each area begin, by sentences that say so."""
    area: str | None = None
    found: dict[str | None, int] = {}
    for part in expression(r"[,;.\n]").split(text):
        area = area_words(part) or area
        if said := form("based", part):
            found[area] = numbers_in(said["base"])[0]
    return found


def _placed(image: re.Match[str], bases: Mapping[str | None, int]) -> str:
    """The members of a structure as constants at the registers where they lie, where all have a size."""
    texts = filter(str.strip, image["members"].splitlines())
    members = [form("member", line) for line in texts if not form("comment", line)]
    if not all(members):
        return image[0]
    octets = [_OCTETS[said["size"]] * max(1, int(f"0{said['count']}")) for said in members]
    title = tidied("key", image["name"] + image["last"])
    places = accumulate(octets, initial=2 * bases.get(area_words(title), 0))
    lines = [f"// {title}"]
    for said, at in zip(members, places, strict=False):
        lines.append(f"{said['name']} = {at // 2} : {said['type']} // {said['rest']}")
    return "\n".join(["", *lines])


def _registers(lines: Sequence[str]) -> list[_RegisterLine | None]:
    """What each line says of a register; None of one that is of none."""
    found: list[_RegisterLine | None] = []
    before = _RegisterLine("", "", (), is_entry=True)
    title = ""
    for line in lines:
        tried = (
            way(line, before) for way in (_WAYS if area_words(form("group_title", title).get("", "")) else _WAYS[:-1])
        )
        found.append(next(filter(None, tried), None))
        before = found[-1] or before
        title = form("comment", line).get("said", title) if found[-1] is None else title
    for one, after in pairwise(filter(None, [*found])):
        if after.is_part > one.is_part:  # which names all that is read
            found[found.index(one)] = None
    return found


def _with_those_below(lines: Sequence[str]) -> Iterator[str]:
    """The lines; what is indented below an entry stands behind it."""
    entry: list[str] = []
    depth = 0
    for line in lines:
        deeper = form("deeper", line)
        if 0 < len(entry) <= _MOST_BELOW and len(deeper.get("blank", "")) > depth:
            entry.append(deeper["text"])
            continue
        yield from ["; ".join(entry)] * (entry != [])
        said = form("entry", line)
        entry, depth = [line] * (said != {}), len(said.get("blank", ""))
        yield from [line] * (said == {})
    yield from ["; ".join(entry)] * (entry != [])


def _constant(line: str, _: _RegisterLine, kind: str = "declared") -> _RegisterLine | None:
    """A name for an address; that of a double word counts two registers."""
    said = form(kind, line)
    if not said:
        return None
    twice = str(2 * numbers_in(said["address"])[0])
    return _named({"": said["address"], "D": twice}[said["wide"]], said, said["type"])


def _called(line: str, _: _RegisterLine) -> _RegisterLine | None:
    """What a program calls that which it reads from an address."""
    said = form("called", line)
    if not said:
        return None
    call = said["call"]
    kind = said["type"] + "u32" * (said["long"] != "") + "int16" * (form("signed", call) != {})
    tens = 10 ** int(form("places", call).get("places", 0))
    return _read(said, call, numbers_in(said["address"])[0], kind, f"/ {tens}" * (tens > 1))


def _read(said: Mapping[str, str], call: str, address: int, kind: str, scale: str = "") -> _RegisterLine:
    """What a line of a program says of a register that it reads."""
    rest = f"{scale}; {tidied('place', said['scale'])}; {said['rest']}"
    area = area_words(tidied("key", call.lower())) or ""
    return replace(_named(str(address), {**said, "rest": rest}, kind), area=area, block=[address])


def _indexed(line: str, before: _RegisterLine) -> _RegisterLine | None:
    """What a program calls one of the registers that it has just read: `flow = regs[2] / 10`."""
    said = form("indexed", line) if before.block else {}
    if not said:
        return None
    call = tidied("key", said["call"].lower()).partition("(")[0]
    kind = call if _is_type(call) else "u32" * (said["more"] != "")
    named = _read(said, call, before.block[0] + int(said["index"]), kind)
    return replace(named, area=before.area, block=before.block, is_part=True)


def _implied(line: str, before: _RegisterLine) -> _RegisterLine | None:
    """A name of an enumeration without its number, which is one more than that before."""
    said = form("implied", line)
    if before.is_entry or not said:
        return None
    return _named(hex(numbers_in(before.address)[0] + 1), said)


def _named(address: str, said: Mapping[str, str], kind: str = "") -> _RegisterLine:
    parts = [_told(part) for _, part in _parts(f"{kind}, {said['rest'].rstrip('*/) ')}")]
    return _RegisterLine(address, said["name"], parts)


def _entry(line: str, _: _RegisterLine) -> _RegisterLine | None:
    """An address with its name behind it."""
    said = form("entry", line)
    if not said:
        return None
    text = said["rest"]
    parts = [*((at, *_told(part)) for at, part in _parts(text)), (len(text), "", ("end",))]
    known = next(at for at, (_, _, may) in enumerate(parts) if at and may)
    name = text[: parts[known][0]].rstrip(" \t([,;:|-–—").strip("*_` ")
    return _RegisterLine(said["address"], name, [(part, may) for _, part, may in parts[known:-1]], is_entry=True)


_WAYS: Final = (
    _constant,
    partial(_constant, kind="bare"),
    _implied,
    _entry,
    _called,
    _indexed,
    partial(_constant, kind="alone"),  # below a title that names an area
)


def _parts(text: str) -> list[tuple[int, str]]:
    """What marks part in a text, and where each begins; no colon behind a heading, a bit or a state."""
    marks = [*_MARK.finditer(text)]
    before = [text[a:b] for a, b in pairwise([0, *(at for mark in marks for at in mark.span())])][::2]
    marks = [one for one, part in zip(marks, before, strict=False) if not _LEADING.get(one[0].strip(), _no)(part)]
    starts, ends = [0, *(mark.end() for mark in marks)], [*(mark.start() for mark in marks), len(text)]
    return [
        (start + at, part)
        for start, end in zip(starts, ends, strict=True)
        for at, part in _with_last(text[start:end])
        if part
    ]


def _with_last(part: str) -> list[tuple[int, str]]:
    """A text and the type or the access behind it, where it ends with one: `Line voltage uint16`; where each begins."""
    blanks = [blank.span() for blank in expression(r"\s+").finditer(part)]
    texts = [(part[:end], begin) for end, begin in blanks if not _is_type(part[:end])]
    name, begin = texts[-1] if texts else ("", 0)
    is_last = form("words", name) and _is_type(part[begin:]) and {*OF_PARTS}.isdisjoint(_headed(name.rstrip(":= ")))
    return [(0, name), (begin, part[begin:])] if is_last else [(0, part)]


def _is_type(text: str) -> bool:
    return "type" in roles_of_part(text) or form("rights", text) != {}


def _told(part: str) -> tuple[str, Sequence[str]]:
    """A part without the heading that it begins with, and what it may be."""
    said = form("labelled", part)
    named = _headed(said.get("label", ""))
    listed = ("description",) * any(form(kind, part) for kind in ("state", "spoken_bit"))
    return (said["value"], named) if named else (part, listed or roles_of_part(part))


def _leads(text: str) -> bool:
    """Whether what stands behind a colon or a dash belongs to the text before it: to a heading, a state, a bit."""
    return bool(_headed(text) or form("of_list", text))


def _no(_: str) -> bool:
    return False


_LEADING: Final = dict.fromkeys(":-–—", _leads)  # marks behind which a text may go on


def _headed(text: str) -> Sequence[str]:
    """The columns of which a text is the heading."""
    heading = plain_heading(text)
    return [role for role in roles() if heading_bits(heading, role) >= WHOLE and role in _COLUMNS]


def _cells(line: _RegisterLine, usual: dict[int, str]) -> list[str]:
    cells = {"": "", "address": line.address, "name": line.name, "description": "", "area": line.area}
    for at, (part, may) in enumerate(line.parts):
        common = usual.get(at, "")
        guessed = common if common == "unit" and form("short", part) else "description"
        role = (common if common in may else may[0]) if may else guessed
        if role in cells:
            cells["description"] = f"{cells['description']} {part}".strip()
        else:
            cells[role] = part
    return [cells.get(column, "") for column in _COLUMNS]
