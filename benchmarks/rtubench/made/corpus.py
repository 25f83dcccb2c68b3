"""The whole corpus of a seed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import NamedTuple

from ..items import Item, Row, split_frames
from ..line import wire_of
from ..taps import TAPS, Read
from . import buses, faults, pastes, plants, recorded


class Size(NamedTuple):
    """How much of everything."""

    transactions: int  # of a bus
    taps: int  # through which each line is heard, in turn
    fault_transactions: int
    faults: int  # lines of each fault
    turns: int  # polls of a device
    devices: int
    texts: int  # of each style
    speed: tuple[int, int, int]  # frames of the speed track: few, which cost the start, more, many


SIZES = {
    "tiny": Size(20, 1, 150, 1, 60, 1, 1, (1_000, 1_500, 2_000)),
    "small": Size(60, 5, 250, 3, 120, 8, 3, (1_000, 3_000, 50_000)),
    "normal": Size(250, 5, 400, 9, 120, 40, 12, (1_000, 3_000, 400_000)),
}


def items(seed: int, size: Size) -> Iterator[Item]:
    """All items of the tracks that are scored."""
    yield from _heard_by(size.taps, buses.items(seed, size.transactions))
    yield from _heard_by(size.taps, recorded.buses(seed))
    yield from faults.items(seed, size.fault_transactions, size.faults)
    yield from recorded.faults(seed)
    yield from plants.items(seed, size.turns, size.devices)
    yield from recorded.values(seed)
    yield from pastes.items(seed, size.texts)
    yield from recorded.texts()


def _heard_by(taps: int, items: Iterable[Item]) -> Iterator[Item]:
    """Of the items of each line, which come one after another, so many: the first line's first ones, and so on."""
    for at, item in enumerate(items):
        line, tap = divmod(at, len(TAPS))
        if (tap - line) % len(TAPS) < taps:
            yield item


def real(folder: Path) -> Iterator[Item]:
    """Captures of real lines: NAME.jsonl (a header, then reads of t_ns and hex), NAME.truth.jsonl (rows of frames)."""
    for truth_path in sorted(folder.glob("*.truth.jsonl")):
        head, *rows = map(json.loads, truth_path.with_name(f"{truth_path.name[:-12]}.jsonl").read_text().splitlines())
        baud, char_bits = head.get("baud", 9600), head.get("char_bits", 11)
        frames = [_as_truth(json.loads(line)) for line in truth_path.read_text().splitlines()]
        reads = [Read(row["t_ns"], bytes.fromhex(row["hex"])) for row in rows]
        given = _all_inputs(reads, frames, char_bits * 1e9 / baud)
        yield Item(f"real-{truth_path.name[:-12]}", "bus", "real", ("frames", "directions", "pairs"),
                   {"frames": frames}, baud, char_bits, "real", given)  # fmt: skip


def _as_truth(row: Row) -> Row:
    told = {"role": row["dir"]} if "dir" in row else {}
    return {**row, **told, "fault": row.get("fault")}


def _all_inputs(reads: list[Read], frames: list[Row], char_ns: float) -> dict[str, list[Read]]:
    """The bytes of a read lie end to end, up to its time; frames are split where the truth has their ends."""
    wire = [Read(round((one.t_ns or 0) - (len(one.data) - 1 - at) * char_ns), one.data[at : at + 1])
            for one in reads for at in range(len(one.data))]  # fmt: skip
    ends = {place for row in frames for place in (row["start"], row["start"] + row["length"])}
    split = [Read(wire[last - 1].t_ns, b"".join(one.data for one in wire[first:last]))
             for first, last in pairwise(sorted({0, len(wire), *ends}))]  # fmt: skip
    return {"reads": reads, "wire": wire, "frames": split}


def speed_item(seed: int, frames: int) -> Item:
    """A calm bus of so many frames through a UART's FIFO."""
    line, client = buses.calm(Random(f"{seed} speed"))
    sent = line.run([client], frames // 2 + frames // 20)[:frames]
    wire = list(wire_of(sent, line.char_ns))
    given = {"reads": list(TAPS["fifo"](wire, Random(seed), line.char_ns)),
             "wire": list(TAPS["bytes"](wire, Random(seed), line.char_ns))}  # fmt: skip
    return Item(f"speed-{frames}", "bus", "made", ("speed",), {"frames": []}, line.baud, line.char_bits, "fifo",
                {**given, "frames": split_frames(sent, wire)})  # fmt: skip
