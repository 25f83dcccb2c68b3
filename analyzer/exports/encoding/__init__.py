"""Frames as JSON text, fast enough for millions.

A line is put together from pieces that were encoded once, each from what annotation said of it (`sheet`): what a field
says hangs on little more than its own bytes, so a table has most of it. A frame that is not of such a form (`forms`) is
annotated whole.
"""

from .lines import FrameJsonLines, FramesAhead, explain_json, noise_json

__all__ = ["FrameJsonLines", "FramesAhead", "explain_json", "noise_json"]
