"""Captured bytes with their times, from anywhere. Knows nothing of what the bytes mean.

    capture = captures.open("bus.jsonl")
    for block in capture.blocks():      # columns: block.data, block.offsets, block.t_ns ...
        ...
    for damage in capture.damage:       # what could not be read, and where
        ...

Names are loaded when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .chunks import Block, Capture, Chunk, Damage, Mark
    from .errors import CaptureError
    from .files import replacing
    from .io import open, write
    from .line import LineSettings

_HOMES = {
    "Block": "chunks",
    "Capture": "chunks",
    "CaptureError": "errors",
    "Chunk": "chunks",
    "Damage": "chunks",
    "LineSettings": "line",
    "Mark": "chunks",
    "open": "io",
    "replacing": "files",
    "write": "io",
}

__all__ = [
    "Block",
    "Capture",
    "CaptureError",
    "Chunk",
    "Damage",
    "LineSettings",
    "Mark",
    "open",
    "replacing",
    "write",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
