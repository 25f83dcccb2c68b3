"""How much later a byte arrives because `between` stands in the way (POSIX only).

    python benchmarks/between_delay.py [--exchanges N] [--pause-ms MS]

A request of eight bytes goes from a client's port to a device's, an answer of 25 comes back, at the pace of a bus. Each
way is timed from before the write to after the read, by one process that waits for it: first on a pseudo-terminal, or a
connection, alone, then with the relay between. The analyzer's side takes what the relay tells, as `between` does. What
the relay adds is the difference of the quantiles. On a busy machine the figures are of its scheduler: the load average
stands beside them.
"""

from __future__ import annotations

import argparse
import os
import select
import socket
import sys
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

if str(Path(__file__).parents[1]) not in sys.path:
    sys.path.insert(0, str(Path(__file__).parents[1]))

from captures.live.relaying import Relaying
from captures.live.settings import PortSettings
from dissectors.crc import crc_bytes

_REQUEST = b"\x11\x03\x00\x6b\x00\x0a" + crc_bytes(b"\x11\x03\x00\x6b\x00\x0a")
_ANSWER = b"\x11\x03\x14" + bytes(20) + crc_bytes(b"\x11\x03\x14" + bytes(20))
_PATIENCE_S = 10


def timed(sender: int, receiver: int, data: bytes) -> float:
    """Seconds from before the write until all of it is read."""
    begun = time.perf_counter()
    os.write(sender, data)
    left = len(data)
    while left:
        ready, _, _ = select.select([receiver], [], [], _PATIENCE_S)
        if not ready:
            raise TimeoutError("bytes that do not come")
        left -= len(os.read(receiver, left))
    return time.perf_counter() - begun


def exchanges(client: int, device: int, count: int, pause_s: float) -> NDArray[np.float64]:
    """The times of so many requests and answers, one way each."""
    times = []
    for _ in range(count):
        time.sleep(pause_s)
        times.append(timed(client, device, _REQUEST))
        time.sleep(pause_s / 4)
        times.append(timed(device, client, _ANSWER))
    return np.array(times[20:])


def on_terminals(measure: Callable[[int, int], NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Alone, and with the relay between."""
    device, slave = os.openpty()
    tty.setraw(slave)
    alone = measure(slave, device)
    with Relaying(PortSettings(os.ttyname(slave), 115_200)) as relay:
        taking = threading.Thread(target=lambda: [None for _ in relay.items()], daemon=True)
        taking.start()
        client = os.open(relay.given, os.O_RDWR | os.O_NOCTTY)
        between = measure(client, device)
        os.close(client)
        relay.close()
    os.close(device)
    os.close(slave)
    return alone, between


def on_sockets(measure: Callable[[int, int], NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same of Modbus TCP."""
    server = socket.create_server(("127.0.0.1", 0))
    address = server.getsockname()[:2]
    client = socket.create_connection(address)
    device, _ = server.accept()
    for each in (client, device):
        each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    alone = measure(client.fileno(), device.fileno())
    with Relaying(listen=("127.0.0.1", 0), to=address) as relay:
        taking = threading.Thread(target=lambda: [None for _ in relay.items()], daemon=True)
        taking.start()
        host, _, port = relay.given.rpartition(":")
        client = socket.create_connection((host, int(port)))
        device, _ = server.accept()
        for each in (client, device):
            each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        between = measure(client.fileno(), device.fileno())
        client.close()
        relay.close()
    return alone, between


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--exchanges", type=int, default=1500)
    parser.add_argument("--pause-ms", type=float, default=4.0)
    given = parser.parse_args()
    print(f"load average {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    for name, ways in (("terminal", on_terminals), ("TCP", on_sockets)):
        alone, between = ways(lambda a, b: exchanges(a, b, given.exchanges, given.pause_ms / 1e3))
        rows = [1e6 * np.percentile(each, [50, 90, 99, 99.9]) for each in (alone, between)]
        for words, row in (("alone", rows[0]), ("through between", rows[1]), ("added", rows[1] - rows[0])):
            figures = ", ".join(f"{q} {us:.0f} us" for q, us in zip(("p50", "p90", "p99", "p99.9"), row, strict=True))
            print(f"{name:<9} {words:<16} {figures}")


if __name__ == "__main__":
    main()
