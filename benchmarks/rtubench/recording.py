"""Records real stacks over ptys: conversations, values, faults, and the logs that programs write.

    python benchmarks/rtubench/recording.py FOLDER      (needs pymodbus, minimalmodbus, modbus-tk, mbpoll, socat ...)

What it wrote is kept in `recorded/`, so that a run of the bench needs none of them and gives the same figures. A relay
between a client's pty and a server's says who sent what, and when; values and addresses are ours.
"""

# ruff: noqa: B023 - a way of asking is called in the turn that made it

from __future__ import annotations

import json
import logging
import os
import select
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from importlib import import_module
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from random import Random
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rtubench.made.plants import KINDS, Kind, Process, truth_of, words

Heard = list[tuple[str, int, bytes]]  # request or response, microseconds, bytes
_UNITS, _SIZE = (3, 17), 130


class Relay:
    """A line of ptys: what clients write reaches the server, what the server writes reaches all clients."""

    def __init__(self, clients: int = 1) -> None:
        pairs = [os.openpty() for _ in range(clients + 1)]
        for pair in pairs:
            for end in pair:
                tty.setraw(end)
        self.names = [os.ttyname(slave) for _, slave in pairs]
        self.ends = [master for master, _ in pairs]
        self.heard: Heard = []
        self.over, self.begin = threading.Event(), time.monotonic_ns()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        server, *clients = self.ends
        while not self.over.is_set():
            for end in select.select(self.ends, [], [], 0.05)[0]:
                data = os.read(end, 4096)
                role = "response" if end == server else "request"
                now = (time.monotonic_ns() - self.begin) // 1000
                if self.heard and self.heard[-1][0] == role and now - self.heard[-1][1] < 2000:
                    self.heard[-1] = role, self.heard[-1][1], self.heard[-1][2] + data
                else:
                    self.heard.append((role, now, data))
                for other in clients if end == server else [server]:
                    os.write(other, data)

    def close(self) -> Heard:
        self.over.set()
        self.thread.join()
        return self.heard


@contextmanager
def server(kind: str, clients: int = 1) -> Iterator[Relay]:
    """A server of a stack at the end of a relay, in a process of its own."""
    relay = Relay(clients)
    process = subprocess.Popen([sys.executable, __file__, "serve", kind, relay.names[0]])
    time.sleep(1.5)
    try:
        yield relay
    finally:
        process.terminate()
        process.wait()
        relay.close()


def serve(kind: str, port: str) -> None:
    """Servers: `pymodbus` and `modbus-tk` hold registers; `slow` answers late, `busy` refuses a third with code 6."""
    memory = [(at * 37) % 1000 for at in range(_SIZE)]
    if kind == "pymodbus":
        from pymodbus.datastore import ModbusDeviceContext, ModbusSequentialDataBlock, ModbusServerContext
        from pymodbus.framer import FramerType
        from pymodbus.server import StartSerialServer

        def block() -> ModbusSequentialDataBlock:
            return ModbusSequentialDataBlock(1, list(memory))

        devices: dict[int, Any] = {
            unit: ModbusDeviceContext(di=block(), co=block(), hr=block(), ir=block()) for unit in _UNITS
        }
        StartSerialServer(ModbusServerContext(devices, single=False), framer=FramerType.RTU, port=port, baudrate=19200)
        return
    tk, rtu, serial = import_module("modbus_tk"), import_module("modbus_tk.modbus_rtu"), import_module("serial")
    random = Random(4)

    def trouble(_: Any) -> None:
        if kind == "slow" and random.random() < 0.4:
            time.sleep(random.uniform(0.12, 0.19))
        if kind == "busy" and random.random() < 0.35:
            raise tk.modbus.ModbusError(6)

    tk.hooks.install_hook("modbus.Slave.handle_request", trouble)
    stack = rtu.RtuServer(serial.Serial(port, 19200))
    for unit in _UNITS:
        slave = stack.add_slave(unit)
        for table in (1, 2, 3, 4):
            slave.add_block(str(table), table, 0, _SIZE)
            slave.set_values(str(table), 0, [value & 1 for value in memory] if table < 3 else memory)
    stack.start()
    while True:
        time.sleep(1)


