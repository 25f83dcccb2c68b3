"""`rtuscope twin`: recorded units answer as they did, to real clients on real ports."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from running import PATIENCE_S, START, environment, ran, refused

import captures
from analyzer.twin.memory import RecordedAnswer, TwinUnit
from analyzer.twin.record import RecordedReply, recorded, twins
from analyzer.twin.serving import TwinsOnALine, serve_line
from dissectors.crc import crc_bytes
from dissectors.lengths import Role, adu_end, sound_roles

_MS = 1_000_000


def read(address: int, quantity: int, function: int = 3) -> bytes:
    """A request to read."""
    return bytes((function,)) + address.to_bytes(2, "big") + quantity.to_bytes(2, "big")


def words(*values: int, function: int = 3) -> bytes:
    """An answer to it."""
    return bytes((function, 2 * len(values))) + b"".join(value.to_bytes(2, "big") for value in values)


def write(address: int, value: int) -> bytes:
    """A request to write one register, and its answer."""
    return b"\6" + address.to_bytes(2, "big") + value.to_bytes(2, "big")


def unit(*exchanges: tuple[bytes, bytes], unknown: int | None = None) -> TwinUnit:
    """A unit with these requests and answers, a second and 5 ms each."""
    made = TwinUnit(9, unknown=unknown)
    for number, (request, answer) in enumerate(exchanges):
        made.ask(request)
        made.learn(request, RecordedAnswer(answer, 5 * _MS, number * 1000 * _MS))
    return made


def said(twin: TwinUnit, request: bytes) -> bytes | None:
    """The PDU that it answers."""
    answer = twin.answer(request)
    return None if answer is None else answer.pdu


def simulated(folder: Path, seed: int, capsys: pytest.CaptureFixture[str]) -> Path:
    """A capture of a plausible bus."""
    path = folder / f"{seed}.jsonl"
    done = ran(capsys, "simulate", path, "--transactions", "120", "--seed", str(seed), "--baud", "19200")
    assert done.status == 0
    return path


@pytest.mark.parametrize("seed", range(5))
def test_recorded_requests_are_answered_by_the_recorded_bytes(seed, tmp_path, capsys):
    path = simulated(tmp_path, seed, capsys)
    units = twins(captures.open(path))
    replies = [each for each in recorded(captures.open(path)) if isinstance(each, RecordedReply)]
    assert len(replies) > 50
    for reply in replies:
        answer = units[reply.unit].answer(reply.request)
        assert answer is not None
        assert answer.pdu == reply.answer.pdu
        assert reply.answer.delay_ns in (None, answer.delay_ns)


@pytest.mark.parametrize("seed", range(3))
def test_delays_of_other_requests_are_drawn_from_the_recorded_ones(seed, tmp_path, capsys):
    path = simulated(tmp_path, seed, capsys)
    delays = defaultdict(set)
    for each in recorded(captures.open(path)):
        if isinstance(each, RecordedReply):
            delays[each.unit].add(each.answer.delay_ns)
    for number, twin in twins(captures.open(path)).items():
        for address in range(20):
            answer = twin.answer(read(60_000 + address, 1))
            assert answer is not None
            assert answer.delay_ns in delays[number]


def test_answers_come_in_their_order_and_round_again():
    twin = unit((read(0, 1), words(1)), (read(0, 1), words(2)), (read(0, 1), b"\x83\6"))
    assert [said(twin, read(0, 1)) for _ in range(4)] == [words(1), words(2), b"\x83\6", words(1)]


def test_other_requests_are_answered_from_the_registers():
    twin = unit((read(10, 3), words(7, 8, 9)), (read(10, 3, 4), words(1, 2, 3, function=4)))
    assert said(twin, read(11, 2)) == words(8, 9)
    assert said(twin, read(11, 1, 4)) == words(2, function=4)
    assert said(twin, read(12, 2)) == b"\x83\2"
    assert said(twin, read(12, 0)) == said(twin, read(12, 126)) == b"\x83\3"
    assert said(twin, read(0xFFFF, 2)) == b"\x83\2"
    assert said(twin, b"\x2b\x0e\1\0") == b"\xab\1"


def test_unknown_registers_hold_what_was_asked_for():
    twin = unit((read(10, 1), words(7)), unknown=0)
    assert said(twin, read(9, 3)) == words(0, 7, 0)
    assert said(twin, write(500, 3)) == write(500, 3)
    assert said(twin, read(500, 1)) == words(3)


def test_coils_are_kept_bit_by_bit():
    asked = read(20, 10, 1)
    twin = unit((asked, b"\1\2\x01\x02"))
    assert said(twin, read(20, 1, 1)) == b"\1\1\1"
    assert said(twin, b"\5\0\x15\xff\0") == b"\5\0\x15\xff\0"
    assert said(twin, read(21, 9, 1)) == b"\1\2\x01\x01"
    assert said(twin, asked) == b"\1\2\x03\x02"
    assert said(twin, b"\5\0\x15\1\0") == b"\x85\3"
    assert said(twin, b"\x0f\0\x14\0\2\1\0") == b"\x0f\0\x14\0\2"
    assert said(twin, asked) == b"\1\2\x00\x02"


def test_what_a_client_writes_is_kept_in_recorded_answers_too():
    twin = unit((read(0, 2), words(1, 2)), (read(0, 2), words(1, 3)))
    assert said(twin, write(1, 99)) == write(1, 99)
    assert [said(twin, read(0, 2)) for _ in range(3)] == [words(1, 99)] * 3
    assert said(twin, b"\x10\0\0\0\2\4\0\5\0\6") == b"\x10\0\0\0\2"
    assert said(twin, read(0, 2)) == words(5, 6)
    assert said(twin, b"\x10\0\0\0\2\4\0\5") == b"\x90\3"


def test_the_record_goes_on_behind_a_recorded_write():
    exchanges = [(read(0, 1), words(1)), (write(0, 5), write(0, 5)), (read(0, 1), words(5)), (read(0, 1), words(6))]
    twin = unit(*exchanges)
    assert [said(twin, request) for request, _ in exchanges] == [answer for _, answer in exchanges]
    assert said(twin, write(0, 5)) == write(0, 5)
    assert said(twin, read(0, 1)) == words(5)  # round again: what was before the write is over


def test_a_request_that_was_never_answered_stays_so():
    twin = unit((read(0, 1), words(1)))
    for _ in range(2):
        twin.ask(read(50, 1))
    twin.ask(read(0, 2))  # once: its answer may have been lost
    assert said(twin, read(50, 1)) is None
    assert said(twin, read(0, 2)) == b"\x83\2"


def test_a_broadcast_is_done_and_not_answered():
    twin = unit((read(0, 1), words(1)))
    twin.broadcast(write(0, 4))
    assert said(twin, read(0, 1)) == words(4)


class EchoingLine:
    """A line whose adapter hears what it sends; a client's requests come one after the other."""

    may_echo = True

    def __init__(self, *requests: bytes, echoes: bool) -> None:
        self.waiting, self.echoes = list(requests), echoes
        self.sent: list[bytes] = []

    def read(self, wait_s: float) -> bytes:  # noqa: ARG002
        return self.waiting.pop(0) if self.waiting else b""

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        if self.echoes:
            self.waiting.insert(0, data)

    def is_heard(self) -> bool:
        return not self.waiting


