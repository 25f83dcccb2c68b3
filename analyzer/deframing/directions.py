"""Which direction a port hears, where each tap hears one only (RS-422, RS-232): known, not guessed.

A capture says so by the note `directions` of its line: a direction for each port, in order, `request,response`.
"""

from __future__ import annotations

from typing import Final

from captures.line import LineSettings
from dissectors.lengths import Role

NOTE: Final = "directions"
_ROLES: Final = {"request": Role.REQUEST, "response": Role.RESPONSE}


def role_of(line: LineSettings, port: int) -> Role | None:
    """The only role that frames of a port have; None where it hears both directions."""
    words = line.notes.get(NOTE, "").split(",")
    return _ROLES.get(words[port].strip()) if port < len(words) else None
