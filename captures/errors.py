"""Unusable input, as one line.

The exceptions that this package raises for input that it can't use. Their text is a whole message for a person:
what is wrong, where (file, line, offset) and what to do. Damage inside a file that is otherwise usable is not an
exception: see `captures.chunks.Damage`.
"""

from __future__ import annotations

from typing import Any, Final

# Windows' numbers for a file that somebody has open: it can be neither renamed nor replaced nor removed meanwhile.
OPEN_ELSEWHERE: Final = {
    5: "access denied: it may be open in another program",
    32: "open in another program",
    33: "open in another program",
}


class CaptureError(Exception):
    """Input or output that can't be used at all; `str()` is one line for a person."""


class HexError(ValueError):
    """Text that should be hex bytes and is not; `str()` is one line with the position."""


def os_reason(error: OSError) -> str:
    """What the operating system said, without the number and the path that `str(error)` carries."""
    if (number := getattr(error, "winerror", None)) in OPEN_ELSEWHERE:
        return OPEN_ELSEWHERE[number]
    if distrust := getattr(error, "verify_message", ""):  # of TLS, as those below; `ssl` is not imported for that
        return f"its certificate is not trusted: {distrust.lower()}"
    if type(error).__name__ == "SSLEOFError":
        return "closed by the other end"
    if getattr(error, "library", None) and (said := getattr(error, "reason", None)):
        return f"TLS: {str(said).replace('_', ' ').lower()}"
    own = error.__context__  # `socket.create_server` raises it anew, with the address in Python's words
    first: Any = own if getattr(own, "errno", -1) == error.errno else error
    return (first.strerror or str(first) or type(first).__name__).lower()
