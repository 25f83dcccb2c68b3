"""What a terminal driver puts into the bytes where PARMRK is set, taken out again.

A byte that came with a parity or framing error is read as FF 00 and the byte, a break as FF 00 00, and a true FF as
FF FF (termios(3)). A mark may be cut anywhere by the end of a read.
"""

from __future__ import annotations

_FF = 0xFF


class Unmarked:
    """The bytes of one port as they were on the wire; keeps what a read has cut."""

    def __init__(self) -> None:
        self._held = b""  # FF, or FF 00, that the next read completes

    def feed(self, data: bytes) -> tuple[bytes, list[int]]:
        """The bytes that a read brought, and which of them (offsets) came with an error."""
        if not self._held and _FF not in data:
            return data, []
        data, self._held = self._held + data, b""
        out = bytearray()
        errors: list[int] = []
        at = 0
        while (mark := data.find(_FF, at)) >= 0:
            out += data[at:mark]
            code = data[mark + 1 : mark + 2]
            if code == b"\0":
                if mark + 2 >= len(data):
                    self._held = data[mark:]
                    return bytes(out), errors
                errors.append(len(out))
                out.append(data[mark + 2])
                at = mark + 3
            elif code:  # FF FF; any other is no mark that a driver makes: kept as it is
                out.append(_FF)
                at = mark + (2 if code == b"\xff" else 1)
            else:
                self._held = data[mark:]
                return bytes(out), errors
        out += data[at:]
        return bytes(out), errors
