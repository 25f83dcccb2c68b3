"""Templates of summaries: `read {quantity:coil} from {starting_address}`.

`{name}` is a field's text; `{name:noun}` its number with the noun, in the plural where it takes one.
"""

from __future__ import annotations

from collections.abc import Iterable

from .fields import Field


class _Word:
    def __init__(self, field: Field) -> None:
        self.field = field

    def __format__(self, noun: str) -> str:
        if not noun:
            return self.field.text
        value = self.field.value
        if not isinstance(value, int):
            return f"{self.field.text} {noun}"
        return f"{value} {noun}{'' if value == 1 else 's'}"


def filled(template: str, fields: Iterable[Field]) -> str | None:
    """The template with its fields put in; None where one is missing (or the template is empty)."""
    if not template:
        return None
    try:
        return template.format_map({field.name: _Word(field) for field in fields})
    except (LookupError, AttributeError, ValueError):
        return None
