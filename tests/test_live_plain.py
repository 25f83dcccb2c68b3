"""A healthy line, live: its frames are shown without what only contested bytes need."""

from __future__ import annotations

from itertools import pairwise

from buses import CHAR_NS, LINE, adu
from packets import read_answer, read_request

from analyzer.core import Analyzer
from analyzer.deframing.decisions import Decider
from analyzer.deframing.stream import RtuDeframer
from analyzer.live.lines import TextLines
from analyzer.live.recent import Recent
from analyzer.live.session import SessionStep
from analyzer.options import Options
from captures.chunks import Block, Chunk
from captures.line import LineSettings

_READ = 8  # bytes: what a FIFO gives
_EXCHANGE = (adu("1103006b000a"), adu("110314" + "0102" * 10))


def _reads(exchanges: int) -> list[list[Chunk]]:
    """The reads of each exchange, t3.5 and more before each frame."""
    t_ns, parts = 1_000_000_000, []
    for _ in range(exchanges):
        part: list[Chunk] = []
        for frame in _EXCHANGE:
            t_ns += 5 * CHAR_NS
            for at in range(0, len(frame), _READ):
                t_ns += len(frame[at : at + _READ]) * CHAR_NS
                part.append(Chunk(t_ns, frame[at : at + _READ]))
        parts.append(part)
    return parts


def test_frames_before_the_first_read_of_the_next_one_need_no_lattice(monkeypatch):
    looks: list[int] = []
    decide = Decider.decide

    def looked(self, *given, **named):
        looks.append(1)
        return decide(self, *given, **named)

    monkeypatch.setattr(Decider, "decide", looked)
    deframer, shown = RtuDeframer(LINE), 0
    parts = _reads(60)
    for i, (part, following) in enumerate(pairwise(parts)):
        if i == 30:  # silences have earned trust by then
            looks.clear()
        shown += len(deframer.feed(Block.from_chunks([*part[i > 0 :], following[0]]), following[0].t_ns))
    assert shown == 2 * 59 and not looks


def test_a_frame_of_modbus_tcp_has_no_check_value_that_could_be_wrong():
    analyzer = Analyzer(LineSettings(), Options(protocol="tcp"), settles=False)
    chunks = [Chunk(1_000_000, read_request(1, 17)), Chunk(3_000_000, read_answer(1, 17))]
    analyzer.feed(Block.from_chunks(chunks))
    analyzer.close()
    lines = TextLines(colour=False, width=None)
    step = SessionStep(3_000_000, analyzer.latest)
    told = [lines.of(shown) for shown in Recent().feed(step)]
    assert len(told) == 2 and "17 03" in told[0] and not any("WRONG" in line for line in told)