def minimal(port: str, unit: int, timeout_s: float = 0.3) -> Any:
    """A client of minimalmodbus."""
    made = import_module("minimalmodbus").Instrument(port, unit)
    made.serial.timeout = timeout_s
    return made


def asked_by_minimal(relay: Relay) -> None:
    """Reads and writes of every kind that it has."""
    random = Random(1)
    devices = [minimal(relay.names[1], unit) for unit in _UNITS]
    for turn in range(45):
        device, at = random.choice(devices), random.randrange(60)
        ways: list[Callable[[], object]] = [
            lambda: device.read_registers(at, random.randint(1, 30)),
            lambda: device.read_registers(at, random.randint(1, 12), functioncode=4),
            lambda: device.read_bits(at, random.randint(1, 40), functioncode=1),
            lambda: device.read_float(at), lambda: device.write_register(at, turn, functioncode=6),
            lambda: device.write_registers(at, [turn, 2, 3]), lambda: device.write_bit(at, turn % 2),
        ]  # fmt: skip
        random.choice(ways)()


def asked_by_pymodbus(relay: Relay) -> None:
    """The same by pymodbus, with functions that are rarer, and what is not there."""
    from pymodbus.client import ModbusSerialClient

    random = Random(2)
    client = ModbusSerialClient(relay.names[1], baudrate=19200)
    client.connect()
    for turn in range(45):
        unit, at = random.choice(_UNITS), random.randrange(60)
        ways: list[Callable[[], object]] = [
            lambda: client.read_holding_registers(at, count=random.randint(1, 40), device_id=unit),
            lambda: client.read_input_registers(at, count=2, device_id=unit),
            lambda: client.read_discrete_inputs(at, count=random.randint(1, 60), device_id=unit),
            lambda: client.write_registers(at, [turn, 5], device_id=unit),
            lambda: client.write_coils(at, [True, False, True], device_id=unit),
            lambda: client.mask_write_register(address=at, and_mask=0xF2, or_mask=turn, device_id=unit),
            lambda: client.readwrite_registers(read_address=at, read_count=3, write_address=4, values=[1, turn],
                                               device_id=unit),
            lambda: client.read_holding_registers(500, count=2, device_id=unit),
        ]  # fmt: skip
        random.choice(ways)()
    client.close()


def asked_by_mbpoll(relay: Relay, times: int = 30) -> str:
    """The same by mbpoll, a process a request; what it prints."""
    random, said = Random(3), []
    for turn in range(times):
        table = random.choice(("4", "4", "3", "1", "0"))
        write = table in ("0", "4") and random.random() < 0.3
        command = ["mbpoll", "-m", "rtu", "-a", str(random.choice(_UNITS)), "-b", "19200", "-P", "none", "-t", table,
                   "-r", str(random.randint(1, 50)), "-o", "0.5", "-v", "-q"]  # fmt: skip
        command += [] if write else ["-1", "-c", str(random.randint(1, 20))]
        values = [str(turn % (2 if table == "0" else 99))] if write else []
        said.append(subprocess.run([*command, relay.names[1], *values], capture_output=True, text=True).stdout)
    return "".join(said)


def conversations() -> Iterator[dict[str, Any]]:
    """Everyday traffic of three pairs of stacks."""
    for kind, asked, client in (("pymodbus", asked_by_mbpoll, "mbpoll (libmodbus)"),
                                ("modbus-tk", asked_by_minimal, f"minimalmodbus {version('minimalmodbus')}"),
                                ("pymodbus", asked_by_pymodbus, f"pymodbus {version('pymodbus')}")):  # fmt: skip
        with server(kind) as relay:
            asked(relay)
        yield told(client.split()[0], client, f"{kind} {version(kind.replace('-', '_'))}", relay.heard)


