"""What needs no lattice gets none: on a healthy bus runs of frames are taken as arrays, whatever is polled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from analyzer.core import deframe
from analyzer.deframing.decisions import Decider
from analyzer.deframing.forced import ForcedRuns, SearchedBytes
from analyzer.deframing.protocols import Deframer
from analyzer.tables.batch import join_batches
from analyzer.tables.schema import Kind
from captures.chunks import Block, Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

_BAUD = 19_200
_LINE = LineSettings(baud=_BAUD, tap="precise")
_CHARACTER_NS = 11 * 10**9 // _BAUD


def _adu(text: str) -> bytes:
    data = bytes.fromhex(text)
    return data + crc_bytes(data)


def _exchange(poll: int, turn: int) -> tuple[bytes, bytes]:
    """A request and its answer. Answers of three bytes of data are as long as a request of nonsense."""
    value = f"{(turn * 7919 + poll * 31) & 0xFFFFFF:06x}"
    return (
        (_adu("010100130018"), _adu(f"010103{value}")),
        (_adu("0202001e0014"), _adu(f"020203{value}")),
        (_adu("0303006b0003"), _adu(f"030306{value}{value}")),
        (_adu("04040008000a"), _adu(f"040414{value * 6}{value[:4]}")),
        (_adu(f"01060001{value[:4]}"), _adu(f"01060001{value[:4]}")),
    )[poll]


def _bus(exchanges: int, polls: Sequence[int], pause_ns: int = 20_000_000) -> list[Chunk]:
    """So many exchanges, these polls in turn, a read a frame, and a pause behind each exchange."""
    now, chunks = 10**18, []
    for turn in range(exchanges):
        for adu in _exchange(polls[turn % len(polls)], turn):
            now += 4 * _CHARACTER_NS + _CHARACTER_NS * len(adu)
            chunks.append(Chunk(now, adu))
        now += pause_ns
    return chunks


@pytest.fixture
def weighed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Frames, or what else, that the lattice decided: how many at a time."""
    steps: list[int] = []
    decide = Decider.decide

    def counted(self: Decider, stretch: SearchedBytes, runs: ForcedRuns, at: int, *args: Any, **more: Any) -> Any:
        decisions = decide(self, stretch, runs, at, *args, **more)
        steps.append(sum(len(decision.steps) for decision in decisions))
        return decisions

    monkeypatch.setattr(Decider, "decide", counted)
    return steps


def test_a_healthy_bus_is_hardly_weighed_frame_by_frame(weighed: list[int]) -> None:
    capture = Capture.of(_LINE, _bus(4000, range(5)))
    batches = list(deframe(capture))
    assert sum(int((batch.rows.kind != Kind.NOISE).sum()) for batch in batches) == 8000
    assert sum(weighed) < 80


def test_nor_where_it_is_polled_every_ten_seconds(weighed: list[int]) -> None:
    capture = Capture.of(_LINE, _bus(500, range(5), pause_ns=10 * 10**9))
    assert sum(int((batch.rows.kind != Kind.NOISE).sum()) for batch in deframe(capture)) == 1000
    assert sum(weighed) < 80


def test_nor_is_it_live_where_what_follows_is_not_known(weighed: list[int]) -> None:
    chunks = _bus(3000, (2, 3))
    live, rows = Deframer(_LINE), []
    for first in range(0, len(chunks), 10):
        block = Block.from_chunks(chunks[first : first + 10])
        rows.append(live.feed(block, int(block.t_ns[-1])).rows)
    rows.append(live.close().rows)
    assert sum(weighed) < 2 * len(rows)  # of ten frames a feed, the newest
    whole = join_batches(list(deframe(Capture.of(_LINE, chunks)))).rows
    for name in ("index", "kind", "unit", "request", "response_ns", "t_end_ns"):
        np.testing.assert_array_equal(np.concatenate([part.column(name) for part in rows]), whole.column(name))
