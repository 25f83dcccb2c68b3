"""Text that came from the bus, made safe to show: the one place where foreign bytes become characters.

A device may say anything in its strings. Control characters (C0, C1), line and paragraph separators, bidirectional
overrides, zero-width and other invisible characters come out as their escape (`\\x1b`, `\\u202e`), so that a name
cannot move a cursor, recolour a terminal, forge a line or turn the text around it.
"""

from __future__ import annotations


def harmless(text: str) -> str:
    """`text` with every character that does not print as itself written as its escape."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def device_text(data: bytes) -> str:
    """A device's string: ASCII by the specification, UTF-8 where it is, other bytes as `\\xNN`; harmless."""
    return harmless(data.decode("utf-8", "backslashreplace"))


def is_text(data: bytes) -> bool:
    """Whether these bytes are printable ASCII, trailing NULs apart, and so probably meant as text."""
    body = data.rstrip(b"\0")
    return bool(body) and all(0x20 <= byte < 0x7F for byte in body)
