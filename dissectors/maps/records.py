"""Records of registers in what programs keep: trees of JSON, YAML, TOML, INI and XML, data in sources, blocks of lines.
A sheet is made of them whose headings are the keys, so that columns are found as in any table.

A record is a mapping with plain values; what has no name is named by the key that leads to it, and grouped by what it
stands in. Records of registers are those that have an address by its name.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import filterfalse, groupby, islice, takewhile, zip_longest
from typing import TYPE_CHECKING, Any, Final

from .literals import Remark, tree_of_source
from .roles import AREA_NAMES
from .sheets import MapSheet, notes_of_cut
from .titles import NUMBERINGS
from .vocabulary import WHOLE, expression, form, heading_bits, roles_headed, tidied, vocabulary
from .written import access_said, area_words, numbers_in

if TYPE_CHECKING:
    from .importers.source import MapSource

_FEW: Final = 2
_MANY: Final = 4  # fields of a record
_MOST: Final = 20_000
_DEPTH: Final = 12
_MOST_LISTS: Final = 100
_LOOK: Final = 40  # lines in which remarks speak of all
_SOURCE: Final = 1 << 18  # characters of a source that are read
_LONGEST: Final = 300  # characters of a line that says one thing
_BRACKETS: Final = frozenset("{([")
_TOLD: Final = ("area", "access")  # by titles and keys
_SAID: Final = {"area": "area", "access": "access", "writable": "access"}  # the same by columns
_SHARED: Final = frozenset({"area", "access", "order", "base"})
Record = dict[str, str]


def record_sheets(source: MapSource) -> Iterator[MapSheet]:
    """The records of a file as sheets, one for each way in which it can be read that gives any."""
    text = source.text[:_SOURCE]
    notes = notes_of_cut(len(source.text) * (source.tree is None), _SOURCE, "characters")
    is_source = source.tree is None and not _BRACKETS.isdisjoint(text)
    tree = tree_of_source(text) if is_source else source.tree
    trees = (tree, [*_blocks(text)], _dotted(text))[: 1 if source.tree is not None else None]
    titles = [[said] for said in (*_remarks(text, is_source=is_source), *_sentences(source.tree))]
    for tree in trees:
        for rows in _lists_of_rows(tree):
            yield MapSheet("", [*titles, *rows[:_MOST]], notes=notes)
        records = list(islice(_found(tree, (), {}), _MOST + 1))
        cut = notes_of_cut(len(records), _MOST, "records")
        yield from _of_records(records[:_MOST], titles, (*notes, *cut))


def _remarks(text: str, *, is_source: bool) -> Iterator[str]:
    """The remarks that speak of a whole file: in a source those at its head, and those that say how addresses count."""
    lines = text.splitlines()[:_LOOK]
    said = [form("comment", line[:_LONGEST]).get("said", "") for line in lines]
    head = [*takewhile(lambda pair: pair[0] or not pair[1].strip(), zip(said, lines, strict=True))]
    yield from (one for at, one in enumerate(said) if one and (at < len(head) or not is_source or _counts(one)))


def _sentences(tree: Any) -> list[str]:
    """What a file says at its head of how addresses count."""
    return [*filter(_counts, map(": ".join, _plain(tree).items()))]


def _counts(text: str) -> bool:
    """Whether a sentence says how addresses count."""
    return any(form(kind, text[:_LONGEST]) for kind in NUMBERINGS)


def _of_records(records: Sequence[Record], titles: list[list[str]], notes: tuple[str, ...]) -> Iterator[MapSheet]:
    """A sheet of the records that have an address by its name, of all where such are few."""
    placed = _placed(records)
    addressed = [record for record in placed if _has_address(record)]
    chosen = addressed if len(addressed) >= _FEW else placed
    rows = [*titles, *(row for _, alike in groupby(chosen, _name_key) for row in _block([*alike]))]
    if len(chosen) >= _FEW:
        yield MapSheet("", rows, notes=notes)


def _name_key(record: Record) -> str:
    """The key that is most surely of the name; of one without a name nothing."""
    surest, bits = _surest(record, "name")
    return surest * (bits >= WHOLE)


def _block(records: Sequence[Record]) -> Iterator[list[str]]:
    """Rows of records below the keys that they have."""
    columns = list(dict.fromkeys(key for record in records for key in record))
    yield columns
    yield from ([record.get(key, "") for key in columns] for record in records)


def _blocks(text: str) -> Iterator[Record | Remark]:
    """The records of a text: blocks that empty lines part, each line of which is a name with what it is, and lines
    that say several such things each; any other line is a remark."""
    for block in text.split("\n\n"):
        lines = block.strip().splitlines()
        named = [form("named_line", line[:_LONGEST]) for line in lines]
        if len(named) >= _FEW and all(named) and not _labelled(lines[0]):
            yield {line["name"].strip(): line["value"].strip() for line in named}
        else:
            yield from (_labelled(line) or Remark(line.strip()) for line in lines)


def _dotted(text: str) -> list[Record]:
    """The records whose fields stand on a line each, behind their number: `reg.10.name=Level`."""
    found: dict[tuple[str, str], Record] = {}
    for said in filter(None, (form("dotted", line[:_LONGEST].strip()) for line in text.splitlines())):
        found.setdefault((said["path"], said["number"]), {})[said["field"]] = said["value"].strip("\"' ")
    records = ({"": path, "address": number, **_told(path), **record} for (path, number), record in found.items())
    return [record for record in records if len(record) >= _MANY]


def _labelled(line: str) -> Record:
    """The things that a line says, each behind its name; nothing where it says fewer than three."""
    marks = expression(vocabulary()["label_marks"])
    parts = [form("labelled_part", part) for part in marks.split(line[:_LONGEST].strip())]
    is_record = len(parts) > _FEW and all(parts)
    return {part["name"].strip(): part["value"].strip("\"' ") for part in parts} if is_record else {}


def _has_address(record: Mapping[str, str]) -> bool:
    """Whether a number stands where a key says that the address is."""
    surest, bits = _surest(record, "address")
    return bits > 0 < len(numbers_in(record[surest][:20]))


def _lists_of_rows(tree: Any) -> Iterator[list[list[str]]]:
    """The lists of lists in a tree that are rows, those of one width together, each below its names and remarks."""
    found: dict[int, list[list[str]]] = {}
    for titles, rows in islice(_listed_rows(tree, (), 0), _MOST_LISTS):
        listed = found.setdefault(max(map(len, rows)), [])
        listed += [[title] for title in titles]
        listed += [[_text(cell) for cell in row] for row in rows]
    yield from found.values()


def _listed_rows(node: Any, titles: tuple[str, ...], depth: int) -> Iterator[tuple[tuple[str, ...], list[list[Any]]]]:
    """Lists that are rows, with what is said of them: names that lead there, and remarks before."""
    names, below = [*node] if isinstance(node, Mapping) else [], parts_of(node)
    if names and all(isinstance(cell, list | str) for cell in below):  # of lists by their names
        lists = [expression(", *").split(cell) if isinstance(cell, str) else cell for cell in below]
        yield from _listed_rows([[key, *cells] for key, cells in zip(names, lists, strict=True)], titles, _DEPTH)
    widths = [len(one) for one in below if isinstance(one, list)]
    if len(widths) > _FEW < min(widths) and len(widths) == len([*filterfalse(_is_remark, below)]):
        yield titles, [[one] if _is_remark(one) else one for one in below]
    for name, inner in zip_longest(names, below[: _MOST * (depth < _DEPTH)], fillvalue=""):
        titles = (*titles, *[inner] * _is_remark(inner))
        yield from _listed_rows(inner, (*titles, *filter(None, [name])), depth + 1)


def _is_remark(node: Any) -> bool:
    return isinstance(node, Remark)


def parts_of(node: Any) -> list[Any]:
    """What a mapping or a list of a tree holds; nothing of anything else."""
    match node:
        case Mapping():
            return [*node.values()]
        case list():
            return node
    return []


def mappings(content: object) -> Iterable[Mapping[str, Any]]:
    """The mappings of a list, or the one that stands alone."""
    match content:
        case Mapping():
            return [content]
        case list():
            return [item for item in content if isinstance(item, Mapping)]
    return []


def _found(node: Any, path: tuple[str, ...], given: Record) -> Iterator[Record]:
    """The records in a tree; `path`: the keys that lead to a node; `given`: what holds for all below it."""
    if len(path) > _DEPTH:
        return
    match node:
        case list():
            for below in node:
                given = _with(given, _told(below)) if _is_remark(below) else given
                yield from _found(below, path, given)
        case Mapping():
            are_named = "area" in _told("".join(path[-1:])) and _are_states(node)
            yield from _named_places(node, given) if are_named else _in_mapping(_with_its_place(node), path, given)


def _named_places(node: Mapping[str, Any], given: Record) -> Iterator[Record]:
    """The records of a mapping of names by their addresses."""
    for place, name in node.items():
        yield {**_lacking(given, {}), "address": str(place), "name": str(name)}


def _in_mapping(node: Mapping[str, Any], path: tuple[str, ...], given: Record) -> Iterator[Record]:
    """What a mapping is, where nothing that it holds has an address, else the records in it."""
    cells, plain = dict(_cells(node)), _plain(node)
    given = {**given, **_defaults(node)}
    shared = {**given, **_shared_by({key: cells[key] for key in plain})}
    told = {key: _told(str(key)) for key in node}
    records = [key for key, part in node.items() if _has_address(_plain(part))]
    told |= {key: {} for key in records * ({} in map(told.get, records))}  # they are names
    below = [
        record
        for key, part in islice(node.items(), _MOST)
        for record in _found(part, (*path, str(key)), _with(shared, told[key]))
    ]
    place = _place(path, cells)
    speaks = len(plain) >= _FEW and any(map(numbers_in, cells.values()))
    is_record = speaks or "address" in place or _has_address(plain)
    is_whole = is_record and not any(map(_has_address, below))
    yield from [{**place, **_lacking(given, cells), **cells}] if is_whole else below


def _defaults(node: Mapping[str, Any]) -> Record:
    """What a mapping says of all that it holds, in a part that is called so."""
    named = (part for key, part in node.items() if isinstance(part, Mapping) and form("of_defaults", str(key)))
    return dict(_cells(next(named, {})))


def _shared_by(cells: Record) -> Record:
    """What plain cells say that may hold for all that stands beside them."""
    areas = {"area": cell for cell in cells.values() if cell.lower() in AREA_NAMES}  # noqa: B035
    return {**areas, **{key: cell for key, cell in cells.items() if not _SHARED.isdisjoint(roles_headed(key))}}


def _with_its_place(node: Mapping[str, Any]) -> Mapping[str, Any]:
    """A mapping with what the one that it holds says, where this says no name of its own, but where it lies."""
    held = [(key, part) for key, part in node.items() if isinstance(part, Mapping)]
    inner = dict(_cells(held[0][1])) if len(held) == 1 and len(node) > 1 else {}
    is_place = _has_address(inner) and not any(heading_bits(key, "name") for key in inner)
    return {**{key: part for key, part in node.items() if key != held[0][0]}, **held[0][1]} if is_place else node


def _with(given: Record, told: Record) -> Record:
    """What is given, and what a title tells: of an area another access; inputs among discrete inputs are these."""
    if (given.get("area"), told.get("area")) == ("discrete", "input"):
        return given
    return {**given, **(dict.fromkeys(_TOLD, "") if "area" in told else {}), **told}


def _lacking(given: Record, cells: Record) -> Record:
    """What is given of all that a record does not say itself."""
    said = {_SAID.get(role) for own in cells for role in roles_headed(own)}
    return {key: cell for key, cell in given.items() if cell and key not in said}


def _told(text: str) -> Record:
    """What a title or a key says of all that stands below it."""
    words = _word(text)
    return {key: cell for key, cell in zip(_TOLD, (area_words(words), access_said(words)), strict=True) if cell}


def _placed(records: Sequence[Record]) -> Sequence[Record]:
    """The records with their addresses, where these say only how far they are from a base: less than any base is."""
    moved = [*map(_moved, records)]
    return [record for record, _ in moved] if all(is_far for _, is_far in moved) else records


def _moved(record: Record) -> tuple[Record, bool]:
    """A record at the address that its base and its own come to, and whether its own may be a distance."""
    base, start = _number_by(record, WHOLE, "base")
    others = {key: cell for key, cell in record.items() if key != base}
    own, place = _number_by(others, 1.0, "address", "offset")
    if "" in (base, own):
        return record, True
    return {**others, own: "", "address": str(start + place)}, not 0 < start <= place


def _number_by(record: Record, least: float, *named: str) -> tuple[str, int]:
    """The key that is most surely of one of these roles, the first rather, with its number; none where no key is."""
    numbers = {key: numbers_in(cell[:20]) for key, cell in record.items()}
    known = {key: found[0] for key, found in numbers.items() if found}
    surest = max((_surest(known, role) for role in named), key=lambda pair: pair[1])
    return (surest[0], known[surest[0]]) if surest[1] >= least else ("", 0)


def _surest(keys: Iterable[str], role: str) -> tuple[str, float]:
    """The key that is most surely of a role, with its bits."""
    return max(((key, heading_bits(key, role)) for key in keys), key=lambda pair: pair[1], default=("", 0.0))


def _place(path: tuple[str, ...], cells: Mapping[str, str]) -> Record:
    """What the keys say that lead to a record: its name, or its address where that is a number; and its group."""
    *groups, key = ("", *path)
    is_number = numbers_in(key[:20]) and not expression(r"[^\W\d]{2}").search(key)
    spoken = form("area_and_number", key)
    is_place = (is_number or area_words(_word(spoken.get("area", "")))) and not _has_address(cells)
    named = any("name" in roles_headed(word) for word in cells)
    if named and not is_place:
        return {"group": " ".join(path)}
    own = {"address": spoken.get("number", key)} if is_place else {"key": key}
    return {**own, "group": " ".join(groups).strip()}


def _word(key: object) -> str:
    """A key as the words of a heading: `scaleFactor` is `scale factor`."""
    return " ".join(tidied("key", str(key)).lower().split())


def _cells(record: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The values of a record by their keys as words; those of what it holds, too."""
    for key, value in record.items():
        if isinstance(value, Mapping) and not _are_states(value):
            yield from _cells(value)
        else:
            yield _word(key), _text(value)


