"""`rtuscope between` on real pseudo-terminals and sockets, with real clients and servers at its ends."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from livebus import raw_pty
from running import PATIENCE_S, START, environment, refused

import captures
from dissectors.crc import crc_bytes

termios = pytest.importorskip("termios", reason="pseudo-terminals are POSIX")
serial = pytest.importorskip("serial")


@contextlib.contextmanager
def between(*arguments: str | Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """The command, and the port that it names."""
    command = [sys.executable, "-c", START, "between", *map(str, arguments)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0, env=environment(), start_new_session=True
    )
    assert process.stdout is not None
    try:
        given = process.stdout.readline().decode().strip()
        assert given, process.stderr and process.stderr.read().decode()
        yield process, given
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE_S)


def said_until(process: subprocess.Popen[bytes], *words: str) -> str:
    """What it says on standard error, until all of these were among it."""
    assert process.stderr is not None
    said = ""
    while not all(each in said for each in words):
        heard = process.stderr.readline().decode()
        assert heard, said
        said += heard
    return said


def frames_of(process: subprocess.Popen[bytes]) -> list[str]:
    """The directions of what it shows, to its own end."""
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err.decode()
    return [direction for each in map(json.loads, out.splitlines()) if (direction := each.get("direction"))]


@contextlib.contextmanager
def line() -> Iterator[tuple[int, str, int]]:
    """A serial port as a pseudo-terminal: the far end's descriptor, its name, its own descriptor."""
    far, near = raw_pty()
    yield far, os.ttyname(near), near
    os.close(far)
    os.close(near)


def read_all(descriptor: int, n: int, patience_s: float = 20) -> bytes:
    """So many bytes."""
    data, until = b"", time.monotonic() + patience_s
    os.set_blocking(descriptor, False)
    while len(data) < n and time.monotonic() < until:
        try:
            data += os.read(descriptor, 1 << 16)
        except BlockingIOError:
            time.sleep(0.002)
    os.set_blocking(descriptor, True)
    return data


def write_all(descriptor: int, data: bytes) -> None:
    """All of them, however long it takes."""
    while data:
        data = data[os.write(descriptor, data[:2048]) :]


def request_of(unit: int, address: int) -> bytes:
    """Read two holding registers."""
    pdu = bytes((unit, 3)) + address.to_bytes(2, "big") + b"\0\2"
    return pdu + crc_bytes(pdu)


def answer_of(unit: int, first: int, second: int) -> bytes:
    """Two registers."""
    pdu = bytes((unit, 3, 4)) + first.to_bytes(2, "big") + second.to_bytes(2, "big")
    return pdu + crc_bytes(pdu)


def test_bytes_pass_unchanged_both_ways_at_once():
    sent, back = random.Random(1).randbytes(150_000), random.Random(2).randbytes(150_000)
    with line() as (far, name, _), between(name) as (process, given):
        client = os.open(given, os.O_RDWR | os.O_NOCTTY)
        threads = [
            threading.Thread(target=write_all, args=(os.dup(end), data), daemon=True)
            for end, data in ((client, sent), (far, back))
        ]
        assert process.stdout is not None
        threading.Thread(target=process.stdout.read, daemon=True).start()
        reader = os.open(given, os.O_RDWR | os.O_NOCTTY)
        got: dict[str, bytes] = {}

        def take(what: str, descriptor: int, n: int) -> None:
            data = b""
            while len(data) < n:
                data += os.read(descriptor, 1 << 16)
            got[what] = data

        threads += [
            threading.Thread(target=take, args=("far", far, len(sent)), daemon=True),
            threading.Thread(target=take, args=("client", reader, len(back)), daemon=True),
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60)
        assert got["far"] == sent
        assert got["client"] == back
        os.close(client)
        os.close(reader)
        said_until(process, "listening")  # from then on it heeds signals, whatever a background job inherits


def test_directions_are_certain_and_all_is_recorded(tmp_path):
    path = tmp_path / "bus.mcap"
    with contextlib.ExitStack() as ends:
        far, name, _ = ends.enter_context(line())
        process, given = ends.enter_context(between(name, "--json", "-o", path, "--count", "8"))
        client = ends.enter_context(serial.Serial(given, 9600, timeout=10))
        for n in range(4):
            write = bytes((7, 6, 0, n, 0, n))  # its echo reads alike both ways
            write += crc_bytes(write)
            client.write(write)
            assert read_all(far, 8) == write
            write_all(far, write)
            assert client.read(8) == write
            time.sleep(0.05)
        assert frames_of(process) == ["request", "response"] * 4
    capture = captures.open(path)
    ports = {0: 0, 1: 0}
    for block in capture.blocks():
        for port, octets in block.octets_by_port().items():
            ports[port] += octets
    assert ports == {0: 32, 1: 32}
    assert capture.line.notes["directions"] == "request,response"


def test_the_line_goes_on_when_the_analyzer_is_killed():
    with line() as (far, name, _), between(name) as (process, given):
        with serial.Serial(given, 9600, timeout=10) as client:
            for n in range(60):
                asked, answered = request_of(3, n), answer_of(3, n, 1)
                client.write(asked)
                if n == 20:
                    os.kill(process.pid, signal.SIGKILL)  # while bytes pass
                assert read_all(far, len(asked)) == asked
                write_all(far, answered)
                assert client.read(len(answered)) == answered
        end_of_relay(given)


