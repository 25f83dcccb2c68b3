"""Lines: gateways that restart and adapters that are unplugged, at random moments while the line is busy.

The recorder must go on by itself each time, with all but the newest of what was said before, in order, and end well
when it is told to.
"""

from __future__ import annotations

import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Final, Protocol

import captures
from attack.target import Outcome

_START: Final = "import sys; from analyzer.cli import main; sys.exit(main())"
_RESTARTS: Final = 3
_PERIOD_S: Final = 0.005
_BACK_S: Final = 15.0  # until a recorder that lost its line must be there again
_LOST: Final = 0.5  # seconds of a line before it went that may be lost with it


class Line(Protocol):
    """What the recorder listens to. OSError from `say` where nobody hears any more."""

    port: str

    def begin(self) -> None: ...

    def say(self, data: bytes) -> None: ...

    def end(self) -> None: ...

    def close(self) -> None: ...


class _Gateway:
    """A TCP server with one client; it ends with or without a word."""

    def __init__(self, folder: Path, chance: Random) -> None:  # noqa: ARG002 - as every line is made
        self._chance = chance
        self._server = self._listening(0)
        self._number = self._server.getsockname()[1]
        self.port = f"socket://127.0.0.1:{self._number}"

    @staticmethod
    def _listening(number: int) -> socket.socket:
        server = socket.create_server(("127.0.0.1", number))
        server.settimeout(_BACK_S)
        return server

    def begin(self) -> None:
        if self._server.fileno() < 0:
            self._server = self._listening(self._number)
        self._client, _ = self._server.accept()

    def say(self, data: bytes) -> None:
        self._client.sendall(data)

    def end(self) -> None:
        if self._chance.random() < 0.5:
            self._client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # a reset
        if self._chance.random() < 0.5:
            self._server.close()
        self._client.close()

    def close(self) -> None:
        self._server.close()


class _Adapter:
    """A pseudo-terminal under a name that comes and goes."""

    def __init__(self, folder: Path, chance: Random) -> None:  # noqa: ARG002 - as every line is made
        self._link = folder / "ttyUSB0"
        self.port = str(self._link)
        self._plug()

    def _plug(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self._link.symlink_to(os.ttyname(self._slave))

    def begin(self) -> None:
        if not self._link.is_symlink():
            self._plug()

    def say(self, data: bytes) -> None:
        os.write(self._master, data)

    def end(self) -> None:
        self._link.unlink()
        os.close(self._master)
        os.close(self._slave)

    def close(self) -> None:
        self.end()


_KINDS: Final[dict[str, Callable[[Path, Random], Line]]] = {"gateway": _Gateway, "adapter": _Adapter}


def attack(seed: int, times: int) -> Outcome:
    """So many recordings of each kind of line, with three losses of it each."""
    outcome, heard, said = Outcome("lines"), 0, 0
    for number in range(times):
        for name, kind in _KINDS.items():
            chance = Random(f"{seed} {name} {number}")
            with tempfile.TemporaryDirectory() as folder:
                try:
                    wrong, kept, sent = _one(Path(folder), kind(Path(folder), chance), chance)
                except (OSError, TimeoutError, AssertionError) as error:
                    wrong, kept, sent = f"{type(error).__name__}: {error}", 0, 0
            heard, said = heard + kept, said + sent
            outcome.tried += 1
            if wrong:
                outcome.failures.append(f"{name} {number} of seed {seed}: {wrong}")
    outcome.figures = f"seed {seed}, {_RESTARTS} losses of the line each; {heard:,} of {said:,} words recorded"
    return outcome


def _one(folder: Path, line: Line, chance: Random) -> tuple[str, int, int]:
    """What did not hold; words recorded, and said."""
    path = folder / "bus.mcap"
    command = [sys.executable, "-c", _START, "record", line.port, "--baud", "115200", "-o", str(path), "--wait"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, cwd=Path(captures.__file__).parents[1])
    assert process.stderr is not None
    os.set_blocking(process.stderr.fileno(), False)
    said: list[tuple[int, float]] = []  # of each word when, and before which loss
    try:
        for period in range(_RESTARTS + 1):
            line.begin()
            _talk(line, process, path, period, chance.uniform(0.3, 1.5), said)
            if period < _RESTARTS:
                line.end()
                time.sleep(chance.uniform(0.0, 0.6))
        time.sleep(0.2)
        process.send_signal(signal.SIGTERM)
        process.wait(20)
    finally:
        process.kill()
        text = (process.stderr.read() or b"").decode(errors="replace")
        process.stderr.close()
        line.close()
    return _judged(path, process.returncode, text, said), len(_words(path)), len(said)


def _talk(
    line: Line, process: subprocess.Popen[bytes], path: Path, period: int, seconds: float, said: list[tuple[int, float]]
) -> None:
    """Words, once the recorder is there, for so many seconds more."""
    until, heard = time.monotonic() + _BACK_S, 0.0
    while time.monotonic() < (until if not heard else heard + seconds):
        if process.poll() is not None:
            raise AssertionError(f"it ended by itself with status {process.returncode}")
        line.say(b"%08d\n" % len(said))
        said.append((period, time.monotonic()))
        time.sleep(_PERIOD_S)
        if not heard and len(said) % 20 == 0 and any(said[word][0] == period for word in _words(path)):
            heard = time.monotonic()
    if not heard:
        raise AssertionError(f"nothing was recorded within {_BACK_S:.0f} s of loss {period}")


def _words(path: Path) -> list[int]:
    """The whole words in the recording, as far as it is."""
    data = b""
    for each in (path, path.with_name(path.name + ".part")):
        if each.exists():
            try:
                data += b"".join(block.data.tobytes() for block in captures.open(each).blocks())
            except captures.CaptureError:
                continue
    return [int(word) for word in data.split(b"\n") if len(word) == 8 and word.isdigit()]


def _judged(path: Path, status: int, text: str, said: list[tuple[int, float]]) -> str:
    words = _words(path)
    if status:
        return f"it ended with status {status}: {text[-300:]}"
    if words != sorted(set(words)):
        return "words are out of order, or there twice"
    for period in range(_RESTARTS + 1):
        mine = [word for word, (loss, _) in enumerate(said) if loss == period]
        kept = [word for word in words if said[word][0] == period]
        missing = set(range(kept[0], mine[-1] + 1)) - set(kept) if kept else set(mine)
        old = [word for word in missing if said[word][1] < said[mine[-1]][1] - _LOST]
        if old:
            return f"{len(old)} words between losses {period} and {period + 1} are not there, from {min(old)} on"
    return ""
