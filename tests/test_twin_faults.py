"""`rtuscope twin --fault`: what goes wrong on purpose, to real clients, and as this program itself names it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from running import START, environment, refused

from analyzer.analysis import Analysis
from analyzer.twin.faults import FAULTS, FaultError, FaultyAnswers, fault_of
from analyzer.twin.memory import RecordedAnswer, TwinUnit
from analyzer.twin.serving import TwinsOnALine, serve_line
from captures import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

_MS = 1_000_000
READ = bytes.fromhex("03006b0003")
ANSWER = bytes.fromhex("0306ae4156524340")
WRITE = bytes.fromhex("0600010003")
posix = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")


def adu(pdu: bytes, unit: int = 17) -> bytes:
    return (body := bytes((unit,)) + pdu) + crc_bytes(body)


def unit(number: int = 17) -> TwinUnit:
    """One that was read and written."""
    twin = TwinUnit(number)
    for request, answer in ((READ, ANSWER), (WRITE, WRITE)):
        twin.ask(request)
        twin.learn(request, RecordedAnswer(answer, 5 * _MS, 0))
    return twin


class PlayedLine:
    """A line on which requests stand ready; nothing waits."""

    may_echo = False

    def __init__(self, *requests: bytes) -> None:
        self.waiting, self.sent = list(requests), list[bytes]()

    def read(self, wait_s: float) -> bytes:  # noqa: ARG002
        return self.waiting.pop(0) if self.waiting else b""

    def write(self, data: bytes) -> None:
        self.sent.append(data)


def sent(*faults: str, asked: int = 1, request: bytes = READ) -> list[bytes]:
    """What a twin with these faults puts on its line."""
    answering = TwinsOnALine({17: unit()}, FaultyAnswers([fault_of(each) for each in faults], Random(5)))
    line = PlayedLine(*[adu(request)] * asked)
    serve_line(answering, line, lambda: not line.waiting)
    return line.sent


def test_each_fault_does_what_it_says():
    right = adu(ANSWER)
    assert sent() == [right]
    assert sent("silence") == []
    assert sent("exception=6") == [adu(b"\x83\x06")]
    assert sent("wrong-unit=9") == [adu(ANSWER, 9)]
    assert sent("duplicate") == [right + right]
    assert sent("truncation=3") == [right[:-3]]
    assert sent("stray=2") == [right + b"\0\0"]
    [spoilt] = sent("corruption")
    assert sum(bin(a ^ b).count("1") for a, b in zip(spoilt, right, strict=True)) == 1
    assert spoilt[0] == 17
    assert set(FAULTS) == {
        "silence",
        "delay",
        "exception",
        "wrong-unit",
        "duplicate",
        "truncation",
        "stray",
        "corruption",
    }


def test_a_delay_is_added_to_the_unit_s_own():
    answering = TwinsOnALine({17: unit()}, FaultyAnswers([fault_of("delay=250")]))
    answer = answering.answer(17, READ)
    assert answer is not None
    assert answer.delay_ns == 255 * _MS


def test_a_lost_answer_is_to_something_done_and_a_refusal_to_something_left():
    for fault, held in (("silence", 9), ("exception", 3)):
        answering = TwinsOnALine({17: unit()}, FaultyAnswers([fault_of(f"{fault}@1/2")]))
        answering.answer(17, READ)
        answering.answer(17, b"\x06\x00\x01\x00\x09")
        answer = answering.answer(17, b"\x03\x00\x01\x00\x01")
        assert answer is not None
        assert answer.pdu == bytes((3, 2, 0, held))


def test_each_nth_answer_of_a_unit_goes_wrong():
    told = sent("silence@1/3", asked=9)
    assert len(told) == 6
    answering = TwinsOnALine(
        {17: unit(), 18: unit(18)}, FaultyAnswers([fault_of("18:exception=6"), fault_of("silence")])
    )
    assert answering.answer(17, READ) is None
    answer = answering.answer(18, READ)
    assert answer is not None
    assert answer.pdu == b"\x83\x06"
    assert answering.faults.shown == {"silence": 1, "exception": 1}


@given(share=st.integers(5, 95), seed=st.integers(0, 999))
def test_a_share_is_kept(share, seed):
    faults = FaultyAnswers([fault_of(f"silence@{share}%")], Random(seed))
    count = sum(faults.due(17) is not None for _ in range(2000))
    assert abs(count / 2000 - share / 100) < 0.06  # five deviations


NAMED = {  # what a report of the twin's bus must find
    "silence@1/4": "no-response",
    "exception=6@1/4": "exception",
    "corruption@1/4": "bit-flip",
    "truncation=3@1/4": "truncated",
    "duplicate@1/4": "duplicate-response",
    "wrong-unit=9@1/4": "unexpected-response",
}


@pytest.mark.parametrize("fault", NAMED)
def test_what_is_shown_is_what_this_program_finds(fault):
    answering = TwinsOnALine({17: unit()}, FaultyAnswers([fault_of(fault)], Random(3)))
    line, chunks, t_ns = LineSettings(19200, 11), list[Chunk](), 0
    for _ in range(40):
        t_ns += 400 * _MS
        chunks.append(Chunk(t_ns, adu(READ)))
        if (answer := answering.answer(17, READ)) is not None:
            body = bytes((17 if answer.as_unit is None else answer.as_unit,)) + answer.pdu
            chunks.append(Chunk(t_ns + answer.delay_ns + 15 * _MS, answer.spoil(body + crc_bytes(body))))
    found = {finding.code for finding in Analysis(Capture.of(line, chunks)).findings()}
    assert answering.faults.shown.total() == 10
    assert NAMED[fault] in found, found


@given(text=st.text(st.sampled_from("silence delay=@1/%:0579"), max_size=14))
def test_what_is_no_fault_is_said_in_a_line(text):
    try:
        assert fault_of(text).name in FAULTS
    except FaultError as error:
        assert "\n" not in str(error)


@contextlib.contextmanager
def twin_of(capture: Path, *arguments: str) -> Iterator[str]:
    """The command, running; what its first line says, and at the end that it counted its faults."""
    command = [sys.executable, "-c", START, "twin", str(capture), *arguments]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment(), start_new_session=True
    )
    assert process.stdout is not None
    try:
        yield process.stdout.readline().decode().strip()
    finally:
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 0, err.decode()
    assert b"faults on purpose: " in err


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """Unit 17, asked for three registers."""
    rows = [(100, adu(READ)), (120, adu(ANSWER)), (300, adu(READ)), (320, adu(ANSWER))]
    text = "".join(f'{{"t_ns": {ms * _MS}, "hex": "{data.hex()}"}}\n' for ms, data in rows)
    path = tmp_path / "unit.jsonl"
    path.write_text('{"format": "serial-chunks", "version": 1, "baud": 19200, "char_bits": 11}\n' + text)
    return path


@posix
def test_minimalmodbus_meets_each_fault_on_a_pseudo_terminal(capture):
    minimalmodbus = pytest.importorskip("minimalmodbus")
    for fault, error in {
        "silence": minimalmodbus.NoResponseError,
        "exception=6": minimalmodbus.SlaveReportedException,
        "wrong-unit=9": minimalmodbus.InvalidResponseError,
        "corruption": minimalmodbus.InvalidResponseError,
    }.items():
        with twin_of(capture, "--fault", f"{fault}@1/2") as port:
            client = minimalmodbus.Instrument(port, 17)
            client.serial.baudrate, client.serial.timeout = 19200, 1.0 if fault == "silence" else 10.0
            assert client.read_registers(107, 3) == [0xAE41, 0x5652, 0x4340]
            with pytest.raises((error, minimalmodbus.ModbusException)) as raised:
                client.read_registers(107, 3)
            assert isinstance(raised.value, error), (fault, raised.value)
            client.serial.close()


@posix
def test_pymodbus_meets_faults_on_a_pseudo_terminal(capture):
    pytest.importorskip("pymodbus")
    from pymodbus.client import ModbusSerialClient

    with twin_of(capture, "--fault", "exception=6@1/2") as port:
        client = ModbusSerialClient(port, baudrate=19200, timeout=10)
        assert client.connect()
        assert client.read_holding_registers(107, count=3, device_id=17).registers == [0xAE41, 0x5652, 0x4340]
        assert client.read_holding_registers(107, count=3, device_id=17).exception_code == 6
        client.close()


def test_pymodbus_meets_a_delay_over_tcp(capture):
    pytest.importorskip("pymodbus")
    from pymodbus.client import ModbusTcpClient

    with twin_of(capture, "--listen", "0", "--fault", "delay=700@1/2") as place:
        client = ModbusTcpClient("127.0.0.1", port=int(place.rpartition(":")[2]), timeout=30)
        assert client.connect()
        begun = time.monotonic()
        for _ in range(2):
            assert client.read_holding_registers(107, count=3, device_id=17).registers == [0xAE41, 0x5652, 0x4340]
        assert time.monotonic() - begun >= 0.7
        client.close()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--fault", "silent"], "no fault 'silent'"),
        (["--fault", "exception=300"], "exception takes 1 to 255, not 300"),
        (["--fault", "silence=3"], "silence takes 0 to 0, not 3"),
        (["--fault", "silence@120%"], "a percentage up to 100%"),
        (["--fault", "300:silence"], "unit takes 0 to 247, not 300"),
        (["--fault", "silence@1/0"], "1/N takes 1 to 999999, not 0"),
        (["--fault", "corruption", "--listen", "0"], "needs a serial line"),
        (["--fault", "silence", "--client", "--transmit", "/dev/x"], "goes with a twin"),
    ],
)
def test_what_cannot_be_is_told_in_a_line(arguments, told, capture, capsys):
    assert told in refused(capsys, "twin", capture, *arguments)
