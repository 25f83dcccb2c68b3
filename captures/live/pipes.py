"""The reader process's standard input and output: commands as they come, records that never wait for the listener."""

from __future__ import annotations

import json
import os
from typing import Any, Final

_BACKLOG: Final = 64 << 20  # bytes kept for a listener that does not take them


class Commands:
    """Lines of standard input, as they come."""

    def __init__(self) -> None:
        self._rest = b""

    def take(self) -> list[dict[str, Any]] | None:
        """The commands that came; None at the end."""
        data = os.read(0, 1 << 16)
        if not data:
            return None
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [json.loads(line) for line in lines if line]


class Pipe:
    """Standard output; what it does not take at once is kept, up to a limit."""

    def __init__(self, *, blocking: bool) -> None:
        self._kept = bytearray()
        if not blocking:
            os.set_blocking(1, False)

    @property
    def waiting(self) -> bool:
        return bool(self._kept)

    def send(self, data: bytes) -> None:
        """Write, or keep; a listener that is stuck for good ends this process, which must not eat all memory."""
        self._kept += data
        if len(self._kept) > _BACKLOG:
            raise SystemExit("the listener takes nothing")
        self.push()

    def push(self) -> None:
        """Write what is kept, as far as it goes."""
        while self._kept:
            try:
                written = os.write(1, self._kept)
            except BlockingIOError:
                return
            except OSError:  # the listener is gone
                raise SystemExit(0) from None
            del self._kept[:written]

    def drain(self) -> None:
        """Write all of it, waiting for the listener."""
        if self._kept:
            os.set_blocking(1, True)
            self.push()
