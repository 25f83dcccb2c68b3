"""Frames written for other programs: a file a target in `targets`, named by its suffix.

`export` streams a capture through the deframer into a target; memory stays flat and a file appears whole or not at all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .output import ExportError
    from .running import Exported, export
    from .sink import ExportOptions, formats

__all__ = ["ExportError", "ExportOptions", "Exported", "export", "formats"]

_HOME = {
    "ExportError": "output",
    "ExportOptions": "sink",
    "Exported": "running",
    "export": "running",
    "formats": "sink",
}


__getattr__ = lazily(__name__, _HOME)
