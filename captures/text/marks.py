"""Direction marks in a line of text: what tools and people write for "sent" and "received".

A word (`TX`, `Sent`, `Request`) is a mark wherever it stands, an arrow only before the line's first bytes: between two
runs of bytes it joins a request with its answer. A colon right after a word is the word's, not the start of an ASCII
frame. What sent and received mean for the bus is not decided here.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

NONE, TX, RX = 0, 1, 2

_WORDS = {
    TX: "tx txd send sending sent transmit transmitted transmitting request req query outgoing "
    "запрос отправка отправлено отправлен передача передано послано",
    RX: "rx rxd recv rcvd receive receiving received response resp reply answer incoming "
    "ответ приём прием принято принят получено получен",
}
_MARK_OF = {word: mark for mark, words in _WORDS.items() for word in words.split()}
_SHOUTED = {"OUT": TX, "IN": RX}  # too common as words: marks only in capitals and with a sign behind
_ARROW_OF = {">": TX, "→": TX, "⇒": TX, "▶": TX, "<": RX, "←": RX, "⇐": RX, "◀": RX}
_CANDIDATE = re.compile(
    r"(?<![A-Za-zА-Яа-яЁё0-9_])(?P<word>[A-Za-zА-Яа-яЁё]{2,12})(?![A-Za-zА-Яа-яЁё])(?P<sign>\s*[:\]>|])?|"
    r"(?P<arrow>-{1,3}>|=+>|>{2,3}|<-{1,3}|<=+|<{2,3}|[→⇒▶←⇐◀]|^\s*[<>](?=\s))"
)


@dataclass(frozen=True, slots=True)
class Segment:
    """Text between two marks, spaces before it so that columns stay those of the line, and the mark before it."""

    text: str
    mark: int
    arrow: bool


def segments(text: str) -> list[Segment]:
    """A line cut at its marks."""
    out, start, mark, arrow = [], 0, NONE, False
    for match in _CANDIDATE.finditer(text):
        found, end = _mark(match)
        if found:
            out.append(Segment(" " * start + text[start : match.start()], mark, arrow))
            start, mark, arrow = end, found, match["word"] is None
    out.append(Segment(" " * start + text[start:], mark, arrow))
    return out


def _mark(match: re.Match[str]) -> tuple[int, int]:
    """The mark that a word or arrow is, and where it ends."""
    word = match["word"]
    if word is None:
        arrow = match["arrow"].strip()
        return _ARROW_OF[arrow[0] if arrow[0] in _ARROW_OF else arrow[-1]], match.end()
    end = match.end("word")
    found = _MARK_OF.get(word.lower(), NONE)
    if not found and match["sign"]:
        found = _SHOUTED.get(word, NONE)
    return found, end + match.string.startswith(":", end)
