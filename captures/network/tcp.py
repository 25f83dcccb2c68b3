"""TCP connections put together: each direction's bytes in order and once, whatever the capture holds of them.

A segment that was sent again or captured twice counts once. One that came early waits for what is missing before it;
where the other side acknowledges bytes that the capture does not have, they are given up and counted: at once where it
did so before. The time of bytes is that of the packet that made them readable.

Datagrams of UDP need none of this: they are given as they come, a client and a server's port being one connection.

Connections between the same client and server share a port as long as one is closed before the next begins; those that
overlap have a lane each.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from heapq import heappop, heappush
from ipaddress import IPv6Address
from typing import Final, Protocol

import numpy as np

from ..chunks import Mark
from .packets import KEY, UDP, Ints, Segments

_MASK: Final = (1 << 32) - 1
_HALF: Final = 1 << 31
_FIN, _SYN, _RST, _ACK = 1, 2, 4, 16
_SPECIAL: Final = _FIN | _SYN | _RST
_ENDS: Final = 1  # that a FIN takes of the sequence numbers
_RUN: Final = 8  # segments that are worth arrays
_WAITING: Final = 64  # segments that wait for a missing one, at most
_HALVES: Final = 1 << 16  # directions that are remembered; of more, the closed and the oldest go
_GROUPS: Final = 1 << 14
_MODBUS_PORT: Final = 502
_WELL_KNOWN: Final = 1024

_FACTORS: Final = np.random.default_rng().integers(1, 1 << 63, KEY // 4, np.uint64) | np.uint64(1)  # of a hash


@dataclass(slots=True)
class ConnectionGroup:
    """All connections between one client and one server's port. `lanes` is how many of them were open at once."""

    key: bytes  # of the client's segments
    number: int
    lanes: int = 0
    free: list[int] = field(default_factory=list)  # a heap of the lanes that nobody uses
    missing: int = 0  # bytes that the capture lacks

    @property
    def name(self) -> str:
        """Client, server and its port, as people write them."""
        if not self.key:
            return "many others"
        client, server = (IPv6Address(self.key[at : at + 16]) for at in (0, 16))
        end = f"{server.ipv4_mapped or f'[{server}]'}:{self.server_port}"
        return f"{client.ipv4_mapped or client} > {end}" + (" (UDP)" if self.of_datagrams else "")

    @property
    def server_port(self) -> int:
        """The port that the client connected to; 0 for many others."""
        return int.from_bytes(self.key[34:36], "big")

    @property
    def of_datagrams(self) -> bool:
        """Whether it is of UDP."""
        return self.key[-1:] == bytes((UDP,))


@dataclass(slots=True, eq=False)
class Connection:
    """One connection, whose place among those of its group is `lane`."""

    group: ConnectionGroup
    lane: int
    closed: bool = False

    def close(self) -> None:
        """It is over: another may have its lane."""
        if not self.closed:
            self.closed = True
            heappush(self.group.free, self.lane)


@dataclass(slots=True, eq=False)
class Half:
    """One direction of a connection: the sequence number that comes next, and what came before its turn."""

    connection: Connection
    mark: Mark
    other: Half = field(init=False)
    following: int | None = None
    in_step: bool = False  # whether it is known where what it carries begins: from a SYN on, until bytes are missing
    acknowledged: int | None = None  # the sequence number up to which the other side has said to have all
    waiting: dict[int, bytes] = field(default_factory=dict)
    run: list[int] = field(default_factory=list)  # segments in turn that nobody was given yet
    port: int = -1  # for the one who takes the bytes: where they go
    rest: bytes = b""  # what it keeps back of them,
    heard_ns: int = 0  # and when it heard the last

    @property
    def group(self) -> ConnectionGroup:
        return self.connection.group


class Taker(Protocol):
    """Who takes what connections carry. Segments are named by their number among those fed last; -1: none led to it."""

    def run(self, half: Half, which: Ints) -> None:
        """The bytes of these segments, in order."""

    def piece(self, half: Half, i: int, begin: int, size: int) -> None:
        """Bytes of one segment, which lie in the data."""

    def late(self, half: Half, i: int, octets: bytes) -> None:
        """Bytes of an earlier segment, which this one let through."""

    def hole(self, half: Half, i: int, missing: int) -> None:
        """Here bytes are missing: the capture lacks a segment, or the end of this one, whose bytes were given."""

    def ended(self, half: Half) -> None:
        """No more comes of this direction."""


