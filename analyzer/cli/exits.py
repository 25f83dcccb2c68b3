"""How a command ends: its exit status, and the error of those who typed it.

`MEANINGS` says what each tells; help and the manual page print it.
"""

from __future__ import annotations

from typing import Final

DONE: Final = 0
NO_FRAME: Final = 1
FAILED: Final = 1
UNUSABLE: Final = 2
INTERRUPTED: Final = 130
MEANINGS: Final = (
    (DONE, "done"),
    (
        FAILED,
        "the input holds no frame, an assertion fails, a recording lost bytes, or a capture of a batch is damaged",
    ),
    (UNUSABLE, "unusable arguments or input, with one line that says why"),
    (INTERRUPTED, "ended by Ctrl-C, or by a signal before all was shown; what was done is kept"),
)


class UsageError(Exception):
    """Arguments that cannot be used; the message says which and what to do."""
