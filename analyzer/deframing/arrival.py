"""When reads came: one clock for all ports, whatever each port's own clock says.

Reads come in the order in which they returned. The clock of one port may lie behind that of another, or be set back;
then a read of it seems to come before what was heard already. Rows that were given are never revised, so such a read
counts as come just behind the newest one of any port. Its own times stay what they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from captures.chunks import Block

from .buffer import Times
from .rules import Index


@dataclass(slots=True)
class _PortArrivals:
    """Of a port: its bytes so far, and those stretches of them that came later than their times say."""

    octets: int = 0
    begin: list[int] = field(default_factory=list)  # offset of the first byte in the port's stream
    end: list[int] = field(default_factory=list)
    come_ns: list[int] = field(default_factory=list)

    def late(self, octets: int, come_ns: int) -> None:
        """The next bytes came at a time that is not theirs."""
        if self.end and self.end[-1] == self.octets and self.come_ns[-1] == come_ns:
            self.end[-1] += octets
        else:
            self.begin.append(self.octets)
            self.end.append(self.octets + octets)
            self.come_ns.append(come_ns)

    def come(self, start: Index, heard: Times) -> Times:
        """When the bytes at these offsets came, whose reads' times are `heard`."""
        place = np.searchsorted(self.begin, start, side="right") - 1
        late = (place >= 0) & (start < np.array(self.end)[place])
        return np.where(late, np.array(self.come_ns)[place], heard)

    def forget(self, offset: int) -> None:
        """What lies before this byte is decided."""
        known = int(np.searchsorted(self.end, offset, side="right"))
        del self.begin[:known], self.end[:known], self.come_ns[:known]


@dataclass(slots=True)
class ArrivalClock:
    """When reads came, in ns of the ports' clocks; it never runs back. `now_ns` is None before the first of them."""

    now_ns: int | None = None
    _newest: int = -1  # the port of the newest read
    _ports: dict[int, _PortArrivals] = field(default_factory=dict)

    def feed(self, block: Block) -> None:
        """More reads, at least one."""
        times = block.t_ns
        now = int(times[0]) if self.now_ns is None else self.now_ns
        if int(times[0]) >= now and not (times[1:] < times[:-1]).any():
            for port, octets in block.octets_by_port().items():
                self._of(port).octets += octets
            self.now_ns = int(times[-1])
            self._newest = int(block.port[-1])
            return
        sizes = np.diff(block.offsets).tolist()
        for t_ns, port, octets in zip(times.tolist(), block.port.tolist(), sizes, strict=True):
            mine = self._of(port)
            if t_ns < now:
                now += port != self._newest
                mine.late(octets, now)
            self._newest, now = port, max(now, t_ns)
            mine.octets += octets
        self.now_ns = now

    def passed(self, now_ns: int) -> None:
        """Nothing has come up to then."""
        self.now_ns = now_ns if self.now_ns is None else max(self.now_ns, now_ns)

    def come(self, port: int, start: Index, heard: NDArray[np.int64]) -> NDArray[np.int64]:
        """When the bytes at these offsets of a port came, whose reads' times are `heard`."""
        arrivals = self._of(port)
        return arrivals.come(start, heard) if arrivals.begin else heard

    def came(self, port: int, start: int, heard_ns: int) -> int:
        """The same of one byte."""
        return int(self.come(port, np.array([start]), np.array([heard_ns]))[0])

    def decided(self, port: int, offset: int) -> None:
        """What came on a port before this byte is asked for no more."""
        if (arrivals := self._of(port)).begin:
            arrivals.forget(offset)

    def _of(self, port: int) -> _PortArrivals:
        if port not in self._ports:
            self._ports[port] = _PortArrivals()
        return self._ports[port]
