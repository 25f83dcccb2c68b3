"""What texts say of a value beside its name: the step, the unit, the sign, limits, in any column.

    name_apart("Line voltage (x0.1 V, signed)")     # ("Line voltage", {"scale": "0.1", "unit": "V", "sign": "signed"})
    facts_in_remark("raw / 10 = °C")                # {"scale": "1/10", "unit": "°C"}

A text has fragments: what brackets hold, and what commas, semicolons and dashes part. A fragment tells what the first
form of `vocabulary.toml` (`facts`) that is like all of it has in its groups, or, behind the heading of a column,
what a cell of that column would tell. Of a name, the last fragments are cut off as long as they tell something; what
tells nothing belongs to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, Final

from .cells import fraction
from .vocabulary import (
    NEVER,
    WIDE_SIGNS,
    expression,
    form,
    has_met,
    meet,
    plain_heading,
    roles_headed,
    tidied,
    vocabulary,
)
from .written import together

TOLD: Final = ("scale", "unit", "low", "high", "added", "sign", "access", "type")
_LONGEST: Final = 60  # characters of a fragment
_MOST: Final = 12  # fragments of a text
_LABELS: Final = ("scale", "unit")  # columns whose headings open a fragment
_SIGNS: Final = str.maketrans("\u2212⁻,×*⁰¹²³⁴⁵⁶⁷⁸⁹", "--.xx0123456789")
_POWERS: Final = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
Facts = Mapping[str, str]


@lru_cache(maxsize=4096)
def plain(text: str) -> str:
    """A text with numbers, signs of times and over, and powers of ten in one way."""
    meet(text)
    return tidied("fragment", text.translate(WIDE_SIGNS))


def scale_of(parts: Mapping[str, str]) -> str:
    """The factor that the groups of a form come to, as a number or a fraction."""
    tens = len(parts.get("digits") or "") + int(parts.get("places") or 0)
    over = parts.get("times") or f"1{'0' * tens}" * (tens > 0)
    step = parts.get("step") or "1" * (over != "")
    power = f"1e{parts['power'].translate(_POWERS)}" if parts.get("power") else ""
    return power or "/".join(filter(None, (step, over))).replace(",", ".")


@lru_cache(maxsize=8192)
def facts_in(text: str, kind: str) -> Facts:
    """What a fragment tells in a place of this kind (`behind` a name, in a `remark`, `measure`, a `cell` of these);
    nothing where no form is like it."""
    text = plain(text).strip(" .:")
    if not 0 < len(text) <= _LONGEST:
        return {}
    lines = (line for line in vocabulary()["facts"] if kind in line["of"])
    said = next(filter(None, (_said_by(line, text) for line in lines)), {})
    return {key: said[key].strip() for key in TOLD if said.get(key)} if said else _labelled(text)


def _said_by(line: Mapping[str, Any], text: str) -> Facts:
    """What a text says by a line of the table of facts; nothing where it is not like it."""
    match = expression((NEVER, line["like"])[has_met(line.get("needs", ""))]).fullmatch(text)
    if match is None:
        return {}
    parts = {**match.groupdict(""), **line.get("gives", {})}
    return {**parts, "unit": parts.get("unit") or parts.get("unit_before", ""), "scale": scale_of(parts)}


def _labelled(text: str) -> Facts:
    """What stands behind the heading of a column, as a cell of that column tells it."""
    said = form("label", text)
    named = roles_headed(plain_heading(said.get("label", "")))
    role = next(filter(named.__contains__, _LABELS), "")
    behind = facts_in(said["value"], "measure") if role else {}
    return behind or ({"unit": said["value"]} if role == "unit" else {})


def fragments_of(text: str) -> Iterator[str]:
    """The fragments of a text, in turn."""
    yield from filter(None, map(str.strip, expression(vocabulary()["marks"]).split(plain(text), maxsplit=_MOST)))


def facts_in_remark(text: str) -> Facts:
    """What the fragments of a remark tell, the first that tells a thing, or all of it as one."""
    told: dict[str, str] = {}
    for fragment in (text, *fragments_of(text)):
        told = {**facts_in(fragment, "remark"), **told}
    return {**name_apart(text)[1], **told}


@lru_cache(maxsize=4096)
def name_apart(text: str) -> tuple[str, Facts]:
    """A name without what stands behind it, and what that tells."""
    told: Facts = {}
    for _ in range(_MOST):
        said = form("name_and_fragment", text)
        last = said.get("in") or said.get("behind") or said.get("last", "")
        found = [facts_in(part, "behind") for part in fragments_of(last)]
        if not (found and all(found)):
            break
        text = said["name"].rstrip(" ,;:–—-")
        told = {**dict(fact for one in found for fact in one.items()), **told}
    return text, told


@lru_cache(maxsize=4096)
def _told(at: int, text: str) -> Facts:
    """What a cell tells by a line of the table; `rest` is what it says else."""
    line = vocabulary()["facts"][at]
    return _said_by(line, _put_right(line.get("tidy", ""), text.translate(WIDE_SIGNS))) if text else {}


def _put_right(kind: str, text: str) -> str:
    """A text as numbers of its kind are read: of factors, or with a sign."""
    if kind == "scale":
        return tidied("scale", text.lower().replace(",", ".")).translate(_SIGNS)
    return together(text).replace("\u2212", "-").replace("- ", "-") if kind else text


def facts_of(cells: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """What the cells of a row tell, each from the first place that has it, and the cells without what they told.

    Told are `scale`, `unit`, `low`, `high`, `added`, `sign` and `access`.
    """
    left, told = dict(cells), dict.fromkeys(TOLD, "")
    of_unit, of_scale = (facts_in(cells.get(key, ""), "cell") for key in ("unit", "scale"))
    of_scale = {**facts_in_remark(cells.get("scale", "")), **of_scale}
    if of_scale.keys() == {"unit"}:
        left["scale"] = ""
    told["unit"] = {**of_scale, **of_unit}.get("unit", "")
    for at, line in enumerate(vocabulary()["facts"]):
        of = line["of"][0]
        cell = left.get(of, "")
        said = _told(at, cell)
        new = {key: fact for key, fact in said.items() if fact > told.get(key, fact) == ""}
        told |= new
        left[of] = (cell, said.get("rest", cell))[bool(new)]
    left["name"], behind = name_apart(left["name"])
    remarks = (facts_in_remark(left.get(key, "")) for key in ("description", "range"))
    for found in (of_scale, of_unit, behind, *remarks):
        told = dict(filter(all, told.items()))
        steps = {fraction("scale", {"scale": "1", **both}["scale"]) for both in ({**told, **found}, {**found, **told})}
        told = {**(found, {})[len(steps) > 1], **told}  # a remark that says another step is of something else
    told = {**dict.fromkeys(TOLD, ""), **told}
    low, high = (float(told[key].replace(",", ".") or number) for key, number in (("low", "-inf"), ("high", "inf")))
    return {**told, **({} if low <= high else {"low": "", "high": ""})}, left


def scaled_by(points: Sequence[str]) -> dict[str, str]:
    """Scale and offset of a line through two points: the least and the greatest raw number, and what they stand for."""
    numbers = [float(point.replace(",", ".")) for point in points if expression("{DECIMAL}").fullmatch(point)]
    run = numbers[1] - numbers[0] if len(numbers) == len(points) else 0.0
    if not run:
        return {}
    factor = (numbers[3] - numbers[2]) / run
    return {"scale": f"{factor:.10g}", "added": f"{numbers[2] - factor * numbers[0]:.10g}"}
