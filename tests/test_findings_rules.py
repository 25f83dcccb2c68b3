"""Each rule by example, and by what only looks like one."""

from __future__ import annotations

import pytest
from diagnosed import ANSWER, REQUEST, Wire, diagnosed, said, with_crc

from analyzer.core import analyse
from analyzer.options import Options
from analyzer.tables.findings import described
from captures.chunks import Capture, Chunk
from captures.line import LineSettings

OTHER, OTHERS = with_crc("110300700003"), with_crc("110306000100020003")
FAR, FARS = with_crc("020300700002"), with_crc("02030400010002")
WRITE, CHANGED = with_crc("110600010003"), with_crc("110600010004")
SHOUT = with_crc("000600010003")


def bus(*steps: bytes | float, warm_up: int = 12) -> list[tuple[str, int]]:
    """What is said of frames (bytes) with silences (ms) between, the offsets counted from the first of them."""
    wire = Wire().polls(warm_up)
    first = wire.offset
    for step in steps:
        if isinstance(step, bytes):
            wire.send(step)
        else:
            wire.silence(step)
    wire.polls(3)
    return [(code, start - first) for code, start in said(diagnosed(wire))]


def test_a_healthy_bus_has_no_findings() -> None:
    assert diagnosed(Wire().polls(60)) == []


CONVERSATIONS: dict[str, tuple[list[bytes | float], list[tuple[str, int]]]] = {
    "no answer": ([20, REQUEST, 200], [("no-response", 0)]),
    "answered at the second try": ([20, REQUEST, 200, REQUEST, 8, ANSWER], [("no-response", 0), ("retry", 8)]),
    "a poll is no retry": ([20, REQUEST, 8, ANSWER, 20, REQUEST, 8, ANSWER], []),
    "late, before the next answer": ([20, REQUEST, 200, FAR, 4, ANSWER, 10, FARS], [("late-response", 16)]),
    "late, only its place tells": (
        [20, REQUEST, 200, OTHER, 4, ANSWER, 10, OTHERS],
        [("shifted-answer", 16), ("late-response", 16)],
    ),
    "two late": (
        [20, REQUEST, 100, OTHER, 100, FAR, 5, ANSWER, 5, OTHERS, 5, FARS],
        [("late-response", 24), ("late-response", 35)],
    ),
    "late, and the next one silent": (
        [20, REQUEST, 200, FAR, 4, ANSWER, 200],
        [("no-response", 8), ("late-response", 16)],
    ),
    "unasked": ([20, FARS], [("unexpected-response", 0)]),
    "two answers": ([20, REQUEST, 8, ANSWER, 6, OTHERS], [("duplicate-response", 19)]),
    "another count": ([20, REQUEST, 8, with_crc("11030400010002")], [("response-mismatch", 8)]),
    "another echo": ([20, WRITE, 8, CHANGED], [("response-mismatch", 8)]),
    "two writes that nobody answers": ([20, WRITE, 220, CHANGED, 220], [("no-response", 0), ("no-response", 8)]),
    "a broadcast answered as 0": ([20, SHOUT, 8, SHOUT, 120], [("broadcast-answered", 8)]),
    "a broadcast answered by its unit": ([20, SHOUT, 8, WRITE, 120], [("broadcast-answered", 8)]),
    "a broadcast that nobody answers": ([20, SHOUT, 130], []),
    "a read for all": ([20, with_crc("000300010003"), 130], [("broadcast-read", 0)]),
    "too soon after a broadcast": ([20, SHOUT, 40, REQUEST, 8, ANSWER], [("turnaround-short", 8)]),
    "just in time after a broadcast": ([20, SHOUT, 101, REQUEST, 8, ANSWER], []),
    "damaged request, tried again": (
        [20, REQUEST[:3] + b"\x11" + REQUEST[4:], 200, REQUEST, 8, ANSWER],
        [("crc-error", 0), ("retry", 8)],
    ),
    "damaged answer, not silence": ([20, REQUEST, 8, ANSWER[:5] + b"\x57" + ANSWER[6:], 200], [("bit-flip", 8)]),
    "the beginning of an answer": ([20, REQUEST, 8, ANSWER[:2], 200], [("truncated", 8)]),
    "a second answer over one that had just begun": ([20, REQUEST, 8, ANSWER[:4] + FARS, 200], [("collision", 8)]),
    "the same, and more behind it": (
        [20, REQUEST, 8, ANSWER[:4] + FARS + bytes.fromhex("a3f190c81de76b02"), 200],
        [("collision", 8)],
    ),
    "a cut answer, and one that nobody asked": ([20, REQUEST, 8, ANSWER[:4], 6, FARS, 200], [("truncated", 8)]),
    "a cut request, and its answer at once": ([20, REQUEST[:6] + ANSWER, 200], [("truncated", 0)]),
    "a doubled end": ([20, REQUEST, 8, ANSWER + ANSWER[-4:], 200], [("bytes-repeated", 8)]),
}


