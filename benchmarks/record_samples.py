"""Records the captures in `captures/samples`: real Modbus stacks that talk over pseudo-terminals (POSIX only).

    python benchmarks/record_samples.py [FOLDER]

A pymodbus server with three units answers a pymodbus client, then mbpoll (libmodbus), if that is installed. Between
them sits a middleman with a pseudo-terminal to each side: it passes bytes on at the pace of 19200 bit/s, 8N1, one side
at a time as on a two-wire bus, and keeps what a tap with an 8-byte FIFO would have seen, with the time of each read.
For the troubled sample it also does to bytes what bad wiring does.

Needs pymodbus and pyserial (`pip install rtuscope[test]`). Each run makes other times, never other requests.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import os
import random
import select
import shutil
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import pymodbus
from pymodbus import FramerType, ModbusDeviceIdentification
from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusException
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

import captures
from captures import Chunk, LineSettings

BAUD = 19200
CHARACTER_S = 10 / BAUD  # 8N1
FIFO_BYTES = 8
UNITS = (1, 2, 17)
ABSENT_UNIT = 9
TIMEOUT_S = 0.25


@dataclass
class Bus:
    """The middleman: two pseudo-terminals, and a tap between them."""

    faults: random.Random | None = None
    chunks: list[Chunk] = field(default_factory=list)
    _stop: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self._sides = [os.openpty(), os.openpty()]
        for master, slave in self._sides:
            tty.setraw(slave)
            os.set_blocking(master, False)
        self.client_port, self.server_port = (os.ttyname(slave) for _, slave in self._sides)
        self._anchor = time.time_ns() - time.monotonic_ns()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        for pair in self._sides:
            for descriptor in pair:
                os.close(descriptor)

    def _run(self) -> None:
        client, server = (master for master, _ in self._sides)
        while not self._stop.is_set():
            ready, _, _ = select.select([client, server], [], [], 0.05)
            for source in ready:
                target = server if source == client else client
                data = os.read(source, 4096)
                if self.faults is not None:
                    data = self._spoilt(self.faults, data, is_answer=source == server)
                self._pass_on(data, target)

    def _pass_on(self, data: bytes, target: int) -> None:
        due = time.monotonic()
        held = bytearray()
        for i, byte in enumerate(data):
            due += CHARACTER_S
            while (left := due - time.monotonic()) > 0:
                time.sleep(left)
            os.write(target, bytes((byte,)))
            held.append(byte)
            if len(held) == FIFO_BYTES or i == len(data) - 1:
                self.chunks.append(Chunk(self._anchor + time.monotonic_ns(), bytes(held)))
                held.clear()

    def _spoilt(self, chance: random.Random, data: bytes, *, is_answer: bool) -> bytes:
        """What a bad bus makes of a frame: mostly nothing."""
        fate = chance.random()
        at = chance.randrange(len(data))
        if fate < 0.06:
            return data[:at] + bytes((data[at] ^ 1 << chance.randrange(8),)) + data[at + 1 :]
        if fate < 0.09:
            return data[:at] + data[at + 1 :]
        if fate < 0.13:
            return b"\x00" + data
        if fate < 0.17:
            return data + b"\x00" * chance.randint(1, 2)
        if fate < 0.19 and is_answer:
            return data[: max(at, 2)]
        if fate < 0.23 and is_answer:
            time.sleep(TIMEOUT_S * 1.1)  # later than the client waits
        return data


def devices() -> list[SimDevice]:
    """The units: coils, discrete inputs, holding and input registers, 200 of each from address 0."""
    chance = random.Random(19200)
    units = []
    for unit in UNITS:
        bits = [[chance.random() < 0.4 for _ in range(200)] for _ in range(2)]
        registers = [[chance.randrange(0, 4000) for _ in range(200)] for _ in range(2)]
        units.append(
            SimDevice(
                unit,
                simdata=(
                    [SimData(0, values=bits[0], datatype=DataType.BITS)],
                    [SimData(0, values=bits[1], datatype=DataType.BITS)],
                    [SimData(0, values=registers[0], datatype=DataType.REGISTERS)],
                    [SimData(0, values=registers[1], datatype=DataType.REGISTERS)],
                ),
            )
        )
    return units


@contextmanager
def serving(bus: Bus) -> Iterator[None]:
    """A pymodbus server on the bus, in a thread of its own."""
    identity = ModbusDeviceIdentification(
        info_name={"VendorName": "Example Works", "ProductCode": "EW-3", "MajorMinorRevision": "2.10"}
    )
    loop = asyncio.new_event_loop()
    started = threading.Event()

    async def run() -> None:
        server = ModbusSerialServer(
            devices(),
            framer=FramerType.RTU,
            identity=identity,
            port=bus.server_port,
            baudrate=BAUD,
            ignore_missing_devices=True,
        )
        await server.serve_forever(background=True)
        started.set()
        while not finished.is_set():
            await asyncio.sleep(0.02)
        await server.shutdown()

    finished = threading.Event()
    thread = threading.Thread(target=lambda: loop.run_until_complete(run()))
    thread.start()
    started.wait(5)
    try:
        yield
    finally:
        finished.set()
        thread.join()


def talk(port: str, rounds: int, *, trouble: bool) -> None:
    """A client's polling rounds: readings of every kind, now and then a write; in trouble also bad requests."""
    client = ModbusSerialClient(port, baudrate=BAUD, timeout=TIMEOUT_S, retries=1)
    client.connect()
    chance = random.Random(7)
    for number in range(rounds):
        for unit in UNITS:
            calls: list[Callable[[], object]] = [
                partial(client.read_holding_registers, 107, count=3, device_id=unit),
                partial(client.read_input_registers, 8, count=chance.choice((1, 10)), device_id=unit),
            ]
            extra = [
                lambda u=unit: client.read_coils(19, count=37, device_id=u),
                lambda u=unit: client.read_discrete_inputs(100, count=22, device_id=u),
                lambda u=unit: client.write_coil(172, chance.random() < 0.5, device_id=u),
                lambda u=unit: client.write_register(1, chance.randrange(1000), device_id=u),
                lambda u=unit: client.write_coils(19, [True, False, True, True, False] * 2, device_id=u),
                lambda u=unit: client.write_registers(1, [10, 258], device_id=u),
                lambda u=unit: client.mask_write_register(address=4, and_mask=0xF2, or_mask=0x25, device_id=u),
                lambda u=unit: client.readwrite_registers(
                    read_address=3, read_count=6, write_address=14, values=[255, 255, 255], device_id=u
                ),
                lambda u=unit: client.read_device_information(read_code=1, object_id=0, device_id=u),
            ]
            calls.append(extra[(number * len(UNITS) + UNITS.index(unit)) % len(extra)])
            if trouble and unit == 2:
                calls.append(partial(client.read_holding_registers, 195, count=10, device_id=unit))
            for call in calls:
                attempt(client, call)
                time.sleep(0.004)
        if trouble and number % 2:
            attempt(client, lambda: client.read_holding_registers(0, count=2, device_id=ABSENT_UNIT))
        time.sleep(0.05)
    client.close()


