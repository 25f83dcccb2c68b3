"""The seeded bus as files: for us as a tap would have recorded it, for each peer in the shape that it needs.

    python benchmarks/corpus.py FOLDER [--frames N] [--seed N] [--bus drifts|plant] [--only-mcap]

`bus.mcap` and `bus.jsonl` hold a read a frame, `fifo.mcap` the same bytes in reads of 16 as a UART's FIFO gives them;
`frames.pcap` holds frames already split, with no word of their direction (a tap has none either); `frames.marshal`
lists of (bytes of a frame, whether it is a response); `truth.npz` what is right; `about.json` what the corpus is like.
A folder that this version has completed is left as it is.
"""

from __future__ import annotations

import argparse
import json
import marshal
import struct
import sys
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bus import BUSES, CHAR_NS, LINE, Habits, Slice, slices

import captures
from captures import Block, Capture, LineSettings

FIFO = 16  # bytes a read of `fifo.mcap`
_UPPER_PDU = 252  # link type of tagged PDUs
_TAGS = struct.pack(">HH8sHH", 12, 8, b"mbrtu", 0, 0)


@dataclass(frozen=True, slots=True)
class _Bus:
    """The bus as the source of a capture; `cut` makes the reads of a slice."""

    frames: int
    seed: int
    habits: Habits
    cut: Callable[[Slice], Block]
    line: LineSettings = LINE
    timed: bool = True

    def blocks(self, max_bytes: int, note: Callable[[str, str], None]) -> Iterator[Block]:  # noqa: ARG002
        return (self.cut(made) for made in slices(self.frames, self.seed, self.habits))


def a_read_a_frame(made: Slice) -> Block:
    """Reads that return when the line falls silent."""
    return _block(made, np.concatenate(([0], np.cumsum(made.sizes))), made.t_ns)


def reads_of_a_fifo(made: Slice) -> Block:
    """Reads of 16 bytes, and of what is left at a frame's end."""
    counts = -(-made.sizes // FIFO)
    last = np.cumsum(counts) - 1
    within = np.arange(int(counts.sum())) - np.repeat(last + 1 - counts, counts)
    sizes = np.full(len(within), FIFO)
    sizes[last] = made.sizes - FIFO * (counts - 1)
    left = np.repeat(made.sizes, counts) - np.minimum(FIFO * (within + 1), np.repeat(made.sizes, counts))
    times = np.repeat(made.t_ns, counts) - (left * CHAR_NS).astype(np.int64)
    return _block(made, np.concatenate(([0], np.cumsum(sizes))), times)


def _block(made: Slice, offsets: np.ndarray[tuple[int], np.dtype[np.int64]], times: np.ndarray) -> Block:
    none = np.zeros(len(times), np.uint8)
    return Block(made.data, offsets, times, none, none, np.zeros(0, np.int64))


def _split(made: Slice) -> list[bytes]:
    data, ends = made.data.tobytes(), np.cumsum(made.sizes).tolist()
    return [data[begin:end] for begin, end in zip([0, *ends], ends, strict=False)]


def _packet(t_ns: int, frame: bytes) -> bytes:
    size = len(_TAGS) + len(frame)
    return struct.pack("<IIII", *divmod(t_ns, 1_000_000_000), size, size) + _TAGS + frame


def write(folder: Path, frames: int, seed: int, bus: str, *, only_mcap: bool) -> None:
    """All files of the corpus."""
    habits = BUSES[bus]
    done = folder / "about.json"
    here = Path(__file__)
    made_by = zlib.crc32(here.read_bytes() + here.with_name("bus.py").read_bytes())
    if done.exists() and json.loads(done.read_text()).get("made_by") == made_by:
        return
    folder.mkdir(parents=True, exist_ok=True)
    whole = Capture(_Bus(frames, seed, habits, a_read_a_frame))
    captures.write(folder / "bus.mcap", whole)
    about: dict[str, object] = {"frames": frames, "seed": seed, "bus": bus, "made_by": made_by}
    if not only_mcap:
        captures.write(folder / "bus.jsonl", whole)
        captures.write(folder / "fifo.mcap", Capture(_Bus(frames, seed, habits, reads_of_a_fifo)))
        about |= _peers(folder, frames, seed, habits)
    done.write_text(json.dumps(about))


def _peers(folder: Path, frames: int, seed: int, habits: Habits) -> dict[str, object]:
    """Frames as peers want them, the truth, and what the corpus is like."""
    seen: tuple[set[bytes], set[bytes]] = set(), set()
    made = []
    with (folder / "frames.pcap").open("wb") as pcap, (folder / "frames.marshal").open("wb") as lists:
        pcap.write(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 1 << 18, _UPPER_PDU))
        for part in slices(frames, seed, habits):
            split = _split(part)
            for frame, is_response in zip(split, part.response.tolist(), strict=True):
                seen[is_response].add(frame)
            pcap.write(b"".join(map(_packet, part.t_ns.tolist(), split)))
            marshal.dump(list(zip(split, part.response.tolist(), strict=True)), lists)
            made.append((part.sizes, part.t_ns, part.response, part.pair, np.array([f[1] & 0x7F for f in split])))
    size, t_ns, response, pair, function = map(np.concatenate, zip(*made, strict=True))
    np.savez(folder / "truth.npz", size=size, t_ns=t_ns, response=response, pair=pair)
    counts = np.bincount(function)
    return {
        "bytes_per_frame": round(float(size.mean()), 1),
        "requests_repeated": round(1 - len(seen[False]) / int((~response).sum()), 3),
        "responses_repeated": round(1 - len(seen[True]) / int(response.sum()), 3),
        "functions": {f"{code:02X}": int(counts[code]) for code in np.flatnonzero(counts).tolist()},
    }


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description="make the corpus of the benchmarks")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--frames", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--bus", choices=BUSES, default="drifts", help="what the bus is like")
    parser.add_argument("--only-mcap", action="store_true", help="no files for peers: for large sizes")
    given = parser.parse_args(arguments)
    write(given.folder, given.frames, given.seed, given.bus, only_mcap=given.only_mcap)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
