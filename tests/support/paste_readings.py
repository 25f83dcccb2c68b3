"""What is read of a paste."""

from __future__ import annotations

from analyzer.paste import PasteError, judge, read
from captures.errors import HexError
from captures.hexwords import read_text


def frames_read(text: str) -> list[tuple[str, str]]:
    """The roles and bytes of its right frames; of one that cannot be read, the error."""
    try:
        paste = read(text)
    except (HexError, PasteError) as error:
        return [("error", str(error))]
    return [(frame.role.name.lower(), frame.adu.data.hex()) for frame in paste.frames() if frame.check_ok]


def bytes_read(text: str) -> bytes:
    """All bytes of a text, before they are put into frames (none is lost there, as a property test says)."""
    try:
        return b"".join(words.data for words in read_text(text, judge))
    except HexError:
        return b""
