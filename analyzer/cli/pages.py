"""The pages of the documentation, as they stand in an installed package or in a clone."""

from __future__ import annotations

from pathlib import Path
from typing import Final

_INSTALLED: Final = Path(__file__).parents[1] / "pages"
_CLONE: Final = Path(__file__).parents[2] / "docs"  # of a clone


def pages() -> dict[str, Path]:
    """The pages, by name."""
    folder = _INSTALLED if _INSTALLED.is_dir() else _CLONE
    return {page.stem: page for page in folder.glob("*.md") if page.stem != "index"}  # the site's own
