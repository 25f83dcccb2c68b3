"""A healthy line, live: its frames are shown without what only contested bytes need."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from buses import CHAR_NS, LINE, adu, rtu_deframer
from packets import read_answer, read_request

from analyzer.cli.sniff import _recorded
from analyzer.core import Analyzer, analyse
from analyzer.deframing.decisions import Decider
from analyzer.languages import telling
from analyzer.live.lines import Recent, TextLines
from analyzer.live.session import SessionStep
from analyzer.live.status import LineStatus
from analyzer.options import Options
from analyzer.simulation import Scenario, simulate
from analyzer.tables.findings import Severity, described
from captures.chunks import Block, Capture, Chunk
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
    deframer, shown = rtu_deframer(LINE), 0
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


@pytest.mark.parametrize(("off_ns", "took"), [(0.0, "21.5 ms"), (16.2e6, "5.2..38 ms"), (math.inf, "")])
def test_a_response_time_is_told_as_far_as_the_clock_carries_it(off_ns, took):
    analyzer = Analyzer(LINE)
    sent = [Chunk(1_000_000_000, _EXCHANGE[0]), Chunk(1_021_500_000 + len(_EXCHANGE[1]) * CHAR_NS, _EXCHANGE[1])]
    analyzer.feed(Block.from_chunks(sent))
    analyzer.close()
    latest = analyzer.latest
    step = SessionStep(0, replace(latest, batch=replace(latest.batch, off_ns=off_ns)))
    _, answer = (TextLines(colour=False, width=None).of(shown) for shown in Recent().feed(step))
    assert answer.rstrip().endswith(f"   {took}" if took else " 258")


def test_frames_are_told_in_russian():
    analyzer = Analyzer(LINE)
    analyzer.feed(Block.from_chunks([Chunk(1_000_000_000, _EXCHANGE[0])]))
    analyzer.close()
    with telling("ru"):
        (shown,) = Recent().feed(SessionStep(0, analyzer.latest))
        assert "17 03 читать 10 регистров хранения с 107" in TextLines(colour=False, width=None).of(shown)


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("en", "0:00:00  1 byte with a parity or framing error  1 error  load 0.9%  2 frames/s  1 frame"),
        ("ru", "0:00:00  с ошибкой чётности или стопового бита: 1 байт  1 ошибка  загрузка 0,9 %  2 кадр/с  1 кадр"),
    ],
)
def test_the_status_line_agrees_with_its_numbers(language, words):
    analyzer = Analyzer(LINE)
    analyzer.feed(Block.from_chunks([Chunk(1_000_000_000, adu("11030001ff00")[:-1] + b"\0")]))
    analyzer.close()
    status = LineStatus(LINE)
    status.feed(SessionStep(1_000_000_000, analyzer.latest, heard=8, marked=1))
    with telling(language):
        assert str(status) == words
        assert status.fitted("REC 5.2 kB", 25) == "0:00:00  REC 5.2 kB"  # no half of a number behind it


def test_a_recording_is_told_in_the_units_of_the_interface():
    class Small:
        bytes, paused = 5_230, True

    small: Any = Small()
    with telling("en"):
        assert _recorded(small) == "RECORDING PAUSED 5.2 kB"
    with telling("ru"):
        assert _recorded(small) == "ЗАПИСЬ НА ПАУЗЕ 5,2 кБ"


@pytest.mark.parametrize("defect", ["noise", "no-response", "exception"])
def test_the_status_line_counts_what_the_views_count(defect):
    made = simulate(Scenario("clean", "precise", transactions=120, seed=3, defect=defect))
    capture = Capture.of(made.line, made.chunks)
    status, told = LineStatus(made.line), Counter[Severity]()
    for part in analyse(capture):
        status.feed(SessionStep(0, part))
        told.update(finding.severity for finding in described(part.findings))
    assert (status.errors, status.warnings) == (told[Severity.ERROR], told[Severity.WARNING]) != (0, 0)
