"""Which keys the footer shows: whole ones, as many as there is room for, those for help and to leave among them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from rich.cells import cell_len
from textual.binding import ActiveBinding, Binding

from ..languages import tr

_ALWAYS: Final = frozenset({"help", "leave"})  # actions


def in_language(active: ActiveBinding) -> ActiveBinding:
    """The same binding, told in the language in use."""
    binding = replace(active.binding, description=tr(active.binding.description))
    return active._replace(binding=binding, tooltip=tr(active.tooltip))


def fitting(
    active: Mapping[str, ActiveBinding], display: Callable[[Binding], str], width: int
) -> dict[str, ActiveBinding]:
    """The same bindings by key, those that do not fit into a line of `width` cells no longer shown in it."""
    first = {each.binding.action: each.binding for each in reversed([*active.values()]) if each.binding.show}
    cells = {action: cell_len(f"{display(binding)} {binding.description} ") for action, binding in first.items()}
    room = width - sum(cells[action] for action in _ALWAYS & cells.keys())
    left_out: set[str] = set()
    for action in dict.fromkeys(each.binding.action for each in active.values() if each.binding.show):
        if action in _ALWAYS:
            continue
        room = -1 if cells[action] > room else room - cells[action]  # and none behind it: they keep their order
        if room < 0:
            left_out.add(action)
    return {
        key: each._replace(binding=replace(each.binding, show=False)) if each.binding.action in left_out else each
        for key, each in active.items()
    }
