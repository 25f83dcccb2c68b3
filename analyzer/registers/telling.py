"""How places and made-up names of values are told to people, in the language in use.

Maps, JSON and filters have areas, types and names as they are: only what a person reads is told here.
"""

from __future__ import annotations

import re
from typing import Final

from ..languages import register_words

ROLES: Final = ("measurement", "counter", "setpoint", "status")
STILL: Final = ("constant", "unknown")  # kinds of what never moved
AREAS: Final = {
    "coil": "coil {at}", "discrete": "discrete {at}", "input": "input {at}", "holding": "holding {at}",
}  # fmt: skip
"""A place in a sentence, by its area; the area alone is its word in a column of places."""
_MADE_UP: Final = re.compile(rf"({'|'.join((*ROLES, *STILL))}) ([rb]\d+)")


def span(address: int, words: int = 1) -> str:
    """`100`, or `100-101`."""
    return f"{address}-{address + words - 1}" if words > 1 else str(address)


def place_cell(area: str, address: int, words: int = 1) -> str:
    """A place in a column of places, short: `input 100-101`."""
    return f"{register_words(area)} {span(address, words)}"


def place_words(area: str, address: int, words: int = 1) -> str:
    """A place in a sentence: `input 100-101`."""
    return register_words(AREAS[area], at=span(address, words))


def unit_place(unit: int, area: str, address: int, words: int = 1) -> str:
    """`unit 1 input 100-101`."""
    return register_words("unit {unit} {place}", unit=unit, place=place_words(area, address, words))


def made_up_name(value: str, area: str, address: int) -> str:
    """The name of a value that nobody has named: what it is (its role or kind), and where."""
    return f"{value} {'b' if area in ('coil', 'discrete') else 'r'}{address}"


def told_name(name: str) -> str:
    """A value's name; one that was made up here in the language in use."""
    match = _MADE_UP.fullmatch(name)
    return f"{register_words(match[1])} {match[2]}" if match else name
