"""The rows of a dump: whether an offset goes on with those before, and what stands below its rows."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from .choosing import ByteRun
from .escapes import OD_BELOW, od_bytes

_DIGITS: Final = re.compile(r"[0-9A-Fa-f]{3,8}")


@dataclass(slots=True)
class Dump:
    """The rows of a dump so far; none where `row` is None."""

    row: ByteRun | None = None  # the newest
    length: int = 0  # bytes
    first: int = 0  # offset of the first row
    t_ns: int | None = None

    def goes_on(self, row: ByteRun, t_ns: int | None) -> bool:
        """Take a row of a line with this time; whether it goes on with the dump of the lines before."""
        if row.offset is None:
            self.row = None
            return False
        last = self.row
        if last is None or self.t_ns != t_ns or not self._is_next(row.offset, self.length):
            self.length, self.first, self.t_ns = 0, int(row.offset, 16), t_ns
        elif len(row.data) == 1:  # alone it looks like a number, and is no half of a word
            row.shape, row.level = last.shape, last.level
        goes_on = self.length > 0
        self.length += len(row.data)
        self.row = row
        return goes_on

    def ends_with(self, rest: str) -> bool:
        """Whether a line without its time is the length, with which od and hexdump end."""
        digits = rest.strip().rstrip(":")
        if self.row is None:
            return False
        if "words" in self.row.shape and self._is_next(digits, self.length - 1):
            self.row.padded = True
            return True
        return self._is_next(digits, self.length)

    def shows(self, rest: str) -> bool:
        """Whether a line without an offset is the newest row as characters, as `od -t x1c` writes it below."""
        cells = OD_BELOW.match(rest) if self.row is not None else None
        return cells is not None and self.row is not None and od_bytes(cells["row"]) == self.row.data

    def _is_next(self, digits: str, length: int) -> bool:
        """Whether these digits are where the dump goes on: in hex, or in octal or decimal as od writes it."""
        if not _DIGITS.fullmatch(digits):
            return False
        bases = [16]
        if digits.isdigit() and not self.first:
            bases += [10, 8] if set(digits) <= set("01234567") else [10]
        return any(int(digits, base) == (self.first if base == 16 else 0) + length for base in bases)
