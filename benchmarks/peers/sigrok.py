"""sigrok-cli's UART and Modbus decoders, which start from the line's level.

python -m peers.sigrok CORPUS          samples that line from the frames: `line.bin`
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from measuring import Command, Job, python

from . import frames

_BAUD, _PER_BIT, _GAP_BITS = 115_200, 4, 100


def absent() -> str | None:
    return None if shutil.which("sigrok-cli") else "sigrok-cli is not installed"


def version() -> str:
    said = subprocess.run(["sigrok-cli", "--version"], capture_output=True, text=True, check=True).stdout
    return said.splitlines()[0]


def _command(corpus: Path, _: Path) -> Command:
    return (
        "sigrok-cli", "-i", corpus / "line.bin", "-I", f"binary:numchannels=1:samplerate={_BAUD * _PER_BIT}",
        "-P", f"uart:rx=0:tx=0:baudrate={_BAUD}:parity=even,modbus", "-A", "modbus",
    )  # fmt: skip


JOBS = [Job("columns", "sigrok-cli", _command, 1_000, lambda corpus: python("peers.sigrok", corpus))]
ACCURACY: list[Any] = []


def _samples(frame: bytes) -> bytes:
    """The line's level, 1 while it is idle: start bit, 8 data bits least significant first, even parity, stop bit."""
    bits = bytearray(b"\1" * _GAP_BITS)
    for byte in frame:
        data = bytes(byte >> i & 1 for i in range(8))
        bits += b"\0" + data + bytes((sum(data) & 1,)) + b"\1"
    return b"".join(bytes((bit,)) * _PER_BIT for bit in bits)


def main(corpus: Path) -> int:
    with (corpus / "line.bin").open("wb") as file:
        for some in frames(corpus):
            file.writelines(_samples(frame) for frame, _ in some)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