def attempt(client: ModbusSerialClient, call: Callable[[], object]) -> None:
    """One request; that it may fail is what the troubled sample is for."""
    try:
        call()
    except ModbusException:
        if not client.connected:  # closed after a few failures
            client.connect()


def mbpoll(port: str) -> None:
    """mbpoll reads all kinds of tables and writes two registers."""
    common = ["mbpoll", "-m", "rtu", "-b", str(BAUD), "-P", "none", "-o", "0.5", "-0"]
    for arguments in (
        ["-a", "1,2,17", "-t", "4", "-r", "107", "-c", "4", "-1", port],
        ["-a", "1", "-t", "3", "-r", "8", "-c", "10", "-1", port],
        ["-a", "2", "-t", "0", "-r", "19", "-c", "16", "-1", port],
        ["-a", "17", "-t", "1", "-r", "100", "-c", "8", "-1", port],
        ["-a", "17", "-t", "4", "-r", "50", port, "1234", "5678"],
        ["-a", "17", "-t", "4:float", "-r", "50", "-c", "2", "-1", port],
        ["-a", "1", "-t", "4", "-r", "198", "-c", "5", "-1", port],
    ):
        ran = subprocess.run([*common, *arguments], capture_output=True, text=True, timeout=30, check=False)
        if ran.returncode:
            print("  mbpoll:", " ".join(ran.stderr.split()), file=sys.stderr)


def record(path: Path, source: str, talking: Callable[[str], None], faults: random.Random | None = None) -> None:
    """One sample: a fresh bus and server, what `talking` does on its port, written to `path`."""
    bus = Bus(faults)
    with serving(bus):
        talking(bus.client_port)
        time.sleep(0.3)
    bus.close()
    line = LineSettings(baud=BAUD, char_bits=10, parity="N", stop_bits=1, tap="irq", notes={"source": source})
    captures.write(path, bus.chunks, line=line)
    print(f"{path}: {len(bus.chunks)} reads, {path.stat().st_size} bytes on disk")


def main() -> None:
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=Path(captures.__file__).parent / "samples")
    folder = parser.parse_args().folder
    stacks = f"pymodbus {pymodbus.__version__}"
    how = "over ptys, bytes passed on at 19200 bit/s 8N1, read through an 8-byte FIFO (benchmarks/record_samples.py)"
    record(folder / "healthy.jsonl", f"{stacks} client and server {how}", lambda port: talk(port, 9, trouble=False))
    record(
        folder / "troubled.jsonl",
        f"{stacks} client and server {how}, with bits flipped, bytes lost and added, answers cut and late on the way",
        lambda port: talk(port, 7, trouble=True),
        random.Random(5),
    )
    if shutil.which("mbpoll"):
        record(folder / "mbpoll.mcap", f"mbpoll (libmodbus) and a {stacks} server {how}", mbpoll)


if __name__ == "__main__":
    main()