@pytest.mark.parametrize("name", CONVERSATIONS)
def test_conversations(name: str) -> None:
    steps, found = CONVERSATIONS[name]
    assert bus(*steps) == found


def test_the_answer_to_a_robbed_request_is_no_request() -> None:
    """A unit 17 never shows its address behind flow control; with another byte gone its answer is as long as any."""
    wire = Wire()
    for value in range(60):
        wire.exchange(FAR, with_crc(f"020304{value % 16:04x}0002"))
        wire.exchange(with_crc("0403002a0001"), with_crc("0403020007"))
    request, answer = with_crc("110401140002"), with_crc("11040411800000")
    robbed = [frame.translate(None, bytes((0x11, 0x13))) for frame in (request, answer)]
    first = wire.offset
    wire.exchange(*robbed)
    wire.exchange(FAR, FARS)
    assert said(diagnosed(wire)) == [("flow-control-loss", first), ("flow-control-loss", first + len(robbed[0]))]


def test_an_echo_is_one_however_writes_look() -> None:
    reads: list[bytes | float] = [20, REQUEST, 0.1, REQUEST, 8, ANSWER]
    writes: list[bytes | float] = [20, WRITE, 0.1, WRITE, 8, WRITE]
    assert bus(*reads * 4) == [("echo", 8 + 27 * i) for i in range(4)]
    assert bus(*writes * 4, warm_up=12) == [("echo", 8 + 24 * i) for i in range(4)]


def test_answers_before_the_first_request_belong_to_what_was_before() -> None:
    wire = Wire()
    wire.send(FARS)
    assert said(diagnosed(wire.polls(12))) == []


def test_the_last_request_may_be_answered_after_the_capture() -> None:
    wire = Wire().polls(12)
    wire.silence(20).send(REQUEST)
    assert said(diagnosed(wire)) == []


CONTENTS = {
    "a register too many": ("1103006b007e", "118303", "quantity-out-of-range"),
    "as many as may be": ("1103006b007d", "118302", None),
    "no register": ("1103006b0000", "118303", "quantity-out-of-range"),
    "a bit too many": ("1101001307d1", "118103", "quantity-out-of-range"),
    "count and quantity": ("1110000100020300010002", "119003", "byte-count-mismatch"),
    "count and length": ("11100001000206000100020003", "119003", "byte-count-mismatch"),
    "count without its bytes": ("110f0013000a01cd01", "118f03", "byte-count-mismatch"),
    "1 for on": ("110500ac0001", "118503", "invalid-coil-value"),
    "FF00 for on": ("110500acff00", "110500acff00", None),
    "unit 248": ("f803006b0001", "f88302", "reserved-unit"),
    "unit 247": ("f703006b0001", "f78302", None),
    "function 41": ("11290001", "11a901", "reserved-function"),
    "function 65 is for users": ("11410001", "11c101", None),
    "function 0": ("110000010001", "118001", "invalid-function"),
    "function 131": ("118300010001", "", "invalid-function"),
    "261 bytes": ("1110006b007efc" + "0102" * 126, "119003", "frame-too-long"),
}


@pytest.mark.parametrize("name", CONTENTS)
def test_contents(name: str) -> None:
    asked, answered, code = CONTENTS[name]
    steps = [20, with_crc(asked), *([8, with_crc(answered)] if answered else [220])]
    found = {said_of for said_of, at in bus(*steps) if at == 0} - {"no-response"}
    also = {"quantity-out-of-range"} if code == "frame-too-long" else set()
    assert found == ({code} | also if code else set())


def test_bits_that_nobody_asked_for() -> None:
    asked = with_crc("110100130025")
    assert bus(20, asked, 8, with_crc("110105cd6bb20efb")) == [("padding-bits-set", 8)]
    assert bus(20, asked, 8, with_crc("110105cd6bb20e1b")) == []


def holed(at: int, characters: float) -> list[tuple[str, int]]:
    wire = Wire().polls(12)
    first = wire.offset
    wire.silence(20).send(REQUEST)
    wire.silence(8).send(ANSWER[:at])
    wire.silence(characters * wire.char_ns / 1e6).send(ANSWER[at:])
    return [(code, start - first) for code, start in said(diagnosed(wire.polls(3)))]


def test_silence_inside_a_frame() -> None:
    assert holed(4, 1.4) == []
    assert holed(4, 1.7) == holed(4, 3.0) == [("gap-in-frame", 8)]


