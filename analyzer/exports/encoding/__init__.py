"""Frames as JSON text, fast enough for millions.

A line is put together from pieces that were encoded once, each from what annotation said of it (`pieces`): what a field
says hangs on little more than its own bytes, so a table has most of it. Where a frame is not of that form (`fields`),
it is annotated whole (`whole`).
"""

from .lines import JsonLines
from .whole import Encoded, Encoder, explain_json, noise_json

__all__ = ["Encoded", "Encoder", "JsonLines", "explain_json", "noise_json"]
