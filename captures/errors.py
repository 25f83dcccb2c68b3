"""Unusable input, as one line.

The only exception that this package raises for input that it can't use. Its text is a whole message for a person:
what is wrong, where (file, line, offset) and what to do. Damage inside a file that is otherwise usable is not an
exception: see `captures.chunks.Damage`.
"""

from __future__ import annotations


class CaptureError(Exception):
    """Input or output that can't be used at all; `str()` is one line for a person."""


def os_reason(error: OSError) -> str:
    """What the operating system said, without the number and the path that `str(error)` carries."""
    return (error.strerror or str(error) or type(error).__name__).lower()
