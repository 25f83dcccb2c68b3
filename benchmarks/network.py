"""What a network capture costs in which one connection of many speaks Modbus TCP: CPU seconds, start-up included.

    python benchmarks/network.py [--megabytes N] [--connections N] [--seed N]

The capture is made here: EtherNet/IP, S7 and OPC UA as they look on the wire, and one client of Modbus TCP.
"""

from __future__ import annotations

import argparse
import struct
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import BinaryIO

sys.path.insert(0, str(Path(__file__).parent))

from measuring import RTUSCOPE, run

Exchange = Callable[[Random, int], tuple[bytes, bytes]]
_FILE_HEAD = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
_COMMANDS = ("info", "report", "export")
_ROUNDS = 3


def ethernet_ip(random: Random, number: int) -> tuple[bytes, bytes]:
    """SendUnitData, there and back."""
    item = random.randbytes(random.randrange(20, 200))
    body = struct.pack("<IHHHHHH", 0, 10, 2, 0, 0, 0xB2, len(item)) + item
    answer = body + random.randbytes(40)
    asked, answered = (struct.pack("<HHIIQI", 0x6F, len(each), 7, 0, number, 0) + each for each in (body, answer))
    return asked, answered


def s7(random: Random, number: int) -> tuple[bytes, bytes]:
    """Read Var of a data block, over ISO on TCP."""
    item = bytes((4, 1, 0x12, 10, 16, 2, 0, 64, 0, 1, 0x84, 0, 0, 0))
    data = random.randbytes(64)
    job = struct.pack(">BBHHHH", 0x32, 1, 0, number & 0xFFFF, len(item), 0) + item
    done = struct.pack(">BBHHHHBB", 0x32, 3, 0, number & 0xFFFF, 2, 4 + len(data), 0, 0)
    asked, answered = (
        struct.pack(">BBH", 3, 0, len(each) + 7) + bytes((2, 0xF0, 0x80)) + each
        for each in (job, done + bytes((4, 1, 0xFF, 4, 2, 0)) + data)
    )
    return asked, answered


def opc_ua(random: Random, number: int) -> tuple[bytes, bytes]:
    """Messages of a secure channel."""
    asked, answered = (
        b"MSGF" + struct.pack("<IIIII", 24 + size, 1, 1, number, number) + random.randbytes(size)
        for size in (90, random.randrange(100, 900))
    )
    return asked, answered


def modbus(random: Random, number: int) -> tuple[bytes, bytes]:
    """Read Holding Registers."""
    quantity = random.choice((2, 10, 40))
    asked = struct.pack(">HHHBBHH", number & 0xFFFF, 0, 6, 1, 3, 100 * quantity, quantity)
    data = random.randbytes(2 * quantity)
    return asked, struct.pack(">HHHBBB", number & 0xFFFF, 0, 3 + len(data), 1, 3, len(data)) + data


OTHERS: tuple[tuple[int, Exchange], ...] = ((44818, ethernet_ip), (102, s7), (4840, opc_ua))


@dataclass(slots=True)
class Connection:
    """A client and its server, by address and port, and how far each has sent."""

    ends: tuple[tuple[bytes, int], tuple[bytes, int]]
    exchange: Exchange
    sent: list[int]
    exchanges: int = 0

    def packet(self, side: int, data: bytes) -> bytes:
        """An Ethernet frame of one side."""
        (source, port), (target, target_port) = self.ends[side], self.ends[1 - side]
        ip = struct.pack(">BBHHHBBH", 0x45, 0, 40 + len(data), 0, 0, 64, 6, 0) + source + target
        numbers = self.sent[side], self.sent[1 - side]
        tcp = struct.pack(">HHIIBBHHH", port, target_port, *numbers, 0x50, 0x18, 65000, 0, 0)
        self.sent[side] = self.sent[side] + len(data) & 0xFFFFFFFF
        return bytes(12) + b"\x08\x00" + ip + tcp + data


def write(file: BinaryIO, size: int, connections: int, seed: int) -> None:
    """A pcap of so many bytes; one connection of all is Modbus TCP."""
    random = Random(seed)
    kinds = [OTHERS[i % len(OTHERS)] for i in range(connections - 1)] + [(502, modbus)]
    lines = []
    for port, exchange in kinds:
        client, server = (bytes((10, 0, net, random.randrange(2, 250))) for net in (0, 1))
        ends = (client, random.randrange(40000, 60000)), (server, port)
        lines.append(Connection(ends, exchange, [random.getrandbits(32), random.getrandbits(32)]))
    file.write(_FILE_HEAD)
    written, t_us = len(_FILE_HEAD), 1_760_000_000_000_000
    while written < size:
        line = random.choice(lines)
        for side, data in enumerate(line.exchange(random, line.exchanges)):
            t_us += random.randrange(2000)
            packet = line.packet(side, data)
            file.write(struct.pack("<IIII", *divmod(t_us, 1_000_000), len(packet), len(packet)) + packet)
            written += 16 + len(packet)
        line.exchanges += 1


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--megabytes", type=float, default=2.0)
    parser.add_argument("--connections", type=int, default=33)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        path = folder / "network.pcap"
        with path.open("wb") as file:
            write(file, round(given.megabytes * 1e6), given.connections, given.seed)
        for command in _COMMANDS:
            more = ("-o", folder / "frames.jsonl", "--overwrite") if command == "export" else ()
            used = [run((*RTUSCOPE, command, path, *more), folder) for _ in range(_ROUNDS)]
            print(f"{command}: {min(one.cpu for one in used):.2f} CPU s, {max(one.peak for one in used):.0f} MiB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
