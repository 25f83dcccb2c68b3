"""What it costs to open a capture in the interface, format by format, beside its report.

    python benchmarks/opening.py [FORMAT ...] [--frames N]        default: all formats, 200,000 frames

Formats: mcap, jsonl, pcap (frames without line settings), edges (a logic analyser's; a quarter of the frames). Each is
opened on a pty and left alone until nothing is reckoned any more. Told are CPU seconds (user and system) of the
interface and of `rtuscope report`, and what the interface holds more than without a capture, a frame.
"""

from __future__ import annotations

import argparse
import struct
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

sys.path.insert(0, str(Path(__file__).parent))  # run as a module too

import numpy as np
from bus import CHAR_NS, EPOCH, slices
from corpus import write
from interface import Terminal
from measuring import RTUSCOPE, run
from numpy.typing import NDArray

_FILES: Final = {"mcap": "bus.mcap", "jsonl": "bus.jsonl", "pcap": "frames.pcap", "edges": "bus.bin"}
_FEWER: Final = {"edges": 4}  # times


def write_edges(path: Path, frames: int) -> None:
    """The bus on one wire, as Saleae's binary export of a channel has it."""
    times = np.concatenate(list(_edges(frames)))
    head = struct.pack("<8siiIddQ", b"<SALEAE>", 0, 0, 1, times[0] - 0.1, times[-1] + 0.1, len(times))
    path.write_bytes(head + times.astype("<f8").tobytes())


def _edges(frames: int) -> Iterator[NDArray[np.float64]]:
    """Seconds at which the level changes, of characters of eight bits with even parity."""
    octets, ends = np.arange(256), np.ones((256, 1), np.int64)
    bits = octets[:, None] >> np.arange(8) & 1
    levels = np.concatenate((ends, 0 * ends, bits, bits.sum(axis=1, keepdims=True) & 1, ends), axis=1)
    turns = np.diff(levels, axis=1) != 0  # before each bit of a character
    for made in slices(frames):
        inside = np.arange(len(made.data)) - np.repeat(np.cumsum(made.sizes) - made.sizes, made.sizes)
        begins = np.repeat(made.t_ns - EPOCH - made.sizes * CHAR_NS, made.sizes) + inside * CHAR_NS
        character, bit = np.nonzero(turns[made.data])
        yield (begins[character] + bit * CHAR_NS / turns.shape[1]) / 1e9


def opened(path: Path | None) -> tuple[float, int]:
    """CPU seconds until a capture is read and reckoned, and the bytes that are held then; None: without a capture."""
    terminal = Terminal([sys.executable, "-m", "analyzer.cli", "open", *([] if path is None else [str(path)])])
    terminal.wait(lambda seen: b"paste" in seen.lower(), 60)
    terminal.drain(1.0) if path is None else terminal.rest()  # a prompt's cursor blinks for ever
    found = terminal.cpu(), terminal.memory()
    terminal.close()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help=", ".join(_FILES))
    parser.add_argument("--frames", type=int, default=200_000, metavar="N")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as kept:
        folder = Path(kept)
        write(folder, arguments.frames, seed=1, bus="drifts", only_mcap=False)
        _, bare = opened(None)
        heads = f"{'report CPU s':>12} {'interface CPU s':>15} {'ratio':>6} {'bytes a frame':>14}"
        print(f"{'format':8} {'frames':>10} {heads}", flush=True)
        for name in arguments.formats or _FILES:
            path, frames = folder / _FILES[name], arguments.frames // _FEWER.get(name, 1)
            if name == "edges":
                write_edges(path, frames)
            reported = run((*RTUSCOPE, "report", path), folder).cpu
            cpu, held = opened(path)
            told = f"{name:8} {frames:10,} {reported:12.2f} {cpu:15.2f} {cpu / reported:6.2f}"
            print(f"{told} {(held - bare) / frames:14.0f}", flush=True)


if __name__ == "__main__":
    main()