def _plain(node: Any) -> Record:
    """The values of a mapping, without those of what it holds; of anything else nothing."""
    own = node.items() if isinstance(node, Mapping) else ()
    return {_word(key): _text(value) for key, value in own if not isinstance(value, Mapping | list)}


def _are_states(value: Mapping[Any, Any]) -> bool:
    return all(str(state).isdecimal() and isinstance(name, str | bool) for state, name in value.items())


def _text(value: Any) -> str:
    """A value as a cell has it: states with their names, neighbouring numbers as a range."""
    match value:
        case None:
            return ""
        case dict():
            return "; ".join(f"{state}={_state(name)}" for state, name in value.items())
        case [int() as first, *_, int() as last] if value == list(range(first, last + 1)):
            return f"{first}-{last}"
        case list():
            return ", ".join(map(str, value))
        case _:
            return str(value)


def _state(name: str | bool) -> str:
    """The name of a state; YAML takes `on` and `off` for truth."""
    return name if isinstance(name, str) else ("off", "on")[name]


def json_lines(text: str) -> list[Any]:
    """The objects of a file with one a line; nothing behind a line that is none."""
    found = []
    for line in filter(str.strip, text.splitlines()):
        try:
            found.append(json.loads(line))
        except (ValueError, RecursionError):
            break
    return found
