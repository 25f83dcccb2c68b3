"""Pasted bytes, read: `read(text) -> Paste`, then `Paste.to_json()` or `tree(paste)`.

What people paste is small, has no times and comes in every shape; it is read in plain Python where one frame, or frames
end to end, explain all of it, and by the deframer where they don't. Arrays are not imported before that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from ..deframing.judging import judge
    from .model import Paste, PastedFrame, PastedNoise
    from .reading import PasteError, read
    from .trees import left_out, tree

__all__ = ["Paste", "PasteError", "PastedFrame", "PastedNoise", "judge", "left_out", "read", "tree"]

_HOME = {
    "PastedFrame": "model",
    "PastedNoise": "model",
    "Paste": "model",
    "PasteError": "reading",
    "judge": "reading",
    "left_out": "trees",
    "read": "reading",
    "tree": "trees",
}


__getattr__ = lazily(__name__, _HOME)
