"""What is done with the records of a program before they are rows, by the steps of its file of data, in turn.

A step takes the source, the records and its own line of the file. What no step can do is `adapted` of a module that has
the step's name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from typing import Any, Final

from ..cells import count_in, whole_in
from ..records import mappings
from ..vocabulary import expression
from .source import MapSource

Record = dict[str, Any]
Step = Callable[[MapSource, Iterator[Record], Mapping[str, Any]], Iterator[Record]]
_LONGEST: Final = 2000  # characters of a text that has parts
_DEEPEST: Final = 200  # characters of the names of devices in devices
_MOST_PARTS: Final = 20_000  # of devices in devices
_VARIABLE: Final = re.compile(r"\$(?:\{(\w+)\}|(\w+))")
_PLAIN_FROM: Final = 0x100
_FIRSTS: Final = {"holding": (400001, 40001), "input": (300001, 30001), "discrete": (10001,)}
"""The first logical numbers of areas."""


def said(record: Mapping[str, Any], keys: Sequence[str]) -> Any:
    """The first of these keys that a record has."""
    return next((value for value in (value_at(record, key) for key in keys) if value is not None), None)


def value_at(record: Mapping[str, Any], key: str) -> Any:
    """What a key leads to: one of the record, `a.b` in another (or in a list), `a+b` both as a text, `=x` x itself."""
    first, sign, rest = key.partition("+")
    if key in record or key.startswith("="):
        return record.get(key, key[1:])
    if sign:
        parts = [value_at(record, first), value_at(record, rest)]
        return None if None in parts else " ".join(map(_flat, parts))
    first, _, rest = key.partition(".")
    inner = record.get(first)
    known = {str(at): one for at, one in enumerate(inner)} if isinstance(inner, list) else inner
    return value_at(known, rest) if isinstance(known, Mapping) else None


def _flat(value: Any) -> str:
    """A value as words, those of mappings and lists in turn."""
    match value:
        case Mapping():
            return " ".join(map(_flat, value.values()))
        case list():
            return " ".join(map(_flat, value))
    return str(value)


def _skipped(note: str | None) -> Record:
    """What leaves a record out, and why; nothing without a reason."""
    return {"notes": [note], "skipped": True} if note else {}


def _parsed(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """The parts of a text, by the first expression that it is like; `else`: what is said where it is like none."""
    for record in records:
        text = str(said(record, [*step["of"], "="]))[:_LONGEST]
        found = next(filter(None, (expression(like).fullmatch(text) for like in step["like"])), None)
        if found:
            yield record | {key: part for key, part in found.groupdict().items() if part is not None}
        else:
            yield record | _skipped(step.get("else", "").replace("{}", repr(text)))


def _above(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """The records that have a key, with what those before them said."""
    held: Record = {}
    for record in records:
        if step["until"] in record:
            yield {**held, **record}
        else:
            held |= {key: record[key] for key in step["keeps"] if key in record}


def _keyed(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """What a text says by keys, under these."""
    for record in records:
        found = expression(step["like"]).finditer(str(said(record, step["of"]) or "")[:_LONGEST])
        yield record | {one["key"]: one["value"] for one in found}


def _joined(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """The records that have a key, each with what another says that it names: the first that says what is wanted."""
    rows = [*records]
    wanted = step.get("has", [step["with"]])
    others = {str(row.get(step["with"])): row for row in rows if said(row, wanted) is not None}
    for row in rows:
        told = next(filter(None, (others.get(str(value_at(row, key))) for key in step["by"])), {})
        new = {key: value for key, value in told.items() if row.get(key) is None}
        yield from [row | new] * (step["of"] in row)


def _listed(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """Addresses that a record lists become its `first`, their `count`, and the way that they go (`listed`)."""
    for record in records:
        listed = record.get(step["of"]) or ()
        yield record | (_in_line(listed) if isinstance(listed, list) else {} if listed else _skipped(step.get("none")))


def _in_line(listed: list[Any]) -> Record:
    places = [*map(whole_in, listed)]
    first = min((place for place in places if place is not None), default=0)
    rising = [*range(first, first + len(listed))]
    ways = {"rising": rising, "falling": rising[::-1]}
    way = next((name for name, run in ways.items() if run == places), None)
    wrong = {} if way else _skipped(f"registers {listed} do not lie side by side")
    return {"first": first, "count": len(listed), "listed": way, **wrong}


def _asked(source: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """What the file says of the range that an address lies in, as `asked`."""
    known: list[tuple[range, Any]] = []
    for one in mappings(value_at(source.yaml, step["of"])):
        first, last = (whole_in(one.get(step[key])) for key in ("first", "last"))
        if first is not None is not last:
            known.append((range(first, last + 1), one.get(step["says"])))
    for record in records:
        yield {"asked": next((word for run, word in known if record.get("first", 0) in run), None), **record}


def _also(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """Before a record that has a key another with what this says of it."""
    for record in records:
        if step["needs"] in record:
            yield record | {key: said(record, keys) for key, keys in step["gives"].items()}
        yield record


def _variables(source: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """The records, with the file's own variables in place."""
    known = source.yaml.get(step["of"]) if isinstance(source.yaml, Mapping) else None
    words = {str(key): str(word) for key, word in known.items()} if isinstance(known, Mapping) else {}

    def meant(found: re.Match[str]) -> str:
        return words.get(found[1] or found[2], found[0])

    for record in records:
        yield {key: _VARIABLE.sub(meant, one) if isinstance(one, str) else one for key, one in record.items()}


