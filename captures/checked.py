"""What a judge of bytes says of them, be they read from a text or from a packet."""

from __future__ import annotations

from typing import NamedTuple


class Checked(NamedTuple):
    """A stretch of bytes whose check value, or whose header's length, is right.

    `repeats`: its answer may be the same bytes again. `envelope`: the protocol that it is a frame of, by its name.
    `turned`: the bytes of the check value are the wrong way round. `odd`: the header says another length.
    """

    start: int
    end: int
    repeats: bool = False
    envelope: str = ""
    turned: bool = False
    odd: bool = False
