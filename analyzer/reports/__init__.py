"""A bus in one page: `summarize(capture) -> Report` counts, `text(report)` lays it out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .model import Report
    from .page import text
    from .summary import Summary, of_one_line, summarize

__all__ = ["Report", "Summary", "of_one_line", "summarize", "text"]

_HOME = {"Report": "model", "Summary": "summary", "of_one_line": "summary", "summarize": "summary", "text": "page"}


__getattr__ = lazily(__name__, _HOME)
