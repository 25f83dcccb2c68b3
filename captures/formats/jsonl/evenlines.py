"""Lines `{"t_ns": 1234567890, "hex": "1103006b"}`, all of one layout, taken as arrays without parsing any as JSON.

Such a line has six double quotes and no more, so that their places tell where the number and the digits are; all that
stands between is compared. What does not fit in any way (other keys, an escape, an odd digit, a line cut short, a time
that is not a plain number) is for a real parser: then nothing is given, and never anything that JSON would not say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ...ragged import Bytes, Ints, copy_pieces, sums, windows

_QUOTES: Final = 6  # in a line
_TIME_DIGITS: Final = 18  # of a time that needs no look at its range
_POWERS: Final = 10 ** np.arange(_TIME_DIGITS - 1, -1, -1, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class _Layout:
    """What stands before the time, between time and digits, and after them."""

    before: bytes
    between: bytes
    after: bytes = b'"}\n'


_LAYOUTS: Final = (_Layout(b'{"t_ns": ', b', "hex": "'), _Layout(b'{"t_ns":', b',"hex":"'))


def reads_in(text: bytes) -> tuple[Ints, Ints, bytes] | None:
    """Times, sizes and bytes of the reads in whole lines; None where any line is not of the one layout.

    At least one byte a read; times are 0 to 10^18 - 1.
    """
    layout = next((layout for layout in _LAYOUTS if text.startswith(layout.before)), None)
    if layout is None or not text.endswith(layout.after):
        return None
    data = np.frombuffer(text, np.uint8)
    quotes = np.flatnonzero(data == ord('"'))
    if len(quotes) % _QUOTES:
        return None
    first, last = quotes[4::_QUOTES] + 1, quotes[5::_QUOTES]  # the digits
    ends = last + len(layout.after)
    starts = np.concatenate(([0], ends[:-1]))
    times, between = starts + len(layout.before), first - len(layout.between)
    widths, lengths = between - times, last - first
    if ends[-1] != len(data) or widths.min() < 1 or widths.max() > _TIME_DIGITS or lengths.min() < 2:
        return None
    if (lengths & 1).any():
        return None
    for at, words in ((starts, layout.before), (between, layout.between), (last, layout.after)):
        if not _all_are(data, at, words):
            return None
    t_ns, content = _numbers(data, times, widths), _octets(data, first, lengths)
    return None if t_ns is None or content is None else (t_ns, lengths >> 1, content)


def _all_are(data: Bytes, at: Ints, words: bytes) -> bool:
    heads = windows(data, len(words))[at]
    return bool((heads == np.frombuffer(words, f"V{len(words)}")).all())


def _numbers(data: Bytes, at: Ints, widths: Ints) -> Ints | None:
    """Plain numbers as JSON writes them: digits, the first not 0 unless it is alone."""
    numbers = np.zeros(len(at), np.int64)
    for width in np.flatnonzero(np.bincount(widths)).tolist():
        which = np.flatnonzero(widths == width)
        digits = windows(data, width)[at[which]].view(np.uint8).reshape(-1, width) - np.uint8(ord("0"))
        if digits.max() > 9 or (width > 1 and not digits[:, 0].all()):
            return None
        numbers[which] = digits @ _POWERS[-width:]
    return numbers


def _octets(data: Bytes, at: Ints, lengths: Ints) -> bytes | None:
    """The bytes that hex digits stand for, end to end; None where there is anything but digits."""
    begins = sums(lengths)
    digits = np.empty(int(begins[-1]), np.uint8)
    copy_pieces(digits, begins[:-1], data, at, lengths)
    try:
        octets = bytes.fromhex(digits.tobytes().decode("ascii"))
    except ValueError:
        return None
    return octets if 2 * len(octets) == len(digits) else None  # spaces would be skipped
