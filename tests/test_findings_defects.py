"""Each code is found where it is, and nothing else is said: captures with one kind of defect."""

from __future__ import annotations

from collections import Counter
from functools import cache
from zlib import crc32

import pytest
from buses import CHAR_NS, LINE, adu

from analyzer.core import analyse
from analyzer.simulation import Scenario, simulate
from analyzer.simulation.defects import defects
from analyzer.simulation.truth import TruthFinding
from analyzer.tables.findings import Finding, described
from captures.chunks import Capture, Chunk

# Where nothing but a read's end parts two senders, it may be taken for a frame's.
HARD = {("collision", tap): 0.8 for tap in ("irq", "gateway", "untimed")}
HARD["retry", "gateway"] = 0.84  # a request and its repetition may come at once
HARD["flow-control-loss", "untimed"] = 0.9  # the first frames, before anything is known of the bus
NEVER_MIND = {"timing-blind", "poll-waste", "crc-collision"}  # true by chance anywhere

Place = tuple[str, int, int]


@cache
def diagnosed(code: str, tap: str) -> tuple[list[TruthFinding], list[Finding]]:
    made = simulate(Scenario("clean", tap, transactions=160, seed=21, defect=code))
    found = [finding for part in analyse(Capture.of(made.line, made.chunks)) for finding in described(part.findings)]
    return list(made.findings), found


def place(finding: Finding | TruthFinding) -> Place:
    return finding.code, finding.start, finding.length if finding.start >= 0 else 0


# The tap that tells most, and another that a code keeps; benchmarks/score_findings.py goes through all of them.
CASES = [
    (code, tap)
    for code, defect in sorted(defects().items())
    for tap in dict.fromkeys((defect.taps[0], defect.taps[crc32(code.encode()) % len(defect.taps)]))
]


@pytest.mark.parametrize(("code", "tap"), CASES)
def test_found_where_it_is(code: str, tap: str) -> None:
    truth, found = diagnosed(code, tap)
    due = Counter(map(place, truth))
    hits = due & Counter(map(place, found))
    allowed = max(1, round((1 - HARD.get((code, tap), 0.98)) * due.total()))
    assert due
    assert hits.total() >= due.total() - allowed, sorted((due - hits).elements())[:5]


@pytest.mark.parametrize(("code", "tap"), CASES)
def test_nothing_else_is_said(code: str, tap: str) -> None:
    truth, found = diagnosed(code, tap)
    due = set(map(place, truth))
    also = {(other, finding.start) for finding in truth for other in finding.also}
    extra = [f for f in found if place(f) not in due and (f.code, f.start) not in also and f.code not in NEVER_MIND]
    allowed = len(truth) if (code, tap) in HARD else max(2, round(0.02 * len(truth)))
    assert len(extra) <= allowed, [(f.code, f.start, f.text) for f in extra[:5]]


def test_the_byte_and_the_bit_are_named() -> None:
    truth, found = diagnosed("bit-flip", "precise")
    told = {f.start: f.numbers for f in found if f.code == "bit-flip"}
    right = [told[t.start]["byte"] == t.detail["byte"] and told[t.start]["bit"] == t.detail["bit"]
             for t in truth if t.start in told]  # fmt: skip
    assert sum(right) >= 0.98 * len(right)


@pytest.mark.parametrize("code", ["byte-missing", "byte-extra"])
def test_the_place_is_among_those_named(code: str) -> None:
    truth, found = diagnosed(code, "precise")
    told = {f.start: f.numbers for f in found if f.code == code}
    right = 0
    for defect in truth:
        numbers = told.get(defect.start, {})
        spans = [
            (numbers.get(a, -1), numbers.get(b, -1)) for a, b in (("first", "last"), ("second_first", "second_last"))
        ]
        right += any(low <= defect.detail["byte"] <= high for low, high in spans)
    assert right >= 0.95 * len(truth)


def test_the_convention_of_a_check_value_is_named() -> None:
    truth, found = diagnosed("crc-variant", "precise")
    texts = {f.start: f.text for f in found if f.code == "crc-variant"}
    assert all(t.detail["variant"] in texts[t.start] for t in truth)


def test_frames_of_a_unit_whose_address_flow_control_eats_are_told_apart_and_mended() -> None:
    """Unit 19 never shows its address: its requests and answers are noise, which its silences part; a request that was
    mended tells how long its answer is, and so how many bytes that lost."""
    words = "0102aa13" + "0102aaff" * 15
    polls = [(adu("050300330002"), adu("050304ff00fe01")), (adu("130300750020"), adu("130340" + words))]
    chunks, now, due = [], 10**9, []
    offset = 0
    for number in range(60):
        for frame in polls[number % 5 == 4]:
            now += 6_000_000
            heard = frame.translate(None, b"\x11\x13")
            for byte in frame:
                now += CHAR_NS
                if byte not in b"\x11\x13":
                    chunks.append(Chunk(now, bytes([byte])))
            if heard != frame:
                due.append(("flow-control-loss", offset, len(heard)))
            offset += len(heard)
    found = [finding for part in analyse(Capture.of(LINE, chunks)) for finding in described(part.findings)]
    said = {place(finding) for finding in found if finding.start >= 0}
    assert set(due[6:]) <= said  # before, too little is known of this tap
    assert not [f.text for f in found if f.code == "noise" and f.start > due[6][1]]


def test_robbed_frames_that_the_tap_parts_are_no_collisions() -> None:
    """Where a gateway makes two rows of three frames without 11 and 13, what was asked and what comes out tell them."""
    made = simulate(Scenario("clean", "gateway", transactions=200, seed=7311, defect="flow-control-loss"))
    parts = analyse(Capture.of(made.line, made.chunks))
    known = 400  # bytes, by which a port's flow control is known
    assert not [f for part in parts for f in described(part.findings) if f.code == "collision" and f.start > known]
