"""A report as one self-contained HTML page, to send to a colleague: no script, nothing fetched, readable on paper.

`Sights.feed` collects what the page shows beyond the counts, in the same single pass; `page` lays everything out.
"""

from __future__ import annotations

from .examples import Sights
from .page import page

__all__ = ["Sights", "page"]
