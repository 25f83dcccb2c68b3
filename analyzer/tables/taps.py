"""What a capture was tapped from, and which findings and causes may speak of that: one table for both.

A network's packets have no wire, no UART and no silence of their own; bytes of a text have no tap whose settings could
be wrong; a few lines of a log were chosen by somebody, and tell nothing of what is not among them; characters that a
logic analyser gave were whole on its line, whatever they mean.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import Enum, auto
from typing import Final

from captures.line import EXCERPT_NOTE, LineSettings


class TapKind(Enum):
    """Where bytes come from."""

    SERIAL = auto()  # a UART that is set to the line
    EDGES = auto()  # a logic analyser, whose edges a program read
    NETWORK = auto()  # packets
    BYTES = auto()  # a text or raw bytes, of which nobody knows
    EXCERPT = auto()  # a few lines of a log


_NAMED: Final = {"network": TapKind.NETWORK, "logic": TapKind.EDGES}
_UART: Final = frozenset((TapKind.SERIAL, TapKind.EDGES, TapKind.BYTES))  # of which a UART, or edges, gave the bytes
_WHOLE: Final = frozenset(TapKind) - {TapKind.EXCERPT}  # which leave nothing out
_SPEAK_OF: Final[dict[str, Collection[TapKind]]] = {  # finding or cause: the taps, where not all of them
    "collision": _WHOLE,
    "unit-line-settings": _WHOLE,
    "tap-line-settings": (TapKind.SERIAL, TapKind.EDGES),
    "tap-flow-control": (TapKind.SERIAL, TapKind.BYTES),
    "tap-one-direction": _UART,
    "tap-reversed": _UART,
    "local-echo": _UART | {TapKind.EXCERPT},
    "converter-gaps": _UART,
    "master-too-fast": _UART,
    "unit-too-fast": _UART,
    "gap-in-frame": _UART,
    "gap-too-short": _UART,
    "turnaround-short": _UART,
    "timing-blind": _UART,
    "parity-error": _UART,
    "bus-saturated": _UART,
}


def tap_kind(line: LineSettings) -> TapKind:
    """What a line was tapped by, as far as its settings say."""
    if EXCERPT_NOTE in line.notes:
        return TapKind.EXCERPT
    if line.tap in _NAMED:
        return _NAMED[line.tap]
    return TapKind.SERIAL if line.baud is not None or line.tap is not None else TapKind.BYTES


def may_speak_of(code: str, line: LineSettings) -> bool:
    """Whether a finding or a cause may be told of what was tapped so."""
    return tap_kind(line) in _SPEAK_OF.get(code, TapKind)
