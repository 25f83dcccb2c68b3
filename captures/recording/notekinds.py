"""Kinds of notes that others than the recorder ask for; apart, as these need no files."""

from typing import Final

MARK: Final = "mark"  # of what a user marked while it was recorded
CLOSED: Final = "closed"  # until when was listened
