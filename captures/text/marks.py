"""Direction marks in a line of text: what tools and people write for "sent" and "received".

A word (`TX`, `Sent`, `Request`) is a mark wherever it stands, an arrow only before the line's first bytes: between two
runs of bytes it joins a request with its answer. What sent and received mean for the bus is not decided here.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

NONE, TX, RX = 0, 1, 2

_WORDS = {
    TX: "txd?|send|sending|sent|transmit|transmitted|transmitting|request|req|query|outgoing|tosend",
    RX: "rxd?|recv|receive|receiving|received|response|resp|reply|answer|incoming|rcvd",
}
_ARROWS = {TX: r"-{1,3}>|=+>|>{2,3}|→|⇒|▶", RX: r"<-{1,3}|<=+|<{2,3}|←|⇐|◀"}
_MARK = re.compile(
    rf"(?P<tx>(?<![A-Za-z0-9_])(?:{_WORDS[TX]})(?![A-Za-z])|(?<![A-Za-z])(?-i:OUT)(?=\s*[:\]>|]))|"
    rf"(?P<rx>(?<![A-Za-z0-9_])(?:{_WORDS[RX]})(?![A-Za-z])|(?<![A-Za-z])(?-i:IN)(?=\s*[:\]>|]))|"
    rf"(?P<out>{_ARROWS[TX]}|^\s*>(?=\s))|(?P<back>{_ARROWS[RX]}|^\s*<(?=\s))",
    re.IGNORECASE,
)
_KIND = {"tx": (TX, False), "rx": (RX, False), "out": (TX, True), "back": (RX, True)}


@dataclass(frozen=True, slots=True)
class Segment:
    """Text between two marks, spaces before it so that columns stay those of the line, and the mark before it."""

    text: str
    mark: int
    arrow: bool


def segments(text: str) -> list[Segment]:
    """A line cut at its marks."""
    cuts = [(match.start(), match.end(), *_KIND[str(match.lastgroup)]) for match in _MARK.finditer(text)]
    stops = [cut[0] for cut in cuts] + [len(text)]
    out = [Segment(text[: stops[0]], NONE, False)]
    for (_, end, mark, arrow), stop in zip(cuts, stops[1:], strict=True):
        out.append(Segment(" " * end + text[end:stop], mark, arrow))
    return out
