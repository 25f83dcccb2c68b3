"""pymodbus's RTU framer and decoders, told the direction of each frame; then as a sniffer would have to use them.

python -m peers.pymodbus CORPUS            decodes all frames
python -m peers.pymodbus CORPUS stream     accuracy on the bytes of the first 20,000 frames in reads of 16 ms
"""

from __future__ import annotations

import json
import struct
import sys
from pathlib import Path

from measuring import Job, python

from . import Accuracy, frames, missing
from . import version as installed

_LOOK = 20_000
_READ_NS = 16_000_000  # what a USB adapter with its usual latency timer waits for


def absent() -> str | None:
    return missing("pymodbus")


def version() -> str:
    return installed("pymodbus")


JOBS = [Job("columns", "pymodbus", lambda corpus, _: python("peers.pymodbus", corpus))]
ACCURACY = [
    Accuracy(
        "pymodbus",
        lambda corpus, _: python("peers.pymodbus", corpus, "stream"),
        f"the first {_LOOK:,} frames in reads of 16 ms, each put to a framer for requests and to one for responses; "
        "a frame counts where the framer of its direction decodes it whole",
    )
]


def main(corpus: Path, stream: str = "") -> int:
    from pymodbus.exceptions import ModbusException
    from pymodbus.framer import FramerRTU
    from pymodbus.pdu import DecodePDU

    framers = FramerRTU(DecodePDU(True)), FramerRTU(DecodePDU(False))
    if not stream:
        for some in frames(corpus):
            for frame, response in some:
                framers[response].handleFrame(frame, 0, 0)
        return 0
    import numpy as np

    told = next(frames(corpus))[:_LOOK]
    reads: dict[int, list[tuple[bytes, bool]]] = {}
    for both, t_ns in zip(told, np.load(corpus / "truth.npz")["t_ns"].tolist(), strict=False):
        reads.setdefault(t_ns // _READ_NS, []).append(both)
    found = 0
    for side, framer in enumerate(framers):
        held = b""
        for read in reads.values():
            held += b"".join(frame for frame, _ in read)
            wanted = {frame[1:-2] for frame, response in read if response == side}
            while held:
                try:
                    used, pdu = framer.handleFrame(held, 0, 0)
                    found += pdu is not None and bytes((pdu.function_code,)) + pdu.encode() in wanted
                except (ModbusException, ValueError, IndexError, TypeError, struct.error):
                    used = len(held)
                if not used:
                    break
                held = held[used:]
    print(json.dumps({"frames": found / len(told)}))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), *sys.argv[2:]))
