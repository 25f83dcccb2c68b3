"""JSON of fields, whole and in the parts that hang on different things."""

from __future__ import annotations

from typing import Any

import orjson

from dissectors.fields import Field


def encoded(value: Any) -> bytes:
    """A value as JSON."""
    return orjson.dumps(value)


def inside(text: str) -> bytes:
    """What stands between the quotes of a text in JSON."""
    return orjson.dumps(text)[1:-1]


def insides(texts: list[str]) -> list[bytes]:
    """What stands between the quotes of each of some texts; a quote in one would have a backslash before it."""
    return orjson.dumps(texts)[2:-2].split(b'","') if texts else []


def middle(value: int | bool, raw: str) -> bytes:
    """What `parted` gives as the second part, for a number or truth value."""
    said = ("true" if value else "false") if value is True or value is False else value
    return f'{said},"raw":"{raw}","text":"'.encode()


def parted(field: Field) -> tuple[bytes, bytes, bytes, bytes]:
    """A field's JSON in four: up to its value, up to its text, its text, the rest."""
    whole = orjson.dumps(field.to_json())
    value = whole.index(b'"value":') + len(b'"value":')
    text = whole.index(b'"text":"', value) + len(b'"text":"')
    end = text + len(inside(field.text))
    return whole[:value], whole[value:text], whole[text:end], whole[end:]
