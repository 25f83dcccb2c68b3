"""How much later a byte arrives because `between` stands in the way (POSIX only).

    python benchmarks/between_delay.py [--exchanges N] [--pause-ms MS]

A request of eight bytes goes from a client's port to a device's, an answer of 25 comes back, at the pace of a bus. Each
way is timed from before the write to after the read, by one process that waits for it: on a pseudo-terminal, or a
connection, alone, and with the relay between, in turn. The analyzer's side takes what the relay tells, as `between`
does. What the relay adds is the difference of the quantiles. On a busy machine the figures are of its scheduler: the
load average stands beside them.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import select
import socket
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator, Sequence
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


Pair = tuple[int, int]  # a client's descriptor and a device's
Times = list[NDArray[np.float64]]


def exchanges(pairs: Sequence[Pair], count: int, pause_s: float) -> Times:
    """The times of so many requests and answers, one way each; the pairs take turns, so that what else the machine does
    meets them alike."""
    times: list[list[float]] = [[] for _ in pairs]
    for _ in range(count):
        for (client, device), mine in zip(pairs, times, strict=True):
            time.sleep(pause_s)
            mine.append(timed(client, device, _REQUEST))
            time.sleep(pause_s / 4)
            mine.append(timed(device, client, _ANSWER))
    return [np.array(each[20:]) for each in times]


def on_terminals(measure: Callable[[Sequence[Pair]], Times]) -> Times:
    """Alone, and with the relay between."""
    with contextlib.ExitStack() as ends:
        alone, far = (_terminal(ends) for _ in range(2))
        with taken(Relaying(PortSettings(os.ttyname(far[0]), 115_200))) as relay:
            client = os.open(relay.given, os.O_RDWR | os.O_NOCTTY)
            times = measure((alone, (client, far[1])))
            os.close(client)
    return times


def _terminal(ends: contextlib.ExitStack) -> Pair:
    far, near = os.openpty()
    tty.setraw(near)
    for each in (far, near):
        ends.callback(os.close, each)
    return near, far


@contextlib.contextmanager
def taken(relaying: Relaying) -> Iterator[Relaying]:
    """A relay of which all that it tells is taken, as `between` does."""
    with relaying as relay:
        threading.Thread(target=lambda: [None for _ in relay.items()], daemon=True).start()
        yield relay
        relay.close()


def on_sockets(measure: Callable[[Sequence[Pair]], Times]) -> Times:
    """The same of Modbus TCP."""
    with contextlib.ExitStack() as ends:
        server = ends.enter_context(socket.create_server(("127.0.0.1", 0)))
        address = server.getsockname()[:2]
        relay = ends.enter_context(taken(Relaying(listen=("127.0.0.1", 0), to=address)))
        host, _, port = relay.given.rpartition(":")
        pairs = []
        for to in (address, (host, int(port))):
            client = ends.enter_context(socket.create_connection(to))
            device = ends.enter_context(server.accept()[0])
            for each in (client, device):
                each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            pairs.append((client.fileno(), device.fileno()))
        return measure(pairs)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--exchanges", type=int, default=1500)
    parser.add_argument("--pause-ms", type=float, default=4.0)
    given = parser.parse_args()
    print(f"load average {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    for name, ways in (("terminal", on_terminals), ("TCP", on_sockets)):
        alone, between = ways(lambda pairs: exchanges(pairs, given.exchanges, given.pause_ms / 1e3))
        rows = [1e6 * np.percentile(each, [50, 90, 99, 99.9]) for each in (alone, between)]
        for words, row in (("alone", rows[0]), ("through between", rows[1]), ("added", rows[1] - rows[0])):
            figures = ", ".join(f"{q} {us:.0f} us" for q, us in zip(("p50", "p90", "p99", "p99.9"), row, strict=True))
            print(f"{name:<9} {words:<16} {figures}")


if __name__ == "__main__":
    main()
