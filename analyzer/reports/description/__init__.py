"""A bus described from what it did: `describe` reads a capture, `markdown` and `html` lay the description out."""

from __future__ import annotations

from .model import BusDescription, describe
from .page import html, markdown

__all__ = ["BusDescription", "describe", "html", "markdown"]