def _straight(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """Filters one behind the other as one line, `scale` and `added`; what is no line is noted."""
    for record in records:
        lists = (
            mappings([{key: record[key]}] if key in step["keys"] else record[key])
            for key in step["of"]
            if record.get(key) is not None
        )
        texts = [
            " ".join(f"{key} {_flat(value)}".split()) for one in lists for each in one for key, value in each.items()
        ]
        scale, added = 1.0, 0.0
        notes: list[str] = []
        for text in texts:
            line = next(filter(None, (expression(like).fullmatch(text) for like in step["lines"])), None)
            factor, more = _line(line.groupdict()) if line else (1.0, 0.0)
            scale, added = scale * factor, added * factor + more
            notes += [step["else"].get(text.partition(" ")[0], "").replace("{}", text[:80])] * (line is None)
        yield {**record, "scale": scale, "added": added, "notes": [*record.get("notes", ()), *filter(None, notes)]}


def _line(parts: Mapping[str, str | None]) -> tuple[float, float]:
    """Factor and offset of a line: told as they are, or by two of its points."""
    number = {key: float(text.replace(",", ".")) for key, text in parts.items() if text}
    run = number.get("x2", 1.0) - number.get("x", 0.0)
    if "y2" not in number or not run:
        return number.get("factor", 1.0) / (number.get("divisor", 1.0) or 1.0), number.get("added", 0.0)
    factor = (number["y2"] - number["y"]) / run
    return factor, number["y"] - number["x"] * factor


def _logical(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """Areas and addresses apart where an address is a logical number (40001), unless its block begins plainly."""
    for record in records:
        yield record | _spot(record, step["of"], record.get("area"))


def _aliases(source: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """Areas and addresses apart where all addresses can be logical numbers; else a file's name may say the area."""
    rows = list(records)
    named = next((area for word, area in step["named"].items() if word in source.stem.lower()), None)
    spots = [_spot(row, step["of"], named) for row in rows]
    are_aliases = bool(rows) and all(spot or step["of"] not in row for row, spot in zip(rows, spots, strict=True))
    telling = (
        ("the table does not say its area: where addresses do not either, holding registers are taken", named is None),
        ("addresses were taken for aliases (40001), as all of them could be", are_aliases),
    )
    words = [text for text, holds in telling if holds]
    for row, spot in zip(rows, spots, strict=True):
        yield {"area": named, **row, **(spot if are_aliases else {}), "of file": words}
        words = []


def _spot(record: Record, key: str, named: str | None) -> Record:
    """Area and address of a logical number; nothing where it is none of its area."""
    number, near = (count_in(record.get(one)) for one in (key, "start"))
    fits = (
        {"area": area, "place": number - first}
        for area, firsts in _FIRSTS.items()
        for first in firsts
        if (named or area).startswith(area) and 0 <= number - first < 0x10000 and not _PLAIN_FROM <= near < first
    )
    return next(fits, {})


def _kept(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """A note of what a map does not carry, where it is not as usual."""
    for record in records:
        notes = [f"{key} {str(record[key])[:60]!r} is not carried" for key, usual in step["usual"].items()
                 if record.get(key, usual) not in (usual, "")]  # fmt: skip
        yield {**record, "notes": [*record.get("notes", ()), *notes]}


def _laid(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """How many addresses lie before a record among those side by side, by the sizes of types; any other has one."""
    begin: Record = {}
    laid = 0
    for record in records:
        here = {key: record.get(key) for key in (step["from"], *step["by"])}
        laid = laid * (here == begin)
        begin = here
        yield {**record, "laid": laid}
        laid += step["sizes"].get(str(record.get("type")), 1)


def _words(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """What a word means, under another key."""
    for record in records:
        yield {**record, step["to"]: step["words"].get(str(record.get(step["of"])))}


def _pairs(_: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """Two lists side by side as a mapping; of those that the second lacks, the first."""
    for record in records:
        keys, names = (found if isinstance(found := record.get(key), list) else [] for key in step["of"])
        named = [*names, *keys[len(names) :]]
        yield {**record, step["to"]: {key: str(name) for key, name in zip(keys, named, strict=False)}}


def _within(source: MapSource, records: Iterator[Record], step: Mapping[str, Any]) -> Iterator[Record]:
    """In place of a record the parts of which it consists, and of one that is a device within the device its own
    records, `shift` further, behind its name."""
    devices = {str(one.get("title")): one.get("device") for one in mappings(value_at(source.json, step["devices"]))}
    left = iter(range(_MOST_PARTS))

    def parts_of(record: Record, prefix: str, shift: int) -> Iterator[Record]:
        inner = devices.get(str(record.get("device_type")))
        if not isinstance(inner, Mapping) or len(prefix) > _DEEPEST:
            for part in mappings(record.get("consists_of")) or [record]:
                yield {**record, **part, "name": f"{prefix}{part.get('name') or ''}", "shift": shift}
            return
        further = shift + count_in(record.get("shift"))
        above = {key: value for key, value in record.items() if key[:1] == "^"}
        for one, _ in zip(mappings(inner.get("channels")), left, strict=False):
            yield from parts_of({**above, **one}, f"{prefix}{record.get('name')} ", further)

    for record in records:
        yield from parts_of(record, "", 0)


_STEPS: Final[Mapping[str, Step]] = {
    step.__name__[1:]: step
    for step in (_aliases, _above, _also, _asked, _joined, _kept, _keyed, _laid, _listed,
                 _logical, _pairs, _parsed, _straight, _variables, _within, _words)
}  # fmt: skip


def step_named(name: str) -> Step:
    """What a step does."""
    step: Step = _STEPS[name] if name in _STEPS else import_module(f"{__package__}.{name}").adapted
    return step
