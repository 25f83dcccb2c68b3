"""What could be typed next: the parser says which kinds of words fit, the table of fields which words there are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from ..languages import tr
from ..words import UNITS_NS
from .fields import FIELDS, FilterField, by_name
from .kinds import Duration, Moment, Suggestion
from .literals import spelled

_WORD: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*\Z")
_STRINGS: Final = re.compile(r"\"[^\"]*\"|'[^']*'")
_OPERATORS: Final = {
    "==": "equal",
    "!=": "has it, but none equal",
    "<": "less",
    "<=": "at most",
    ">": "more",
    ">=": "at least",
    "contains": "has this in it",
    "matches": "* any characters, ? one",
}
_JOINS: Final = {
    "AND": ("and", "both"),
    "OR": ("or", "either"),
    "NOT": ("not", "the opposite"),
}
_TIMES: Final = {"us": "microseconds", "ms": "milliseconds", "s": "seconds", "min": "minutes", "h": "hours"}


@dataclass(frozen=True, slots=True)
class Completion:
    """`text` could stand from `start` up to the cursor; `help` is a few words on it."""

    text: str
    help: str
    start: int


def complete(text: str, cursor: int) -> list[Completion]:
    """What could stand at the cursor; nothing where what is before it makes no sense."""
    from lark.exceptions import UnexpectedInput

    from .parsing import LONGEST, grammar  # a moment to import, which nobody waits for who types no filter

    before = text[: max(cursor, 0)]
    if len(before) > LONGEST:
        return []
    start, begun = _begun(before)
    parser = grammar().parse_interactive(before[:start])
    field: FilterField | None = None
    try:
        for token in parser.iter_parse():
            if token.type == "NAME":
                field = by_name().get(token.lower())
    except UnexpectedInput:
        return []
    offers = _offered(parser.accepts(), field)  # type: ignore[no-untyped-call]
    return [Completion(each.text, each.help, start) for each in offers if _fits(each.text, begun)]


def _begun(before: str) -> tuple[int, str]:
    """Where the word at the cursor begins, and what of it is there."""
    rest = _STRINGS.sub(lambda match: " " * len(match[0]), before)
    open_quote = min((at for at in (rest.find('"'), rest.find("'")) if at >= 0), default=-1)
    if open_quote >= 0:
        return open_quote, before[open_quote:]
    match = _WORD.search(rest)
    return (match.start(), match[0]) if match else (len(before), "")


def _offered(awaited: Iterable[str], field: FilterField | None) -> Iterator[Suggestion]:
    kinds = set(awaited)
    if "NAME" in kinds:
        yield from (Suggestion(each.name, tr(each.help)) for each in FIELDS)
    if "WORD" in kinds and field is not None:
        yield from field.kind.choices()
    if "COMPARED" in kinds and field is not None:
        yield from (Suggestion(operator, tr(_OPERATORS[operator])) for operator in field.kind.operators)
        yield Suggestion("in", tr("one of (1, 2), or a range 1..5"))
    if "UNIT" in kinds and field is not None and isinstance(field.kind, Duration | Moment):
        yield from (Suggestion(unit, tr(_TIMES[unit])) for unit in UNITS_NS if unit in _TIMES)
        if isinstance(field.kind, Duration):
            yield Suggestion("chars", tr("characters at the line's speed"))
    yield from (Suggestion(word, tr(help)) for name, (word, help) in _JOINS.items() if name in kinds)


def _fits(text: str, begun: str) -> bool:
    """Whether a word goes on from what is typed; quotes, case and how words are put together do not matter."""
    typed = begun.strip("\"'")
    return spelled(text.strip('"')).startswith(spelled(typed)) if typed else not begun or text.startswith(('"', "'"))