def test_silence_before_a_frame() -> None:
    wire = Wire()
    assert bus(20, REQUEST, 3.4 * wire.char_ns / 1e6, ANSWER) == [("gap-too-short", 8)]
    assert bus(20, REQUEST, 3.5 * wire.char_ns / 1e6, ANSWER) == []


def test_limits_of_time_can_be_set() -> None:
    wire = Wire().polls(40)
    codes = {finding.code for finding in diagnosed(wire, options=Options(t35_ns=10_000_000))}
    assert codes == {"gap-too-short"}
    fast = LineSettings(baud=115200, char_bits=11)
    quick = Wire(11 * 10**9 // 115200)
    for _ in range(40):
        quick.silence(20).send(REQUEST)
        quick.silence(1.8).send(ANSWER)
    assert said(diagnosed(quick, fast)) == []  # over 1.750 ms, though under 3.5 ms


def test_marked_bytes() -> None:
    wire = Wire().polls(12)
    first = wire.offset
    wire.silence(20).send(REQUEST)
    wire.silence(8).send(ANSWER, errors=(3, 4))
    (finding,) = diagnosed(wire.polls(3))
    assert (finding.code, finding.start - first, finding.numbers["marked_bytes"]) == ("parity-error", 8, 2)


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ([20, REQUEST, 8, b"\0", ANSWER], "before the frame of unit 17"),
        ([20, b"\xff", REQUEST, 8, ANSWER], "before the frame of the client"),
        ([20, REQUEST, 8, ANSWER, b"\0"], "after the frame of unit 17"),
        ([20, REQUEST, 8, ANSWER, 10, b"\x5a\xa7", 10], "on an idle line"),
    ],
)
def test_noise_by_its_place(steps: list[bytes | float], words: str) -> None:
    wire = Wire().polls(12)
    for step in steps:
        if isinstance(step, bytes):
            wire.send(step)
        else:
            wire.silence(step)
    (finding,) = diagnosed(wire.polls(3))
    assert finding.code == "noise"
    assert words in finding.text


def test_ascii_mode_is_diagnosed_too() -> None:
    lines = [":1103006B007E03\r\n", ":11830369\r\n", ":1103006B00037E\r\n"]
    chunks = [Chunk(i * 10**8, text.encode()) for i, text in enumerate(lines * 3)]
    found = [
        finding for part in analyse(Capture.of(LineSettings(baud=9600), chunks)) for finding in described(part.findings)
    ]
    codes = [finding.code for finding in found]
    assert codes.count("quantity-out-of-range") == codes.count("exception") == 3


@pytest.mark.parametrize(
    ("line", "cause"),
    [
        (LineSettings(baud=9600, tap="irq"), "units on a serial line read RTU"),
        (LineSettings(tap="network"), "no such unit behind this server"),
    ],
)
def test_silence_over_tcp_is_told_by_where_it_was_tapped(line: LineSettings, cause: str) -> None:
    """A gateway that passes MBAP on as it is gets no answer from any unit, whatever its power and wiring."""
    asked = [bytes((0, i, 0, 0, 0, 6, 1 + i % 3, 3, 0, 100, 0, 2)) for i in range(30)]
    capture = Capture.of(line, [Chunk(10**9 + i * 5 * 10**8, adu) for i, adu in enumerate(asked)])
    silent = [one for part in analyse(capture) for one in described(part.findings) if one.code == "no-response"]
    assert silent and all(one.cause.startswith(cause) for one in silent)


def test_silence_over_tcp_on_a_line_that_answers_is_of_the_unit() -> None:
    """Whatever sends it is understood there: nothing is to be set to convert."""
    chunks = []
    for i in range(30):
        chunks.append(Chunk(10**9 + i * 5 * 10**8, bytes((0, i, 0, 0, 0, 6, 1 + i % 2, 3, 0, 100, 0, 1))))
        if i % 2 == 0:
            chunks.append(Chunk(10**9 + i * 5 * 10**8 + 10**8, bytes((0, i, 0, 0, 0, 5, 1, 3, 2, 0, 7))))
    capture = Capture.of(LineSettings(baud=9600, tap="irq"), chunks)
    silent = [one for part in analyse(capture) for one in described(part.findings) if one.code == "no-response"]
    assert silent and all(one.cause.startswith("the unit is absent or not configured in") for one in silent)
    assert "convert" not in "".join(one.remedy for one in silent)


@pytest.mark.parametrize(("code", "slow"), [("0b", False), ("06", True)])
def test_how_long_a_gateway_waits_is_not_how_slow_a_unit_is(code: str, slow: bool) -> None:
    wire = Wire().polls(40)
    for _ in range(20):
        wire.exchange(with_crc("090300700002"), with_crc(f"0983{code}"), wait_ms=500)
    assert ("slow-device" in {finding.code for finding in diagnosed(wire)}) is slow
