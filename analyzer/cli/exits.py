"""How a command ends: its exit status, and the error of those who typed it.

0: done. 1: the input holds no frame, what was asserted of it does not hold, or a recording lost bytes. 2: unusable
arguments or input. 130: ended by Ctrl-C, or by a signal before all was shown; what was done is kept.
"""

from __future__ import annotations

from typing import Final

DONE: Final = 0
NO_FRAME: Final = 1
FAILED: Final = 1
UNUSABLE: Final = 2
INTERRUPTED: Final = 130


class UsageError(Exception):
    """Arguments that cannot be used; the message says which and what to do."""
