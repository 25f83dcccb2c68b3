"""A bus in one page: `summarize(capture) -> Report` counts, `text(report)` lays it out."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .model import Report
    from .page import text
    from .summary import Summary, summarize

__all__ = ["Report", "Summary", "summarize", "text"]

_HOME = {"Report": "model", "Summary": "summary", "summarize": "summary", "text": "page"}


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name in _HOME:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
