"""Captures with one thing wrong, again and again, on an otherwise healthy bus, and the truth about where.

`stage` is the healthy bus and the collection of defects, the other files hold them, a family each.
"""

from __future__ import annotations

from .stage import EVERY_TAP, Defect, defects

__all__ = ["EVERY_TAP", "Defect", "defects"]
