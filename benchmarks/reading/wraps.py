"""Lines that a terminal, a mail or a window has broken: the wrapped and the unwrapped reading are compared in bits.

A break is where a run of bytes ends a line and the next line begins with bytes. Lines are put together, with a blank or
with nothing between, where frames with right check values then cross the seams that no reading line by line explains.
How wide the lines are that were put together is learnt: others as wide, whose frames are damaged, follow them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Final

from .lattice import ByteSpan, SpannedLine, choose

_BEGINS: Final = re.compile(r"[\s>*#/|]{0,12}(?:,\s?)?(?:0?[xX]|16#|[$%\\&'\"\[<({,-]|#)?[0-9A-Fa-f]")
_ENDS: Final = re.compile(r"[0-9A-Fa-f][\s,\\hH'\"\])}>;:|.-]{0,4}$|[xX#$%0\\\[<&]$|[,-]\s?$")
_MARGIN: Final = re.compile(r"^[\s>*#/|]{0,12}")
_MOST_LINES: Final = 48
_MOST: Final = 2048  # characters
_PATIENCE: Final = 40  # breaks in vain
_LONG_CHAIN: Final = 8  # lines
_NARROW: Final = 24  # columns: no window is narrower

Remake = Callable[[int, str], SpannedLine]


def unwrapped(lines: Sequence[SpannedLine], remake: Remake) -> list[SpannedLine]:
    """The lines, those put together that were one."""
    out: list[SpannedLine] = []
    i = waited = 0
    widths: dict[str, int] = {}
    while i < len(lines):
        if waited < _PATIENCE and (chain := _chain(lines, i)) > 1:
            merged = _merged(lines[i : i + chain], remake, widths)
            if merged is not None:
                line, count = merged
                out.append(line)
                i, waited = i + count, 0
                continue
            waited += 1
            if chain >= _LONG_CHAIN:  # from the next line on it would be the same
                out += lines[i : i + chain - 1]
                i += chain - 1
                continue
        out.append(lines[i])
        i += 1
    return out


def _chain(lines: Sequence[SpannedLine], first: int) -> int:
    """How many lines from one on may be one: each begins with bytes where that above ends with them."""
    if _is_settled(lines[first]) or len(lines[first].text) < _NARROW:
        return 1
    count, size = 1, len(lines[first].text)
    while first + count < len(lines) and count < _MOST_LINES and size < _MOST:
        above, line = lines[first + count - 1], lines[first + count]
        if not (_ENDS.search(above.text) and _BEGINS.match(line.text)) or line.t_ns is not None:
            break
        if len(line.text) > len(lines[first].text) + 8:
            break
        count, size = count + 1, size + len(line.text)
    return count


def _is_settled(line: SpannedLine) -> bool:
    """Whether a line ends with bytes that need nothing more."""
    chosen = choose(line.spans)
    return bool(chosen) and chosen[-1].whole and not line.clean[chosen[-1].of.end :].strip(" ,;\\|`'\"])}>")


def _merged(lines: Sequence[SpannedLine], remake: Remake, widths: dict[str, int]) -> tuple[SpannedLine, int] | None:
    """The lines as one, and how many of them, if that reads more than each alone."""
    alone = sum(span.bits for line in lines for span in choose(line.spans) if span.checked)
    for sep in ("", " "):
        parts = [lines[0].text.rstrip() if sep else lines[0].text]
        seams = [len(parts[0])]
        for line in lines[1:]:
            part = _MARGIN.sub("", line.text) if sep else line.text
            parts.append(part.rstrip() if sep else part)
            seams.append(seams[-1] + len(sep) + len(parts[-1]))
        line = remake(lines[0].number, sep.join(parts))
        crossing = [span for span in choose(line.spans) if span.of.start < seams[0] < span.of.end]
        if not crossing:
            continue
        span = crossing[0]
        count = next(k for k, seam in enumerate(seams, 1) if span.of.end <= seam)
        known = widths.get(sep)
        fits = known is not None and (len(lines[0].text) == known if not sep else len(lines[0].text) + 12 > known)
        if (
            not (_crosses(span, seams) and sum(one.bits for one in choose(line.spans) if one.checked) > alone)
            and not fits
        ):
            continue
        widths[sep] = len(lines[0].text) if not sep else max(len(lines[0].text), known or 0)
        if count < len(lines):
            line = remake(lines[0].number, sep.join(parts[:count]))
        return line, count
    return None


def _crosses(span: ByteSpan, seams: Sequence[int]) -> bool:
    """Whether a frame with a right check value goes over the first seam."""
    if not span.whole or not span.of.edges:
        return span.whole
    at = sum(size for edge, size in zip(span.of.edges, span.of.sizes, strict=True) if edge < seams[0])
    inside = span.line.clean[seams[0] - 1 : seams[0] + 1].isalnum()
    return any(one.start < at < one.end for one in span.checked) or inside