class Reassembly:
    """Segments in, bytes in order out. Directions in which nothing is out of turn are taken as arrays."""

    def __init__(self, taker: Taker) -> None:
        self.groups: list[ConnectionGroup] = []
        self._taker = taker
        self._halves: dict[bytes, Half] = {}
        self._by_ends: dict[bytes, ConnectionGroup] = {}

    def feed(self, segments: Segments, data: bytes) -> None:
        """Take segments, whose bytes lie in `data`."""
        if not len(segments.packet):
            return
        words = segments.key.view(np.uint32).astype(np.uint64)
        hashes = (words * _FACTORS).sum(axis=1, dtype=np.uint64)
        _, firsts, alike = np.unique(hashes, return_index=True, return_inverse=True)
        if not (segments.key == segments.key[firsts][alike]).all():  # chance, or malice: one by one
            alike = np.arange(len(hashes))
            firsts = alike
        order = np.argsort(alike, kind="stable")
        bounds = np.searchsorted(alike[order], np.arange(len(firsts) + 1)).tolist()
        special = (segments.flags & _SPECIAL != 0) | ((segments.missing > 0) & ~segments.datagrams)
        carrying = segments.size > 0
        slow = np.zeros(len(firsts), np.bool_)
        slow[alike[special]] = True
        keys = [row.tobytes() for row in segments.key[firsts]]
        for number, key in enumerate(keys):
            half = self._halves.get(key)
            if key[-1] == UDP:
                mine = order[bounds[number] : bounds[number + 1]]
                self._pass_on(half or self._half(key, 0, 0, None), segments, mine[carrying[mine]])
                continue
            if slow[number] or half is None or half.waiting or half.other.waiting:
                slow[number] = True
                continue
            mine = order[bounds[number] : bounds[number + 1]]
            mine = mine[carrying[mine]]
            if not len(mine):
                continue
            seq, size = segments.seq[mine], segments.size[mine]
            if seq[0] != half.following or ((seq[:-1] + size[:-1] - seq[1:]) & _MASK).any():
                slow[number] = True
                continue
            half.following = int(seq[-1] + size[-1]) & _MASK
            half.run = mine.tolist()
            self._take_run(half, segments)
        if slow.any():
            backs = {_back(key) for key, late in zip(keys, slow.tolist(), strict=True) if late}
            slow |= np.array([key in backs for key in keys])
            self._one_by_one(segments, data, np.flatnonzero(slow[alike]))

    def _pass_on(self, half: Half, segments: Segments, datagrams: Ints) -> None:
        """Datagrams of one direction, as they came."""
        cut = datagrams[segments.missing[datagrams] > 0]
        half.group.missing += int(segments.missing[cut].sum())
        half.run = datagrams.tolist()
        self._take_run(half, segments)
        for i in cut.tolist():
            self._taker.hole(half, i, int(segments.missing[i]))

    def _one_by_one(self, segments: Segments, data: bytes, which: Ints) -> None:
        halves, runs = self._halves, list[Half]()
        gaps = any(half.waiting for half in halves.values())
        columns = (segments.seq, segments.flags, segments.begin, segments.size, segments.ack, segments.missing)
        rows = segments.key[which].tobytes()
        numbers = (column[which].tolist() for column in columns)
        for n, (i, seq, flags, begin, size, ack, missing) in enumerate(zip(which.tolist(), *numbers, strict=True)):
            key = rows[n * KEY : (n + 1) * KEY]
            half = halves.get(key)
            if half is None or flags & _SYN:
                for side in (half, half.other) if half is not None else ():
                    self._take_run(side, segments)
                half = self._half(key, seq, flags, half)
            if flags & _ACK:
                half.other.acknowledged = ack
                if half.other.waiting:
                    self._take_run(half, segments)
                    self._acknowledged(half.other, i, ack)
            if size and not flags & _SYN:
                if seq == half.following and not half.waiting:
                    half.following = (seq + size) & _MASK
                    if not half.run:
                        runs.append(half)
                    half.run.append(i)
                else:
                    for side in (half, half.other):
                        self._take_run(side, segments)
                    self._out_of_turn(half, i, seq, begin, data[begin : begin + size])
                    gaps = gaps or bool(half.waiting)
            elif not gaps and not flags & _SPECIAL and not missing:
                continue
            if missing and half.following == (seq + size) & _MASK:
                half.following = (seq + size + missing) & _MASK
                half.group.missing += missing
                self._take_run(half, segments)
                self._taker.hole(half, i, missing)
            if flags & (_FIN | _RST):
                half.connection.close()
        for half in runs:
            self._take_run(half, segments)

    def _take_run(self, half: Half, segments: Segments) -> None:
        """What came in turn, one behind the other."""
        run, half.run = half.run, []
        if len(run) >= _RUN:
            self._taker.run(half, np.array(run))
            return
        for i in run:
            self._taker.piece(half, i, int(segments.begin[i]), int(segments.size[i]))

    def close(self) -> None:
        """No more segments come: what waits is given."""
        for half in self._halves.values():
            self._finish(half)

    def _out_of_turn(self, half: Half, i: int, seq: int, begin: int, octets: bytes) -> None:
        """A segment that is not simply the next one: repeated, early, or the one that was waited for."""
        if half.following is None:
            half.following = seq
        ahead = (seq - half.following) & _MASK
        if ahead >= _HALF:  # begins with bytes that were given already
            skip = _MASK + 1 - ahead
            if skip >= len(octets):
                return
            begin, octets, ahead = begin + skip, octets[skip:], 0
        if ahead == 0:
            half.following = (half.following + len(octets)) & _MASK
            self._taker.piece(half, i, begin, len(octets))
            self._drain(half, i)
            return
        seq = (half.following + ahead) & _MASK
        if len(octets) > len(half.waiting.get(seq, b"")):
            half.waiting[seq] = octets
        if half.acknowledged is not None:
            self._acknowledged(half, i, half.acknowledged)
        if len(half.waiting) > _WAITING:
            self._give_up(half, i)

    def _drain(self, half: Half, i: int) -> None:
        """What waits and has its turn now."""
        while half.waiting:
            assert half.following is not None
            following = half.following
            seq = min(half.waiting, key=lambda seq: (seq - following + _HALF) & _MASK)
            ahead = (seq - following) & _MASK
            if 0 < ahead < _HALF:
                return
            octets = half.waiting.pop(seq)[(-ahead) & _MASK :]
            if octets:
                half.following = (following + len(octets)) & _MASK
                self._taker.late(half, i, octets)

    def _acknowledged(self, half: Half, i: int, ack: int) -> None:
        """The other side has bytes that the capture may lack: those are not waited for."""
        assert half.following is not None
        while half.waiting and 0 < (ack - half.following) & _MASK < _HALF:
            before = half.following
            first = min((seq - before) & _MASK for seq in half.waiting)
            if first > (ack - before) & _MASK:
                return
            self._give_up(half, i)

    def _give_up(self, half: Half, i: int) -> None:
        """Go on behind a gap."""
        assert half.following is not None
        before = half.following
        seq = min(half.waiting, key=lambda seq: (seq - before) & _MASK)
        half.group.missing += (seq - before) & _MASK
        half.following = seq
        self._taker.hole(half, i, (seq - before) & _MASK)
        self._drain(half, i)

    def _half(self, key: bytes, seq: int, flags: int, known: Half | None) -> Half:
        """The half of a segment whose connection is not known, or begins (SYN)."""
        following = (seq + 1) & _MASK if flags & _SYN else None
        if known is not None:
            if known.following is None or known.following == following or not flags & _SYN:
                known.in_step = known.in_step or bool(flags & _SYN)
                known.following = following if known.following is None else known.following
                return known
            if flags & _ACK and not known.connection.closed:  # a repeated answer to a SYN
                return known
            self._forget(known)
        if len(self._halves) >= _HALVES:
            self._forget_some()
        back = _back(key)
        from_client = _from_client(key, flags)
        connection = self._opened(self._group(key if from_client else back))
        mine, theirs = (Mark.TX, Mark.RX) if from_client else (Mark.RX, Mark.TX)
        half = Half(connection, mine, following=following, in_step=bool(flags & _SYN))
        opposite = Half(connection, theirs)
        half.other, opposite.other = opposite, half
        self._halves[key], self._halves[back] = half, opposite
        return half

    def _forget(self, half: Half) -> None:
        """A connection that is over: what waits is given."""
        half.connection.close()
        self._finish(half)
        self._finish(half.other)

    def _finish(self, half: Half) -> None:
        while half.waiting:
            self._give_up(half, -1)
        ack, following = half.acknowledged, half.following
        if ack is not None and following is not None and _ENDS < (ack - following) & _MASK < _HALF:
            half.following = ack
            half.group.missing += (ack - following) & _MASK
            self._taker.hole(half, -1, (ack - following) & _MASK)
        self._taker.ended(half)

    def _forget_some(self) -> None:
        halves = sorted(self._halves.items(), key=lambda item: not item[1].connection.closed)  # closed ones first
        for key, half in halves[: _HALVES // 2]:
            self._forget(half)
            del self._halves[key]

    def _group(self, key: bytes) -> ConnectionGroup:
        """The group of a connection, by the key of its client's segments."""
        ends = key[:32] + key[34:]
        group = self._by_ends.get(ends)
        if group is None:
            if len(self.groups) > _GROUPS:
                return self.groups[-1]
            group = ConnectionGroup(key if len(self.groups) < _GROUPS else b"", number=len(self.groups))
            self._by_ends[ends] = group
            self.groups.append(group)
        return group

    def _opened(self, group: ConnectionGroup) -> Connection:
        if group.of_datagrams:
            group.lanes = 1
            return Connection(group, 0)
        if group.free:
            return Connection(group, heappop(group.free))
        group.lanes += 1
        return Connection(group, group.lanes - 1)


def _back(key: bytes) -> bytes:
    """The key of the other direction."""
    return key[16:32] + key[:16] + key[34:36] + key[32:34] + key[36:]


def _from_client(key: bytes, flags: int) -> bool:
    """Whether a segment is the client's: who begins the connection, else who has the port of a client."""
    if flags & _SYN:
        return not flags & _ACK
    source, destination = int.from_bytes(key[32:34], "big"), int.from_bytes(key[34:36], "big")
    if _MODBUS_PORT in (source, destination):
        return destination == _MODBUS_PORT
    if (source < _WELL_KNOWN) != (destination < _WELL_KNOWN):
        return destination < _WELL_KNOWN
    return source > destination