def end_of_relay(given: str) -> None:
    """End the relay that nobody listens to any more: a process of this test's, by its number."""
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            command = (entry / "cmdline").read_bytes()
            masters = [str(each.readlink()) for each in (entry / "fd").iterdir()] if b"live.relay" in command else []
            if given in masters:
                os.kill(int(entry.name), signal.SIGTERM)


def test_settings_of_the_client_reach_the_line_before_its_bytes():
    with line() as (far, name, near), between(name) as (process, given):
        with serial.Serial(given, 19200, stopbits=2, timeout=10) as client:
            client.write(request_of(5, 1))
            assert read_all(far, 8) == request_of(5, 1)
            modes = termios.tcgetattr(near)
            assert modes[4] == termios.B19200
            assert modes[2] & termios.CSTOPB
            client.baudrate = 115200
            client.write(request_of(5, 2))
            assert read_all(far, 8) == request_of(5, 2)
            assert termios.tcgetattr(near)[4] == termios.B115200
        said_until(process, "19200 8N2, as the client sets it", "115200 8N2, as the client sets it")


def test_what_a_client_empties_its_port_of_never_comes():
    with line() as (far, name, _), between(name) as (_, given), serial.Serial(given, 9600, timeout=10) as client:
        write_all(far, b"\x55" * 20_000)  # more than a terminal holds
        time.sleep(0.5)
        client.reset_input_buffer()
        client.write(b"?")
        assert read_all(far, 1) == b"?"
        client.reset_input_buffer()
        write_all(far, b"answer")
        assert client.read(6) == b"answer"


def test_a_port_that_goes_away_is_waited_for(tmp_path):
    link = tmp_path / "port"
    far, near = raw_pty()
    link.symlink_to(os.ttyname(near))
    with between(link) as (process, given), serial.Serial(given, 9600, timeout=10) as client:
        os.close(near)
        os.close(far)
        again, near = raw_pty()
        link.unlink()
        link.symlink_to(os.ttyname(near))
        said_until(process, "is back")
        client.write(b"hello")
        assert read_all(again, 5) == b"hello"
        os.close(again)
        os.close(near)


@pytest.fixture
def server() -> Iterator[int]:
    """A Modbus TCP server of pymodbus; its port."""
    pytest.importorskip("pymodbus")
    from pymodbus.datastore import ModbusDeviceContext, ModbusSequentialDataBlock, ModbusServerContext
    from pymodbus.server import ModbusTcpServer

    block = ModbusSequentialDataBlock(1, list(range(200)))
    context = ModbusServerContext(devices={5: ModbusDeviceContext(hr=block)}, single=False)
    loop = asyncio.new_event_loop()
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
    ready = threading.Event()

    async def serve() -> None:
        serving = ModbusTcpServer(context, address=("127.0.0.1", port))
        await serving.serve_forever(background=True)
        ready.set()
        await stop.wait()
        await serving.shutdown()

    stop = asyncio.Event()
    thread = threading.Thread(target=loop.run_until_complete, args=(serve(),))
    thread.start()
    assert ready.wait(20)
    yield port
    loop.call_soon_threadsafe(stop.set)
    thread.join(20)


def test_clients_of_a_gateway_each_get_their_own_answers(server):
    from pymodbus.client import ModbusTcpClient

    with between("--listen", "0", "--to", f"127.0.0.1:{server}", "--json", "--count", "40") as (process, given):
        host, _, port = given.rpartition(":")
        clients = [ModbusTcpClient(host, port=int(port), timeout=10) for _ in range(2)]
        for client in clients:
            assert client.connect()
        for n in range(10):
            for client, address in zip(clients, (n, 100 + n), strict=True):
                assert client.read_holding_registers(address, count=2, device_id=5).registers == [address, address + 1]
        assert frames_of(process) == ["request", "response"] * 20


def test_a_gateway_that_is_not_there_is_told_and_ends_the_connection():
    with socket.create_server(("127.0.0.1", 0)) as free:
        nowhere = free.getsockname()[1]
    with between("--listen", "0", "--to", f"127.0.0.1:{nowhere}") as (process, given):
        host, _, port = given.rpartition(":")
        with socket.create_connection((host, int(port)), timeout=10) as client:
            client.sendall(b"?")
            assert client.recv(10) == b""
        said_until(process, "refused")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["between"], "no port given"),
        (["between", "x", "--to", "1.2.3.4:502", "--listen", "0"], "no port given"),
        (["between", "--listen", "0", "--to", "127.0.0.1:0"], "neither a port nor HOST:PORT"),
        (["between", "."], ".: not a serial port"),
        (["between", "--listen", "0"], "use --listen and --to together"),
        (["between", "--listen", "0", "--to", "h:1", "--baud", "9600"], "its own line settings"),
        (["between", "/dev/nowhere"], "no such port"),
        (["between", "rfc2217://host:1"], "passed on to serial devices"),
    ],
)
def test_what_cannot_be_passed_on_is_told_in_a_line(capsys, arguments, words):
    assert words in refused(capsys, *arguments)
