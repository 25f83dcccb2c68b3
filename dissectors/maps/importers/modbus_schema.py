"""The expressions of Modbus Schema: a function of registers, and a factor."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

from ...values import ValueFormError, physical
from .source import MapSource

_CALL: Final = re.compile(
    r"\s*(?:(?P<function>\w+)\(\s*)(?:(?P<swap>swap\w+)\(\s*)?(?P<first>[\w-]+:\d+|\d+x\d+|\d+)\s*"
    r"(?:#\s*(?P<count>\d+)|\.\.\s*(?P<last>[\w-]+:\d+|\d+x\d+|\d+))?\s*\)?\s*(?:;(?P<rest>.*))?\)\s*"
    r"(?:(?P<operator>[*/])\s*(?P<number>[\d.]+))?\s*",
    re.DOTALL,
)
_STATE: Final = re.compile(r"(\d+)\s*->\s*'([^']*)'")
_LONGEST: Final = 2000  # characters of an expression


def adapted(_: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The records, with what their expressions say; what is computed from other fields is noted."""
    for record in records:
        expression = str(record.get("expression") or "")[:_LONGEST]
        call = _CALL.fullmatch(expression)
        area, place = _spot(call["first"]) if call else ("", None)
        if call is None or place is None:
            record |= {"notes": [f"{expression!r} is computed, or no type of a map"], "skipped": True}
            yield record
            continue
        said = call.groupdict("")
        last = _spot(said["last"])[1]
        record |= {"area": area, "place": place, **call.groupdict()}
        record["length"] = int(call["count"] or 1) if last is None else last - place + 1
        record["divided" if call["operator"] == "/" else "factor"] = call["number"]
        record["states"] = {int(state): text for state, text in _STATE.findall(said["rest"])}
        yield record


def _spot(text: str) -> tuple[str, int | None]:
    """Area and address, as the expression names them."""
    word, colon, number = text.partition(":")
    if colon:
        return word, int(number)
    try:
        return physical(re.sub(r"x0+(?=\d)", "x", text))
    except ValueFormError:
        return "", None
