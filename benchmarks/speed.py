"""CPU time and memory of deframing, pairing and columns, by size and on data made to be hard.

    python benchmarks/speed.py [FRAMES ...]        default: 100000 1000000

A seeded bus of common functions at 115200 bit/s, a chunk a frame. Prints a line a size: CPU seconds, seconds a million
frames, peak memory of the process; then what adversarial bytes cost.
"""

from __future__ import annotations

import random
import resource
import sys
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analyzer.deframing.stream import Deframer
from analyzer.frames import Kind
from analyzer.transactions import Transactions
from captures.chunks import Block, Chunk
from captures.line import LineSettings
from dissectors.checks import crc_bytes

LINE = LineSettings(baud=115200, char_bits=11)
CHAR_NS = 11e9 / 115200
ADVERSARIAL = {
    "zeros": b"\0",
    "01 03": b"\x01\x03",
    "03 03 ff": b"\x03\x03\xff",
    "nested frames": b"\x01\x03\xf8" + (b"\x11\x06\0\x01\0\x02" + crc_bytes(b"\x11\x06\0\x01\0\x02")) * 31,
}


def transaction(rng: random.Random) -> tuple[bytes, bytes]:
    """A request and its answer; 19 bytes a frame on average."""
    unit, function = rng.choice((1, 2, 5, 17, 33)), rng.choice((1, 2, 3, 3, 3, 3, 4, 4, 4, 6, 5, 16, 15))
    head = bytes((unit, function)) + rng.randrange(0x400).to_bytes(2, "big")
    if function in (5, 6):
        echo = head + (rng.choice((b"\xff\0", b"\0\0")) if function == 5 else rng.randbytes(2))
        return _whole(echo), _whole(echo)
    quantity = rng.randrange(1, 60 if function in (1, 2, 15) else 24)
    count = (quantity + 7) // 8 if function in (1, 2, 15) else 2 * quantity
    head += quantity.to_bytes(2, "big")
    if function in (15, 16):
        return _whole(head + bytes((count,)) + rng.randbytes(count)), _whole(head)
    return _whole(head), _whole(bytes((unit, function, count)) + rng.randbytes(count))


def _whole(body: bytes) -> bytes:
    return body + crc_bytes(body)


def bus(frames: int, seed: int = 1) -> Iterator[Block]:
    """Blocks of 50,000 chunks, one a frame."""
    rng = random.Random(seed)
    kinds = [transaction(rng) for _ in range(4000)]
    now = 0
    for begin in range(0, frames, 50_000):
        pairs = [rng.choice(kinds) for _ in range(min(50_000, frames - begin) // 2)]
        pieces = [frame for pair in pairs for frame in pair]
        sizes = np.array([len(piece) for piece in pieces])
        gaps = np.tile((4_000_000, 2_000_000), len(pairs))
        times = now + np.cumsum(sizes * CHAR_NS + gaps).astype(np.int64)
        now = int(times[-1])
        yield _block(b"".join(pieces), sizes, times)


def _block(data: bytes, sizes: NDArray[np.int64], times: NDArray[np.int64]) -> Block:
    offsets = np.concatenate(([0], np.cumsum(sizes))).astype(np.int64)
    none = np.zeros(len(sizes), np.uint8)
    return Block(np.frombuffer(data, np.uint8), offsets, times, none, none, np.empty(0, np.int64))


def measure(frames: int) -> None:
    deframer, transactions = Deframer(LINE), Transactions()
    spent, size, found, paired = 0.0, 0, 0, 0
    blocks = bus(frames)
    while True:
        block = next(blocks, None)
        begin = time.process_time()
        batch = deframer.feed(block) if block is not None else deframer.close()
        settled = transactions.feed(batch)
        spent += time.process_time() - begin
        found += int((batch.rows["kind"] != Kind.NOISE).sum())
        paired += int((settled["response"] >= 0).sum())
        if block is None:
            break
        size += len(block.data)
    paired += int((transactions.close()["response"] >= 0).sum())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    rate = f"{spent / frames * 1e6:5.2f} s a million, {size / spent / 1e6:6.1f} MB/s"
    print(f"{frames:>10,} frames, {size / frames:.1f} B each: {spent:7.2f} s CPU, {rate}, peak {peak:.0f} MiB")
    print(f"{'':>10} {found:,} found, {paired:,} paired")


def main(arguments: list[str]) -> int:
    for frames in map(int, arguments or ("100000", "1000000")):
        measure(frames)
    for name, pattern in ADVERSARIAL.items():
        piece = (pattern * (65536 // len(pattern) + 1))[:65536]
        deframer = Deframer(LINE)
        begin = time.process_time()
        for i in range(4):
            deframer.feed(Chunk(i * 8_000_000_000, piece))
        deframer.close()
        spent = time.process_time() - begin
        print(f"{name:>16}: {spent / (4 * 65536) * 1e6:6.2f} us a byte")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
