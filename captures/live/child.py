"""A process of its own beside this one, which tells what comes as records on a pipe: `reader`, `relay`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import IO, Any, Final, Self

from .tap import PortError
from .wire import Decoder, Item, PortEvent

_START: Final = (
    "import json, sys; sys.path[:0] = json.loads(sys.argv[1]); "
    "from captures.live.{module} import main; main(sys.argv[2])"
)
_PIECE: Final = 1 << 16
_PATIENCE_S: Final = 2.0


class RecordsOfChild:
    """The process, running. A context manager; `items` gives what comes."""

    def __init__(self, module: str, options: Mapping[str, Any]) -> None:
        """Start `main` of a module of this package; `options` reach it as JSON."""
        flags: dict[str, Any] = (
            {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
            if os.name == "nt"
            else {"start_new_session": True}  # Ctrl-C is for this process, which then ends the other
        )
        paths = [path for path in sys.path if path]
        self._process = subprocess.Popen(
            [sys.executable, "-c", _START.format(module=module), json.dumps(paths), json.dumps(options)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            bufsize=0,
            **flags,
        )
        self._complaint = b""
        self._errors = threading.Thread(target=self._keep_complaint, daemon=True)
        self._errors.start()
        self._closing = False
        self.more = False  # behind the newest item another one is at hand: it is told without a wait

    def items(self) -> Iterator[Item]:
        """What comes, until `close`; waits for it. PortError where a port can't be opened, or the process fails."""
        decoder, out = Decoder(), self._stream(self._process.stdout)
        while True:
            try:
                data = out.read(_PIECE)
            except (OSError, ValueError):  # closed by another thread
                data = b""
            if not data:
                break
            items = decoder.feed(data)
            for number, item in enumerate(items, 1):
                if isinstance(item, PortEvent):
                    if item.kind == "failed":
                        raise PortError(item.text)
                    if item.kind == "ended":
                        return
                self.more = number < len(items)
                yield item
        if not self._closing:
            self._errors.join(_PATIENCE_S)
            words = self._complaint.decode(errors="replace").strip().splitlines()
            raise PortError(f"the process that reads the port ended: {words[-1] if words else 'no reason given'}")

    def command(self, **words: Any) -> None:
        """Have it do something, a JSON object a line; nothing happens where it is gone."""
        with suppress(OSError, ValueError):
            self._stream(self._process.stdin).write(json.dumps(words).encode() + b"\n")

    def close(self) -> None:
        """Ask it to end; `items` ends when all that it had has been given."""
        self._closing = True
        with suppress(OSError, ValueError):
            self._stream(self._process.stdin).close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.join(_PATIENCE_S)
        for stream in (self._process.stdout, self._process.stderr):
            self._stream(stream).close()

    def _keep_complaint(self) -> None:
        with suppress(OSError, ValueError):
            while data := self._stream(self._process.stderr).read(4096):
                self._complaint = (self._complaint + data)[-4096:]

    @staticmethod
    def _stream(stream: IO[bytes] | None) -> IO[bytes]:
        assert stream is not None  # all three are pipes
        return stream
