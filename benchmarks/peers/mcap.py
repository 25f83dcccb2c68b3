"""The mcap library alone: a message a frame, the frame's bytes as they are.

python -m peers.mcap CORPUS OUT
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from measuring import Job, python

from . import frames, missing
from . import version as installed


def absent() -> str | None:
    return missing("mcap")


def version() -> str:
    return installed("mcap")


JOBS = [Job("mcap", "mcap library, bytes only", lambda corpus, out: python("peers.mcap", corpus, out / "peer.mcap"))]
ACCURACY: list[Any] = []


def main(corpus: Path, out: Path) -> int:
    from mcap.writer import Writer

    with out.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/frames", "bytes", writer.register_schema("frame", "", b""))
        number = 0
        for some in frames(corpus):
            for frame, _ in some:
                writer.add_message(channel, number, frame, number, number)
                number += 1
        writer.finish()
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
