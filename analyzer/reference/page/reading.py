"""What the page in the browser asks: a text read, as `rtuscope parse -f -` prints it."""

from __future__ import annotations

from typing import NamedTuple

from captures.errors import HexError
from captures.text import encodings

from ...languages import error_words, telling
from ...paste import PasteError, read, tree


class PrintedPaste(NamedTuple):
    """What goes to standard output, and the line that says why there is nothing."""

    text: str
    complaint: str


def printed(text: str, language: str = "en") -> PrintedPaste:
    """A paste in words."""
    with telling(language):
        try:
            return PrintedPaste(tree(read(text)), "")
        except (HexError, PasteError) as error:
            return PrintedPaste("", error_words(error))


def printed_file(data: bytes, language: str = "en") -> PrintedPaste:
    """The same of a file's bytes, in whatever encoding."""
    return printed(encodings.decoded(bytes(data)), language)