@pytest.mark.parametrize("echoes", [False, True])
def test_its_own_echo_is_no_request(echoes):
    asked, wrote = rtu(read(0, 1)), rtu(write(0, 5))
    twin = TwinUnit(9)
    twin.learn(read(0, 1), RecordedAnswer(words(1), 0, 0))
    line = EchoingLine(asked, wrote, wrote, asked, echoes=echoes)
    serve_line(TwinsOnALine({9: twin}), line, lambda: not line.waiting)
    assert line.sent == [rtu(words(1)), wrote, wrote, rtu(words(5))]


def test_the_echo_of_a_write_ends():
    twin = TwinUnit(9)
    twin.learn(write(0, 5), RecordedAnswer(write(0, 5), 0, 0))
    line = EchoingLine(rtu(write(0, 5)), echoes=True)
    serve_line(TwinsOnALine({9: twin}), line, lambda: not line.waiting)
    assert line.sent == [rtu(write(0, 5))]


ZERO_ENDED = [address for address in range(4000) if not crc_bytes(b"\x09" + read(address, 1))[-1]]


@pytest.mark.parametrize("split", [8, 7, 1])
def test_a_frame_that_ends_in_zero_is_whole_with_its_zero(split):
    """Its CRC is right a byte before its end too: one request of 256 was cut there."""
    assert len(ZERO_ENDED) > 8
    for address in ZERO_ENDED[:8]:
        twin, asked = TwinUnit(9), rtu(read(address, 1))
        twin.learn(read(address, 1), RecordedAnswer(words(1), 0, 0))
        pieces = [asked[at : at + split] for at in range(0, len(asked), split)]
        line = EchoingLine(*pieces, rtu(read(address, 1)), echoes=False)
        serve_line(TwinsOnALine({9: twin}), line, line.is_heard)
        assert line.sent == [rtu(words(1))] * 2


