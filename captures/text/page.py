"""The text of a page of HTML that a program saved in place of a log: a line a row of a table or a paragraph."""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Iterator
from contextlib import suppress
from html.parser import HTMLParser
from string import hexdigits
from typing import Any, BinaryIO, Final

_PIECE: Final = 1 << 18
_HEAD: Final = 1 << 14
_OURS: Final = b'<meta name="generator" content="rtuscope'  # a page of ours shows bytes, and is no capture
_NAMED: Final = 40  # characters in which an encoding is named
_SHOWN: Final = 4  # bytes in a row that are no chance
_LINES: Final = frozenset(("p", "div", "br", "hr", "tr", "table", "li", "dd", "pre", "h1", "h2", "h3", "h4", "h5"))
_CELLS: Final = frozenset(("td", "th"))
_UNSHOWN: Final = frozenset(("script", "style", "title"))


class _PageText(HTMLParser):
    """The text of a page, as it comes."""

    def __init__(self) -> None:
        super().__init__()
        self._out: list[str] = []
        self._unshown = self._kept = 0

    def handle_starttag(self, tag: str, attrs: object) -> None:  # noqa: ARG002 - the base's signature
        self._unshown += tag in _UNSHOWN
        self._kept += tag == "pre"
        if tag in _LINES:
            self._out.append("\n")

    def handle_endtag(self, tag: str) -> None:
        self._unshown = max(self._unshown - (tag in _UNSHOWN), 0)
        self._kept = max(self._kept - (tag == "pre"), 0)
        if tag in _LINES | _CELLS:
            self._out.append("  " if tag in _CELLS else "\n")

    def handle_data(self, data: str) -> None:
        if not self._unshown:
            self._out.append(data if self._kept else f" {' '.join(data.split())} ")

    def taken(self) -> str:
        """What has come since the last time, without empty lines."""
        lines, self._out = "".join(self._out).splitlines(keepends=True), []
        return "".join(line for line in lines if not line.isspace() or line[-1] != "\n")


def _decoder(head: bytes) -> Any:
    """What decodes a page, by what it says of itself."""
    named = head.lower().partition(b"charset=")[2][:_NAMED].decode("ascii", "replace").strip("\"' ")
    with suppress(LookupError):
        return codecs.getincrementaldecoder(named.replace('"', " ").replace("'", " ").split()[0])("replace")
    return codecs.getincrementaldecoder("utf-8")("replace")


def shows_bytes(head: bytes) -> bool:
    """Whether a page that begins so shows bytes, and is none of ours."""
    run = 0
    text = "" if _OURS in head else "".join(_text_of([head]))
    for word in text.translate(str.maketrans("-:", "  ")).split():
        run = (run + 1) * (len(word) == 2 and set(word) <= set(hexdigits))
        if run == _SHOWN:
            return True
    return False


def page_text(file: BinaryIO) -> Iterator[bytes]:
    """The text of a page of HTML, as UTF-8."""
    return (text.encode() for text in _text_of(iter(lambda: file.read(_PIECE), b"")) if text)


def _text_of(pieces: Iterable[bytes]) -> Iterator[str]:
    page, decoder = _PageText(), None
    for octets in pieces:
        decoder = decoder or _decoder(octets[:_HEAD])
        page.feed(decoder.decode(octets))
        yield page.taken()
    page.close()
    yield page.taken()
