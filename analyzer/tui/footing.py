"""Which keys the footer shows: whole ones, as many as there is room for, those for help and to leave among them.

They are told in the language in use.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from rich.cells import cell_len
from textual.binding import ActiveBinding, Binding
from textual.widget import Widget
from textual.widgets import Input

from ..languages import tr

_ALWAYS: Final = frozenset({"help", "leave"})  # actions
_LAST: Final = ("export", "door('=')", "span")  # where all others have room


def fitting(
    bindings: Mapping[str, ActiveBinding], display: Callable[[Binding], str], width: int, focused: Widget | None = None
) -> dict[str, ActiveBinding]:
    """The same bindings by key, those that do not fit into a line of `width` cells no longer shown in it.

    Where one types into a line (`focused`), its own keys alone: the letters of all others are text there.
    """
    if isinstance(focused, Input):
        bindings = {key: each if each.node is focused else _unshown(each) for key, each in bindings.items()}
    active = {key: _in_language(each) if each.binding.show else each for key, each in bindings.items()}
    first = {each.binding.action: each.binding for each in reversed([*active.values()]) if each.binding.show}
    cells = {action: cell_len(f"{display(binding)} {binding.description} ") for action, binding in first.items()}
    room = width - sum(cells[action] for action in _ALWAYS & cells.keys())
    left_out: set[str] = set()
    wanted = dict.fromkeys(each.binding.action for each in active.values() if each.binding.show)
    for action in sorted((each for each in wanted if each not in _ALWAYS), key=_rank):
        room = -1 if cells[action] > room else room - cells[action]  # and none behind it: they keep their order
        if room < 0:
            left_out.add(action)
    return {key: _unshown(each) if each.binding.action in left_out else each for key, each in active.items()}


def _unshown(active: ActiveBinding) -> ActiveBinding:
    return active._replace(binding=replace(active.binding, show=False))


def _rank(action: str) -> int:
    return _LAST.index(action) + 1 if action in _LAST else 0


def _in_language(active: ActiveBinding) -> ActiveBinding:
    binding = replace(active.binding, description=tr(active.binding.description))
    return active._replace(binding=binding, tooltip=tr(active.tooltip))
