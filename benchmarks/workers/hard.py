"""What bytes made to be hard cost, against a clean bus: microseconds of CPU a byte, as JSON by name.

python -m workers.hard BYTES
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterable

import numpy as np
from bus import CHAR_NS, LINE, slices

from analyzer import Analysis
from captures import Block, Capture, Chunk
from dissectors.crc import crc_bytes

_READ = 4096  # bytes
_SOME = np.random.default_rng(1)


def _some(count: int) -> bytes:
    return _SOME.integers(0, 256, count).astype(np.uint8).tobytes()


def _adu(body: bytes) -> bytes:
    return body + crc_bytes(body)


def _write() -> bytes:
    return _adu(b"\x11\x06\0" + _some(3))


_WRITE = _adu(b"\x11\x06\0\x01\0\x02")
PATTERNS = {
    "zeros": b"\0",
    "01 03 repeated": b"\x01\x03",
    "03 03 FF repeated": b"\x03\x03\xff",
    "frames nested in a frame": b"\x01\x03\xf8" + _WRITE * 31,
    "one frame repeated": _WRITE,
    "random bytes": _some(1 << 16),
    "writes that nobody answers": b"".join(_write() for _ in range(1 << 13)),
    "functions that nobody declared": b"".join(_adu(b"\x05\x41" + _some(i % 29)) for i in range(1 << 12)),
    "frames and noise in turns": b"".join(
        _adu(b"\x11\x03\0\x01\0\x0a") + _adu(b"\x11\x03\x14" + _some(20)) + _some(1 + i % 63) for i in range(1 << 10)
    ),
    "other frames nested in a frame": b"".join(
        _adu(b"\x01\x03\xf8" + b"".join(_write() for _ in range(31))) for _ in range(1 << 8)
    ),
}


def clean(size: int) -> Capture:
    """The first `size` bytes of the seeded bus, about."""
    made = next(slices(size // 18))
    none = np.zeros(len(made.sizes), np.uint8)
    offsets = np.concatenate(([0], np.cumsum(made.sizes)))
    block = Block(made.data, offsets, made.t_ns, none, none, np.zeros(0, np.int64))
    return Capture.of(LINE, (block.chunk(i) for i in range(len(block))))


def hard(pattern: bytes, size: int) -> Capture:
    """A pattern without any pause, in reads as they come off a busy line."""
    data = (pattern * (size // len(pattern) + 1))[:size]
    reads = (data[at : at + _READ] for at in range(0, size, _READ))
    return Capture.of(LINE, (Chunk(int((i + 1) * _READ * CHAR_NS), read) for i, read in enumerate(reads)))


def cost(captures: Iterable[Capture]) -> float:
    """The least time a byte, µs."""
    figures = []
    for capture in captures:
        begin = time.process_time()
        size = sum(int(batch.rows.length.sum()) for batch in Analysis(capture).batches())
        figures.append((time.process_time() - begin) / size * 1e6)
    return min(figures)


def main(size: int) -> int:
    cost([clean(size // 4)])  # what is made once is made now
    figures = {"clean bus": cost(clean(size) for _ in range(3))}
    figures |= {name: cost(hard(pattern, size) for _ in range(2)) for name, pattern in PATTERNS.items()}
    print(json.dumps(figures))
    return 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
