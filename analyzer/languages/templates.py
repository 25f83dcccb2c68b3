"""Templates of sentences: nouns that agree with what stands beside them, clauses that are left out if they say nothing.

{asked:request|requests}             5 requests; Russian has three forms: {asked:запрос|запроса|запросов}
{asked:|stays|stay}                  the word alone, in its form
{units:unit|units}                   unit 5, or units 5, 7: a noun before a list
[, {hits} of {trials} of others]     left out where its last number is 0, its last list or words empty
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from string import Formatter
from typing import Any, Final

CLAUSE: Final = re.compile(r"\[([^][]*)\]")


def form_of(number: int, forms: Sequence[str]) -> str:
    """That of two forms (one, more) or of three (one, two to four, five and more) which goes with a number."""
    if len(forms) == 2:
        return forms[number != 1]
    last, teens = number % 10, number % 100 // 10 == 1
    return forms[0 if last == 1 and not teens else 1 if last in (2, 3, 4) and not teens else 2]


class TemplateFiller(Formatter):
    """Fills templates; lists are tuples."""

    def format_field(self, value: Any, spec: str) -> str:
        listed = isinstance(value, tuple)
        shown = ", ".join(map(str, value)) if listed else value
        noun, *forms = spec.split("|")
        if not forms:
            return str(super().format_field(shown, spec))
        word = form_of(len(value) if listed else round(value), forms if not noun else [noun, *forms])
        if not noun:
            return word
        return f"{word} {shown}" if listed else f"{round(value)} {word}"


_FILLER: Final = TemplateFiller()


def fill(template: str, numbers: Mapping[str, Any]) -> str:
    """The sentence of a template with its numbers."""

    def told(clause: re.Match[str]) -> str:
        names = [name for _, name, _, _ in Formatter().parse(clause[1]) if name]
        return clause[1] if not names or numbers[names[-1]] else ""

    return _FILLER.vformat(CLAUSE.sub(told, template), (), numbers)