@pytest.mark.parametrize("role", Role)
def test_an_adu_ends_where_its_function_says(role):
    bodies = [bytes((function, *rest)) for function in (3, 16) for rest in ((0, 9, 0, 2), (4, 0, 1, 2, 3))]
    told = 0
    for body in bodies:
        if role not in sound_roles(body):
            continue
        for unit in range(256):
            adu = bytes((unit,)) + body + crc_bytes(bytes((unit,)) + body)
            assert adu_end(adu, role) == len(adu)
            assert adu_end(adu[:-1], role) is None
            assert adu_end(adu + b"\x07\x03", role) == len(adu)
            told += 1
    assert told


def rtu(pdu: bytes) -> bytes:
    """A frame of unit 9."""
    return b"\x09" + pdu + crc_bytes(b"\x09" + pdu)


@contextlib.contextmanager
def twin_of(*arguments: str | Path) -> Iterator[str]:
    """The command, running; what its first line says."""
    command = [sys.executable, "-c", START, "twin", *map(str, arguments)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment(), start_new_session=True
    )
    assert process.stdout is not None
    try:
        given = process.stdout.readline().decode().strip()
        assert given, process.stderr and process.stderr.read().decode()
        yield given
    finally:
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, err.decode()
    assert b"answered" in err


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """Units 5 and 6, asked for two registers three times each."""
    lines = ['{"format": "serial-chunks", "version": 1, "baud": 19200, "char_bits": 11, "parity": "E", "stop_bits": 1}']
    t_ns = 10**18
    for n in range(3):
        for number in (5, 6):
            for body, wait in ((read(100, 2), 100), (words(number * 100, n), 20)):
                adu = bytes((number,)) + body
                adu += crc_bytes(adu)
                t_ns += wait * _MS
                lines.append(f'{{"t_ns": {t_ns}, "hex": "{adu.hex()}"}}')
    path = tmp_path / "units.jsonl"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_client_over_tcp_gets_what_was_recorded(capture):
    pytest.importorskip("pymodbus")
    from pymodbus.client import ModbusTcpClient

    with twin_of(capture, "--listen", "0") as given:
        client = ModbusTcpClient("127.0.0.1", port=int(given.rpartition(":")[2]), timeout=10)
        assert client.connect()
        for n in (0, 1, 2, 0):
            assert client.read_holding_registers(100, count=2, device_id=5).registers == [500, n]
        assert client.read_holding_registers(100, count=2, device_id=6).registers == [600, 0]
        assert client.read_holding_registers(7, count=1, device_id=6).exception_code == 2
        assert not client.write_register(101, 42, device_id=5).isError()
        assert client.read_holding_registers(100, count=2, device_id=5).registers == [500, 42]
        client.close()


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")
def test_a_client_on_a_pseudo_terminal_gets_what_was_recorded(capture):
    pytest.importorskip("pymodbus")
    from pymodbus.client import ModbusSerialClient

    with twin_of(capture, "--unit", "5") as given:
        client = ModbusSerialClient(given, baudrate=19200, timeout=5)
        assert client.connect()
        for n in range(3):
            assert client.read_holding_registers(100, count=2, device_id=5).registers == [500, n]
        client.close()


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")
def test_the_recorded_client_asks_a_unit_and_compares(capture, capsys):
    with twin_of(capture, "--unit", "5", "--unit", "6") as given:
        plain = ("twin", capture, "--unit", "5", given, "--client", "--parity", "N")
        assert "confirm with --transmit" in refused(capsys, *plain)
        done = ran(capsys, *plain, "--transmit")
    assert done.out == "3 requests: 3 answered as recorded, 0 otherwise, 0 not answered\n"
    assert done.status == 0
    assert "transmitting on" in done.err


def test_an_address_of_another_machine_is_told_without_python_s_words(capture, capsys):
    said = refused(capsys, "twin", capture, "--listen", "192.0.2.1:0")
    assert said.startswith("192.0.2.1:0: ") and "attempting" not in said


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--unit", "7"], "unit 7 answers no request"),
        (["/dev/x", "--listen", "0"], "not both"),
        (["--transmit"], "needs --client"),
        (["--client", "--transmit", "/dev/x"], "--client needs"),
        (["/dev/nowhere"], "no such port"),
        (["--unknown", "x"], "neither exception nor a number"),
    ],
)
def test_what_cannot_be_is_told_in_a_line(arguments, told, capture, capsys):
    assert told in refused(capsys, "twin", capture, *arguments)