def told(name: str, client: str, stack: str, heard: Heard, **more: Any) -> dict[str, Any]:
    """A recording as it is kept."""
    rows = [[role, micros, data.hex()] for role, micros, data in heard]
    return {"name": name, "client": client, "server": stack, **more, "sent": rows}


def faults() -> Iterator[dict[str, Any]]:
    """Faults that stacks make by themselves, and two lines without any."""
    client = f"minimalmodbus {version('minimalmodbus')}"

    def poll(relay: Relay, units: tuple[int, ...], addresses: tuple[int, ...], turns: int, timeout_s: float = 0.3,
             port: int = 1) -> None:  # fmt: skip
        for _ in range(turns):
            for unit in units:
                for at in addresses:
                    try:
                        minimal(relay.names[port], unit, timeout_s).read_registers(at, 6)
                    except Exception:  # the very fault that is recorded
                        continue
                    time.sleep(0.02)

    plans: list[tuple[str, str, list[int], str, Callable[[Relay], None]]] = [
        ("unit-silent", "modbus-tk", [9], "", lambda relay: poll(relay, (3, 9, 17), (0, 40), 25, 0.15)),
        ("missing-registers", "pymodbus", [3, 17], "", lambda relay: poll(relay, (3, 17), (0, 40, 300), 25)),
        ("timeout-too-short", "slow", [], "", lambda relay: poll(relay, (3, 17), (0, 40, 80), 30, 0.1)),
        ("unit-busy", "busy", [3, 17], "", lambda relay: poll(relay, (3, 17), (0, 40), 40)),
        ("healthy", "pymodbus", [], "", lambda relay: poll(relay, (3, 17), (0, 20, 40), 25)),
        ("healthy", "modbus-tk", [], "", lambda relay: poll(relay, (3, 17), (7, 50), 35)),
    ]
    for at, (name, kind, units, _, run) in enumerate(plans):
        with server(kind) as relay:
            run(relay)
        stack = kind if kind == "pymodbus" else "modbus-tk"
        causes = [] if name == "healthy" else [name]
        yield told(f"stack-{name}-{at}", client, f"{stack} {version(stack.replace('-', '_'))}", relay.heard,
                   causes=causes, units=units)  # fmt: skip
    with server("modbus-tk", clients=2) as relay:
        other = threading.Thread(target=poll, args=(relay, (3, 17), (10,), 60), kwargs={"port": 2})
        other.start()
        poll(relay, (3, 17), (0, 40), 40)
        other.join()
    yield told("stack-two-clients", client, "modbus-tk", relay.heard, causes=["two-clients"], units=[])


def values() -> Iterator[dict[str, Any]]:
    """Devices of pymodbus with values in its own encoding, written and read by minimalmodbus; the reads are kept."""
    from pymodbus.client.mixin import ModbusClientMixin

    names = {"u16": "UINT16", "i16": "INT16", "u32": "UINT32", "i32": "INT32", "f32": "FLOAT32"}
    for number, order in enumerate(("big", "little", "big", "little")):
        random = Random(f"stack values {number}")
        unit, at, layout = _UNITS[number % 2], 0, list[tuple[int, Kind, Process]]()
        while at < 36:
            kind = random.choice(KINDS)
            layout.append((at, kind, kind.process(random, random.choice(kind.scales))))
            at += len(words(kind.type, 0, order))
        shown: dict[int, list[tuple[int, ...]]] = {place: [] for place, _, _ in layout}
        with server("pymodbus") as relay:
            client = minimal(relay.names[1], unit)
            for turn in range(110):
                registers: list[int] = []
                for place, kind, process in layout:
                    value = process(turn)
                    number_ = value if kind.type == "f32" else round(value)
                    written = ModbusClientMixin.convert_to_registers(
                        number_,
                        ModbusClientMixin.DATATYPE[names[kind.type]],
                        word_order=order,  # type: ignore[arg-type]
                    )
                    shown[place].append(tuple(written))
                    registers += written
                client.write_registers(0, registers)
                client.read_registers(0, len(registers))
        reads = [one for pair in zip(relay.heard[2::4], relay.heard[3::4], strict=True) for one in pair]
        truth = [truth_of(unit, 3, place, kind.type, order, shown[place]) for place, kind, _ in layout]
        yield told(f"stack-values-{number}", "minimalmodbus", f"pymodbus {version('pymodbus')}", reads, values=truth)


