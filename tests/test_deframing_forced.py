"""What needs no lattice gets none: on a healthy bus runs of frames are taken as arrays, whatever is polled."""

from __future__ import annotations

import pytest

from analyzer.core import deframe
from analyzer.deframing.decisions import Decider
from analyzer.tables.schema import Kind
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

_BAUD = 19_200
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


@pytest.mark.parametrize("exchanges", [4000])
def test_a_healthy_bus_is_hardly_weighed_frame_by_frame(exchanges: int, monkeypatch: pytest.MonkeyPatch) -> None:
    weighed = 0
    decide = Decider.decide

    def counted(self: Decider, *args: object, **more: object) -> object:
        nonlocal weighed
        weighed += 1
        return decide(self, *args, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(Decider, "decide", counted)
    now, chunks = 10**18, []
    for turn in range(exchanges):
        for adu in _exchange(turn % 5, turn):
            now += 4 * _CHARACTER_NS + _CHARACTER_NS * len(adu)
            chunks.append(Chunk(now, adu))
        now += 20_000_000
    capture = Capture.of(LineSettings(baud=_BAUD, tap="precise"), chunks)
    batches = list(deframe(capture))
    assert sum(int((batch.rows.kind != Kind.NOISE).sum()) for batch in batches) == 2 * exchanges
    assert weighed < 2 * exchanges / 100
