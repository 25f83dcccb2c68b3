"""How a command ends: its exit status, and the error of those who typed it.

`meanings` says what each tells of one command, `MEANINGS` of all; help and the manual page print them.
"""

from __future__ import annotations

from typing import Final

DONE: Final = 0
NO_FRAME: Final = 1
FAILED: Final = 1
UNUSABLE: Final = 2
INTERRUPTED: Final = 130
FAILURES: Final = {  # what status 1 tells, by command; the others do not end with it
    "parse": "the bytes hold no frame; with --check, a finding of severity error is among the findings",
    "export": "no frame, or nothing passes --filter; with --check, a finding of severity error is among the findings",
    "convert": "no byte of the line was left to write",
    "report": "no frame; with --check, a finding of severity error is among the findings",
    "check": "a rule fails, or the capture holds no frame",
    "batch": "a capture cannot be read, or is damaged; the others are in the lake",
    "watch": "with --once: a capture cannot be read, or is damaged; the others are in the lake",
    "registers": "no frame, no answer that carries a register, or with --like none that fits",
    "map": "traffic contradicts the map, or the capture holds no frame, or no register to make a map of",
    "sniff": "no frame came, or bytes were lost by the tap or by the recording",
    "record": "bytes of the line were lost",
    "replay": "nothing was played: no frame, or with --to no byte",
    "repair": "no byte of the line is left in it",
}
MEANINGS: Final = (
    (DONE, "done"),
    (
        FAILED,
        "the input holds no frame, an assertion fails, a recording lost bytes, or a capture of a batch is damaged",
    ),
    (UNUSABLE, "unusable arguments or input, with one line that says why"),
    (INTERRUPTED, "ended by Ctrl-C, or by a signal before all was shown; what was done is kept"),
)


def meanings(command: str) -> tuple[tuple[int, str], ...]:
    """The exit statuses of one command, with what each tells."""
    own = FAILURES.get(command)
    return tuple(
        (status, words if status != FAILED or own is None else own)
        for status, words in MEANINGS
        if status != FAILED or own is not None
    )


class UsageError(Exception):
    """Arguments that cannot be used; the message says which and what to do."""
