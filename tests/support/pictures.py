"""Screens as text to compare: what stands on the terminal, and below it how each stretch of it looks.

RTUSCOPE_PICTURES=1 in the environment writes them anew instead; look at the difference before committing it.
"""

from __future__ import annotations

import os
from difflib import unified_diff
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

_DRAWN_BY = "textual " + ".".join(version("textual").split(".")[:2])
_FOLDER = Path(__file__).parents[1] / "pictures"


def picture(screen: Any) -> str:
    """The lines of a screen; then, line by line, runs of (length, style), styles by letter in order of appearance."""
    letters: dict[str, str] = {}
    lines, looks = [], []
    for strip in screen._compositor.render_strips():
        lines.append("".join(segment.text for segment in strip).rstrip())
        runs: list[tuple[int, str]] = []
        for segment in strip:
            style = str(segment.style)
            letter = letters.setdefault(style, chr(ord("a") + len(letters) % 26) + "'" * (len(letters) // 26))
            if runs and runs[-1][1] == letter:
                runs[-1] = runs[-1][0] + segment.cell_length, letter
            else:
                runs.append((segment.cell_length, letter))
        looks.append(" ".join(f"{size}{letter}" for size, letter in runs))
    legend = [f"{letter} = {style}" for style, letter in letters.items()]
    return "\n".join([_DRAWN_BY, *lines, "", *looks, "", *legend]) + "\n"


def looks_as_before(name: str, screen: Any) -> bool:
    """Whether a screen is as it was; True where its picture is to be made anew."""
    path = _FOLDER / f"{name}.txt"
    return bool(os.environ.get("RTUSCOPE_PICTURES")) or picture(screen) == path.read_text(encoding="utf-8")


def compare(name: str, screen: Any) -> None:
    """A screen is as it was when somebody last looked at it."""
    path = _FOLDER / f"{name}.txt"
    now = picture(screen)
    if os.environ.get("RTUSCOPE_PICTURES"):
        path.parent.mkdir(exist_ok=True)
        path.write_text(now, encoding="utf-8")
    before = path.read_text(encoding="utf-8")
    if not before.startswith(_DRAWN_BY + "\n"):
        pytest.skip(f"{path.name} was drawn by another version of Textual: {before.splitlines()[0]}")
    changed = "\n".join(unified_diff(before.splitlines(), now.splitlines(), lineterm="", n=0))
    assert now == before, f"{path.name}: another picture (RTUSCOPE_PICTURES=1 keeps it)\n{changed}"
