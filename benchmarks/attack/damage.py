"""Damage: recordings cut at every byte, with bad sectors, flipped bits, stretches that a transfer lost.

Whatever a chunk of the file holds that the damage did not touch must be given, in order; what is not given must be
told, and a repaired file must hold the same and be whole.
"""

from __future__ import annotations

import io
import tempfile
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Final

from mcap.reader import make_reader

import captures
from attack.target import Outcome
from captures import Block, Chunk, LineSettings
from captures.formats.mcap.channel import ChunkChannel
from captures.formats.mcap.records import TOPIC
from captures.formats.mcap.writer import ArrayWriter
from captures.recording.mcapfile import repair
from captures.recording.notes import Note, NoteChannel

BEGUN_NS: Final = 1_800_000_000 * 10**9
STEP_NS: Final = 500_000_000
_REPAIRED: Final = 10  # every so many of them is repaired too


@dataclass(frozen=True)
class Recording:
    """A recording of a chunk each half second: the file, what each chunk holds, and where it begins and ends."""

    content: bytes
    parts: tuple[bytes, ...]
    places: tuple[tuple[int, int], ...]


def recording(seed: int, count: int = 20, *, index: bool = True) -> Recording:
    """As a recorder makes it; without the index as it is left by a power cut."""
    chance, file = Random(f"{seed} recording"), io.BytesIO()
    writer = ArrayWriter(file)
    writer.start(library="attack")
    ours, notes = ChunkChannel(writer, LineSettings(baud=19200, char_bits=11)), NoteChannel(writer)
    parts = [chance.randbytes(chance.choice((8, 60, 400))) for _ in range(count)]
    for number, data in enumerate(parts):
        now = BEGUN_NS + number * STEP_NS
        ours.write(Block.from_chunks([Chunk(now + i, data[i : i + 7]) for i in range(0, len(data), 7)]))
        if number == count // 2:
            notes.write(Note(now, "clock", "the clock was set"))
        writer.flush()
    end = len(file.getvalue())
    writer.finish()
    summary = make_reader(io.BytesIO(file.getvalue())).get_summary()
    assert summary is not None
    (channel,) = (channel.id for channel in summary.channels.values() if channel.topic == TOPIC)
    indexes = [index for index in summary.chunk_indexes if channel in index.message_index_offsets]
    places = [(one.chunk_start_offset, one.chunk_start_offset + one.chunk_length) for one in indexes]
    return Recording(file.getvalue()[: None if index else end], tuple(parts), tuple(places))


def attack(seed: int, times: int) -> Outcome:
    """Every cut of a recording once (or `times` of them, if fewer), and as many damages of other kinds."""
    chance, outcome, lost = Random(f"{seed} damage"), Outcome("damage"), list[float]()
    whole, cut = recording(seed), recording(seed, index=False)
    cuts = range(len(whole.content))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for at in cuts if times >= len(cuts) else sorted(chance.sample(cuts, times)):
            outcome.failures += _judged(folder, whole, whole.content[:at], (at, len(whole.content)), at)
        for number in range(times):
            made = chance.choice((whole, cut))
            size = chance.choice((1, 16, 512, 512, 4096))
            at = chance.randrange(len(made.content))
            kind = chance.choice(("noise", "noise", "zeros", "bit", "gone"))
            damaged = _damaged(chance, made.content, at, size, kind)
            touched = (at, at + (1 if kind == "bit" else size))
            outcome.failures += [
                f"{kind} of {size}: {each}" for each in _judged(folder, made, damaged, touched, number, lost)
            ]
            outcome.tried += 1
    outcome.tried += min(times, len(cuts))
    cost = 100 * sum(lost) / max(1, len(lost))
    outcome.figures = f"seed {seed}, bad 512 bytes cost {cost:.1f} % of a file of {len(whole.content):,} bytes"
    return outcome


def _damaged(chance: Random, content: bytes, at: int, size: int, kind: str) -> bytes:
    if kind == "gone":
        return content[:at] + content[at + size :]
    stretch = bytearray(content[at : at + size])
    if kind == "bit":
        stretch[0] ^= 1 << chance.randrange(8)
    else:
        stretch[:] = chance.randbytes(len(stretch)) if kind == "noise" else bytes(len(stretch))
    return content[:at] + bytes(stretch) + content[at + size :]


def _judged(
    folder: Path,
    made: Recording,
    damaged: bytes,
    touched: tuple[int, int],
    number: int,
    lost: list[float] | None = None,
) -> list[str]:
    """What did not hold of this damage to bytes `touched`."""
    path = folder / "damaged.mcap"
    path.write_bytes(damaged)
    try:
        capture = captures.open(path, format="mcap")
        found = list(capture.chunks())
    except captures.CaptureError as error:
        untouched = [begin for begin, end in made.places if end <= touched[0]]
        return [f"bytes {touched}: {error}"] if untouched else []
    given: dict[int, bytes] = {}
    for chunk in found:
        step = (chunk.t_ns - BEGUN_NS) // STEP_NS
        given[step] = given.get(step, b"") + chunk.data
    wrong = []
    if list(given) != sorted(given) or any(made.parts[step] != data for step, data in given.items()):
        wrong.append(f"bytes {touched}: what was given is not what was recorded")
    missing = set(range(len(made.parts))) - set(given)
    hit = {i for i, (begin, end) in enumerate(made.places) if begin < touched[1] and touched[0] < end}
    if touched[1] - touched[0] == 512 and lost is not None:
        lost.append(len(missing) / len(made.parts))
    if not missing <= hit:
        wrong.append(f"bytes {touched}: chunks {sorted(missing - hit)} are lost, which were not touched")
    if missing and not capture.damage:
        wrong.append(f"bytes {touched}: chunks {sorted(missing)} are lost without a word")
    if number % _REPAIRED == 0:
        repair(path, folder / "whole.mcap")
        again = captures.open(folder / "whole.mcap")
        if list(again.chunks()) != found or again.damage:
            wrong.append(f"bytes {touched}: repaired, it is not the same and whole")
    return wrong