def texts(folder: Path) -> Iterator[dict[str, Any]]:
    """What programs print of the same traffic: logs of stacks, dumps of tools."""
    folder.mkdir(exist_ok=True)

    def kept(name: str, by: str, text: str, heard: Heard) -> dict[str, Any]:
        """A text with the frames that it shows."""
        (folder / f"{name}.txt").write_text(text)
        shown = [one for one in heard if one[0] == "response" or name != "pymodbus"]  # which logs no requests
        return {"name": name, "by": by, "frames": [{"hex": data.hex(), "direction": role} for role, _, data in shown]}

    with server("modbus-tk") as relay:
        said = asked_by_mbpoll(relay, 4)
    yield kept("mbpoll", "mbpoll -v", said, relay.heard)
    with server("modbus-tk") as relay, redirect_stdout(StringIO()) as out:
        device = minimal(relay.names[1], 17)
        device.debug = True
        device.read_registers(2, 4)
        device.write_register(5, 77, functioncode=6)
        device.read_float(8)
    yield kept("minimalmodbus", "minimalmodbus, debug", out.getvalue(), relay.heard)
    stream = StringIO()
    handler = logging.StreamHandler(stream)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)-5s %(module)-15s:%(lineno)-4s %(message)s"))
    for name, ask in (("pymodbus", _some_by_pymodbus), ("modbus-tk", _some_by_tk)):
        logger = logging.getLogger({"pymodbus": "pymodbus.logging", "modbus-tk": "modbus_tk"}[name])
        logger.addHandler(handler)
        logger.setLevel(logging.DEBUG)
        stream.seek(0)
        stream.truncate()
        with server("modbus-tk") as relay:
            ask(relay)
        yield kept(
            name, f"{name} {version(name.replace('-', '_'))}, log at debug level", stream.getvalue(), relay.heard
        )
    data = b"".join(data for _, _, data in relay.heard)
    (folder / "bytes.bin").write_bytes(data)
    dumps = {"xxd": "xxd bytes.bin", "hexdump": "hexdump -C bytes.bin", "od": "od -A x -t x1 bytes.bin",
             "python": f"{sys.executable} -c 'print(open(\"bytes.bin\", \"rb\").read())'"}  # fmt: skip
    for name, command in dumps.items():
        done = subprocess.run(command, shell=True, cwd=folder, capture_output=True, text=True, check=True)
        yield kept(name, name, done.stdout, relay.heard)
    (folder / "bytes.bin").unlink()


def _some_by_pymodbus(relay: Relay) -> None:
    from pymodbus.client import ModbusSerialClient

    client = ModbusSerialClient(relay.names[1], baudrate=19200)
    client.connect()
    client.read_holding_registers(4, count=3, device_id=3)
    client.write_register(6, 1234, device_id=3)
    client.read_coils(0, count=9, device_id=17)
    client.close()


def _some_by_tk(relay: Relay) -> None:
    rtu, serial = import_module("modbus_tk.modbus_rtu"), import_module("serial")
    client = rtu.RtuMaster(serial.Serial(relay.names[1], 19200))
    client.set_timeout(1.0)
    client.set_verbose(True)
    client.execute(17, 3, 10, 5)
    client.execute(3, 16, 20, output_value=[7, 8, 9])
    client.execute(3, 4, 1, 2)


def main(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name, rows in (("conversations", conversations()), ("faults", faults()), ("values", values()),
                       ("texts", texts(folder / "texts"))):  # fmt: skip
        (folder / f"{name}.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        serve(*sys.argv[2:])
    else:
        main(Path(sys.argv[1]))
