"""Frames written for other programs: a file a target in `targets`, named by its suffix.

`export` streams a capture through the deframer into a target; memory stays flat and a file appears whole or not at all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .running import Exported, export
    from .sink import ExportError, ExportOptions, formats

__all__ = ["ExportError", "ExportOptions", "Exported", "export", "formats"]

_HOME = {
    "ExportError": "sink",
    "ExportOptions": "sink",
    "Exported": "running",
    "export": "running",
    "formats": "sink",
}


__getattr__ = lazily(__name__, _HOME)
