"""Lines that say a register each: entries of a list with what stands indented below them, constants with comments.

    40101: Level, uint16, 0.1 cm, R
    - **0x0010** Supply temperature (int16, 0.1 °C)
    4.1. Register 40004-40005 - Energy
         32 bits unsigned. Scale 0.1. Unit: kWh. Read only.
    #define FLOW 0x20  /* R, uint32, 0.001 m3/h */

Behind address and name a line has parts in any order. A part that begins with the heading of a column is of that; else
the judge of columns says of it alone whether it is the type, the unit, the factor or the access; of which it knows
nothing, that is what most lines have in this place. An entry's name ends where the first part begins that is known.
What has no address of its own lies behind that before: names of an enumeration, members of a structure. Lines between
are titles.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate, pairwise
from typing import Final

from .facts import facts_in
from .literals import with_constants
from .model import VALUE_TYPES
from .roles import OF_PARTS, roles_of_part
from .sheets import MapSheet, notes_of_cut
from .vocabulary import expression, form, heading_bits, plain_heading, roles_headed, tidied, vocabulary
from .written import area_words, numbers_in, type_of

_LONGEST: Final = 300  # characters of a line that says one thing
_MOST_BELOW: Final = 8  # lines of one entry
_FEW: Final = 2
_MANY: Final = 3  # constants with a remark above
_NEARLY: Final = 0.7
_CONSTANT_SIGNS: Final = frozenset("=#")
_PROSE: Final = 1 << 16  # characters of sentences
_TEXT: Final = 1 << 18  # characters of lines
_HEAD: Final = 4000  # characters in which sentences speak of all
_MARK: Final = re.compile(r"\s*(?:[;|()\[\]]|,(?!\d)|(?<=[^\s.])\.(?=[\s;]|$)|:\s|\s[-–—]\s|\s{2,}|\t)\s*")
_GOES_ON: Final = frozenset(":-–—")  # marks behind which a text may go on
_LOOKS: Final = {"unit": "short", "scale": "times_factor"}  # of what is usual in a place
_COLUMNS: Final = ("address", "name", "type", "unit", "scale", "access", "description", "area", "length")
Parts = Sequence[tuple[str, Sequence[str]]]


@dataclass(frozen=True, slots=True)
class _RegisterLine:
    """What a line says: behind the name `parts`, each with the roles that it may have, the surest first."""

    address: str
    name: str
    parts: Parts = ()
    is_entry: bool = False
    area: str | None = None
    block: Sequence[int] = ()  # the address of registers that are read at once
    is_part: bool = False  # one of these


def line_sheets(text: str, most: int) -> Iterator[MapSheet]:
    """The registers that lines say, as they stand or, of sentences, each mention on a line of its own."""
    yield from _line_sheet(text[:_TEXT], most, notes_of_cut(len(text), _TEXT, "characters"))
    running = expression(r"(?<=\S)\n(?=[a-z(])").sub(" ", text[:_PROSE])
    spoken, mentions = expression("{MENTION}").subn(r"\n\1", running)
    if mentions >= _FEW:
        notes = notes_of_cut(len(text), _PROSE, "characters of sentences")
        yield from _line_sheet(expression("{SPOKEN}").sub(r"\n\2: \1", spoken), most, notes)


def _line_sheet(text: str, most: int, notes: tuple[str, ...]) -> Iterator[MapSheet]:
    """The registers that lines say, with the titles between them, as a sheet; none where a line at most does."""
    every = _as_constants(text).splitlines()
    shown = [*_with_those_below([line[:_LONGEST] for line in every[:most]])]
    found = _counting(_registers(shown))
    lines = list(filter(None, found))
    if len(lines) < _FEW:
        return
    usual = _usual_roles(lines)
    rows = [_cells(line, usual) if line else [_title(text)] for line, text in zip(found, shown, strict=True)]
    rows.insert(found.index(lines[0]), list(_COLUMNS))
    yield MapSheet("", rows, notes=(*notes, *notes_of_cut(len(every), most, "rows")))


def _as_constants(text: str) -> str:
    """A text whose constants have their remarks behind them, so the members of structures, where they lie."""
    placed = partial(_placed, bases=_bases(text[:_HEAD]))
    text = tidied.__wrapped__("lines", _with_remarks_behind(with_constants(text)))
    return expression(vocabulary()["image"]).sub(placed, text)


def _counting(read: Sequence[_RegisterLine | None]) -> list[_RegisterLine | None]:
    """What lines say with a name. Many lines begin with a number: of entries, most must tell more than a name, or none
    counts."""
    told = [any(may for _, may in line.parts) for line in filter(None, read) if line.is_entry]
    is_list = 2 * sum(told) >= len(told)
    return [line if line and line.name and line.is_entry <= is_list else None for line in read]


def _usual_roles(lines: Sequence[_RegisterLine]) -> dict[int, str]:
    """What most lines have in each place behind the name."""
    places = Counter((at, role) for line in lines for at, (_, may) in enumerate(line.parts) for role in may[:1])
    return {at: role for (at, role), _ in reversed(places.most_common())}


def _with_remarks_behind(text: str) -> str:
    """A text whose remarks stand behind what they are of, where nearly each constant has one on the line above."""
    lines = text.splitlines()
    short = [line[:_LONGEST] for line in lines]
    constants = [
        at for at, line in enumerate(short) if not _CONSTANT_SIGNS.isdisjoint(line) and form("declared", f"{line} // -")
    ]
    above = {at: form("comment", short[at - 1]).get("said", "") for at in filter(None, constants)}
    told = {at: said for at, said in above.items() if said and not form("declared", short[at])}
    if len(told) >= max(_MANY, _NEARLY * len(constants)):
        for at, said in told.items():
            lines[at - 1 : at + 1] = ["", f"{lines[at]} // {said}"]
    return "\n".join(lines)


def _title(line: str) -> str:
    """What a line without a register says of those below."""
    opened = form("opened", line)
    said = form("title", line).get("title") or form("comment", line).get("said", "")
    return tidied("key", f"{opened['title']} {opened['rest']}") if opened else said


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
    texts = filter(str.strip, (image["members"] or image["listed"]).splitlines())
    members = [form("member", line) for line in texts if not form("comment", line)]
    if not (members and all(members)):
        return image[0]
    octets = [_octets_of(said) * max(1, _count_of(said)) for said in members]
    title = tidied("key", f"{image['name'] or ''} {image['last'] or ''} {image['type'] or ''}")
    area = area_words(title)
    places = accumulate(octets, initial=2 * bases.get(area, [*bases.values(), 0][0] if area is None else 0))
    shown = (_member(said, at // 2) for said, at in zip(members, places, strict=False))
    return "\n".join(["", f"// {title}", *(line for lines in shown for line in lines)])


def _octets_of(member: Mapping[str, str]) -> int:
    """The octets of a member by its type; those of one of a text."""
    kind = f"{member['type']}{member['of']}".lower()
    return 1 if form("of_octets", kind) else 2 * VALUE_TYPES[type_of(kind, 1)[0]]


def _count_of(member: Mapping[str, str]) -> int:
    """How many a member has of its type; 0 where it does not say."""
    return int(f"0{member['count']}{member['many']}")


def _member(said: Mapping[str, str], at: int) -> Iterator[str]:
    """A member as constants: a text as one, each of several numbers for itself."""
    count, kind, octets = _count_of(said), f"{said['type']}{said['of']}", _octets_of(said)
    of_text = f", length {count // 2}" * (octets == 1 and count > 1)
    for turn in range(1 if of_text else max(1, min(count, _LONGEST))):
        name = f"{said['name']}{said['called']}" + f"_{turn + 1}" * (count > 1 and not of_text)
        place = at + turn * max(1, octets // 2)
        yield f"{name} = {place} : {'string' if of_text else kind} // {said['rest']}{of_text}"


def _registers(lines: Sequence[str]) -> list[_RegisterLine | None]:
    """What each line says of a register; None of one that is of none."""
    found: list[_RegisterLine | None] = []
    before = _RegisterLine("", "", is_entry=True)
    title = ""
    for line in lines:
        is_titled = area_words(form("group_title", title).get("", "")) is not None
        likely = (kind for kind, (signs, _) in _FORMS.items() if any(map(line.__contains__, signs)))
        ways = ((kind, form(kind, line)) for kind in likely if is_titled or kind != "alone")
        found.append(next(filter(None, (_FORMS[kind][1](said, before) for kind, said in ways if said)), None))
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


def _opened(_: Mapping[str, str], __: _RegisterLine) -> _RegisterLine:
    """What begins an enumeration: the first of it is 0."""
    return _RegisterLine("-1", "")


def _constant(said: Mapping[str, str], _: _RegisterLine) -> _RegisterLine:
    """A name for an address; that of a double word counts two registers, that of a byte before a bit eight bits."""
    space = f"{said.get('space', '')}{said['wide']}{'.' * (said.get('bit', '') != '')}"
    times, area = _PLACES.get(space, (2 if said["wide"] == "D" else 1, ""))
    number = times * numbers_in(said["address"])[0] + int(f"0{said.get('bit', '')}")
    address = said["address"] if times == 1 else str(number)
    return replace(_named(address, said, tidied("type", said["type"])), area=area)


_PLACES: Final = {
    **dict.fromkeys(("M", "Q", "MX", "QX"), (1, "coil")), **dict.fromkeys(("MX.", "QX."), (8, "coil")),
    **dict.fromkeys(("I", "IX"), (1, "discrete")), "IX.": (8, "discrete"), "IW": (1, "input"), "ID": (2, "input"),
    **dict.fromkeys(("MW", "QW"), (1, "holding")), **dict.fromkeys(("MD", "QD"), (2, "holding")),
}  # fmt: skip
"""How many addresses of Modbus an address of IEC 61131 counts, and of which area."""


def _implied(said: Mapping[str, str], before: _RegisterLine) -> _RegisterLine | None:
    """A name of an enumeration without its number, which is one more than that before."""
    place = -1 if before.address == "-1" else sum(numbers_in(before.address)[:1])
    return None if before.is_entry or (not said["rest"] and before.name) else _named(hex(place + 1), said)


def _called(said: Mapping[str, str], _: _RegisterLine) -> _RegisterLine:
    """What a program calls that which it reads from an address."""
    call = said["call"]
    kind = said["type"] + "u32" * (said["long"] != "") + "int16" * (form("signed", call) != {})
    tens = 10 ** int(form("places", call).get("places", 0))
    return _read(said, call, numbers_in(said["address"])[0], kind, f"/ {tens}" * (tens > 1))


def _read(said: Mapping[str, str], call: str, address: int, kind: str, scale: str = "") -> _RegisterLine:
    """What a line of a program says of a register that it reads."""
    rest = f"{scale}; {tidied('place', said['scale'])}; {said['rest']}"
    area = area_words(tidied("key", call.lower()))
    return replace(_named(str(address), {**said, "rest": rest}, kind), area=area, block=[address])


def _indexed(said: Mapping[str, str], before: _RegisterLine) -> _RegisterLine | None:
    """What a program calls one of the registers that it has just read: `flow = regs[2] / 10`."""
    if not before.block:
        return None
    call = tidied("key", said["call"].lower()).partition("(")[0]
    kind = call if _is_type(call) else "u32" * (said["more"] != "")
    named = _read(said, call, before.block[0] + int(said["index"]), kind)
    return replace(named, area=before.area, block=before.block, is_part=True)


def _entry(said: Mapping[str, str], _: _RegisterLine) -> _RegisterLine:
    """An address with its name behind it."""
    text = form("spoken_of", said["rest"]).get("rest") or said["rest"]
    name, parts = _name_and_parts(f"{text}, {said['aside']}".rstrip(", "))
    return _listed(said, name, parts)


def _listed(said: Mapping[str, str], name: str, parts: Parts) -> _RegisterLine:
    """An entry of a list, before whose address a word may say the area."""
    return _RegisterLine(said["address"], name, [*parts, ("", ("end",))], is_entry=True, area=area_words(said["word"]))


def _after_name(said: Mapping[str, str], _: _RegisterLine) -> _RegisterLine | None:
    """A name with its address behind it, of which a word says that it is one, or how it is written."""
    words = plain_heading(said["word"]).split()
    signs = (
        area_words(said["word"]),
        said["address"].startswith("0x"),
        *(heading_bits(one, "address") for one in words),
    )
    parts = [_told(part) for _, part in _parts(said["rest"].strip(" ,;:)]"))]
    name = said["name"].strip("*_`\"' ")
    is_heading = heading_bits(plain_heading(name), "address") > 0
    return _listed(said, name, parts) if any(signs) > is_heading else None


_ReadLine = Callable[[Mapping[str, str], _RegisterLine], _RegisterLine | None]
_FORMS: Final[Mapping[str, tuple[Sequence[str], _ReadLine]]] = {
    "opened": (("{",), _opened),
    "declared": (tuple("/*#-;'{!%"), _constant),
    "bare": (("#",), _constant),
    "implied": (("",), _implied),
    "entry": (("",), _entry),
    "named": (("",), _after_name),
    "called": (("read",), _called),
    "indexed": (("[",), _indexed),
    "alone": (("",), _constant),
}
"""The forms that a line may have, what no line of it lacks, and how it is read."""


def _named(address: str, said: Mapping[str, str], kind: str = "") -> _RegisterLine:
    parts = [_told(part) for _, part in _parts(f"{kind}, {said['rest'].rstrip('*/) ')}")]
    return _RegisterLine(address, said["name"], parts)


def _name_and_parts(text: str) -> tuple[str, Parts]:
    """A name and what stands behind it, from the first part on that is known."""
    parts = [(at, *_told(part)) for at, part in _parts(text)]
    known = next((at for at, (_, part, may) in enumerate(parts) if at and (may or part[0].isdecimal())), len(parts))
    end = parts[known][0] if known < len(parts) else len(text)
    name = text[:end].rstrip(" \t([,;:|-–—").strip("*_` ")
    return form("name_end", name).get("name", name), [(part, may) for _, part, may in parts[known:]]


def _parts(text: str) -> list[tuple[int, str]]:
    """What marks part in a text, and where each begins; no colon behind a heading, a bit or a state."""
    marks = [*_MARK.finditer(text)]
    before = [text[a:b] for a, b in pairwise([0, *(at for mark in marks for at in mark.span())])][::2]
    pairs = zip(marks, before, strict=False)
    marks = [mark for mark, part in pairs if not (mark[0].strip() in _GOES_ON and _leads(part))]
    starts, ends = [0, *(mark.end() for mark in marks)], [*(mark.start() for mark in marks), len(text)]
    spans = zip(starts, ends, strict=True)
    return [(start + at, part) for start, end in spans for at, part in _with_last(text[start:end]) if part]


def _leads(text: str) -> bool:
    """Whether what stands behind a colon or a dash belongs to the text before it: to a heading, a state, a bit."""
    return bool(_headed(text) or form("of_list", text))


def _with_last(part: str) -> list[tuple[int, str]]:
    """A text and the type or the access behind it, where it ends with one: `Line voltage uint16`; where each begins."""
    if "scale" in facts_in(part, "remark"):
        return [(0, part)]
    blanks = [blank.span() for blank in expression(r"\s+").finditer(part)]
    texts = [(part[:end], begin) for end, begin in blanks if not _is_type(part[:end])]
    name, begin = [("", 0), *texts][-1]
    is_last = form("words", name) and _is_type(part[begin:]) and {*OF_PARTS}.isdisjoint(_headed(name.rstrip(":= ")))
    return [(0, name), (begin, part[begin:])] if is_last else [(0, part)]


def _is_type(text: str) -> bool:
    return "type" in roles_of_part(text) or form("rights", text) != {}


def _told(part: str) -> tuple[str, Sequence[str]]:
    """A part without the heading that it begins with, and what it may be."""
    said = form("labelled", part)
    named = _headed(said.get("label", ""))
    listed = ("description",) * any(form(kind, part) for kind in ("state", "spoken_bit"))
    if counted := form("told_length", part):
        return counted["length"], ("length",)
    return (said["value"], named) if named else (part, listed or roles_of_part(part))


def _headed(text: str) -> Sequence[str]:
    """The columns of which a text is the heading."""
    return [*filter(_COLUMNS.__contains__, roles_headed(plain_heading(text)))]


def _by_role(parts: Parts, usual: Mapping[int, str]) -> dict[str, str]:
    """The parts by what they are, in doubt by what is `usual` in their place; what says no more is a description."""
    cells = {"": "", "description": ""}
    for at, (part, may) in enumerate(parts):
        common = usual.get(at, "")
        guessed = common if common in _LOOKS and form(_LOOKS[common], part) else "description"
        role = (common if common in may else may[0]) if may else guessed
        if role in cells:
            cells["description"] = f"{cells['description']} {part}".strip()
        else:
            cells[role] = part
    return cells


def _cells(line: _RegisterLine, usual: Mapping[int, str]) -> list[str]:
    cells = {**_by_role(line.parts, usual), "address": line.address, "name": line.name, "area": line.area or ""}
    return [cells.get(column, "") for column in _COLUMNS]
