"""What a computer exchanges with its USB serial adapters, each adapter an interface with a serial line.

The bulk transfers of a device are what its line carries: of usbmon (Linux, Documentation/usb/usbmon.rst) and of USBPcap
(Windows, "USBPcap Capture format specification"). An adapter of FTDI's puts two bytes of status before each packet that
it sends (FTDI AN232B-04). The speed that a driver sets is read where it stands in plain numbers (USB PSTN 1.2, 6.3.10).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..chunks import Mark, Note
from ..text.judging import ByteJudge
from .choosing import SAMPLE, kind_of
from .packets import INBOUND, OUTBOUND, USER, Bytes, Interface, Ints, PacketFile, Packets, take_bytes


class _PseudoHeader(NamedTuple):
    """Where the fields of a pseudo-header stand, in bytes; two of them are little-endian numbers of 16 bits."""

    head: int
    bus: int
    device: int
    device_bytes: int
    endpoint: int
    transfer: int
    inward: int  # the byte that says whose packet it is, and what it is where the device has answered
    answered: int
    setup: int  # of a control transfer


_USBMON: Final = _PseudoHeader(48, 12, 11, 1, 10, 9, 8, ord("C"), 40)
_PSEUDO_HEADERS: Final = {
    189: _USBMON,
    220: _USBMON._replace(head=64),
    249: _PseudoHeader(27, 17, 19, 2, 21, 22, 16, 1, 28),
}
USB: Final = frozenset(_PSEUDO_HEADERS)
_BULK, _CONTROL = 3, 2
_TO_HOST: Final = 0x80  # of an endpoint
_STATUS: Final = 2  # bytes before each packet of an FTDI adapter
_PACKET_SIZES: Final = (64, 512)  # of full and of high speed
_SIZES: Final = np.array((0, _STATUS, _PACKET_SIZES[0]))  # up to which transfers carry nothing, status, one packet
_MODEM, _IDLE = 0x01, 0x60  # the bits that its two bytes of status have: always, and while it does not send
_MOSTLY: Final = 0.5
_SET_LINE_CODING: Final = bytes((0x21, 0x20))
_SET_BAUD: Final = bytes((0x41, 0x1E))  # of CP210x (AN571)
_BAUDS: Final = range(50, 12_000_001)


@dataclass(slots=True)
class _Adapter:
    """A device that was met: its first reads, and how its packets are laid out."""

    number: int  # the interface that it becomes
    name: str
    reads: list[tuple[Mark, bytes]] = field(default_factory=list)
    baud: int | None = None
    seen: Counter[int] = field(default_factory=Counter)  # reads that were looked at, by kinds of size
    status: int = 0  # bytes of a packet that begins with status; 0: none does

    def sample(self, size: Ints) -> Ints:
        """Which transfers to look at, by their sizes (negative: of another device): some of each, for most are idle."""
        kinds = np.searchsorted(_SIZES, size)
        chosen: list[Ints] = []
        for kind in range(1, len(_SIZES) + 1):
            some = np.flatnonzero(kinds == kind)[: SAMPLE - self.seen[kind]]
            self.seen[kind] += len(some)
            chosen.append(some)
        return np.sort(np.concatenate(chosen))

    def learn(self) -> None:
        """Whether it is of FTDI: its packets begin so, also those with nothing else, which come all the time."""
        came = [data for mark, data in self.reads if mark == Mark.RX]
        if came and all(len(data) >= _STATUS and data[0] & 0x0F == _MODEM for data in came):
            idle = sum(data[1] & _IDLE == _IDLE for data in came)
            if idle > _MOSTLY * len(came):
                long = [data for data in came if len(data) > _PACKET_SIZES[0] + 1]
                short = all(data[_PACKET_SIZES[0]] & 0x0F == _MODEM for data in long)
                self.status = _PACKET_SIZES[0] if short else _PACKET_SIZES[1]

    @property
    def carried(self) -> list[tuple[Mark, bytes]]:
        """Its first reads without status."""
        bare = ((mark, self._bare(data) if mark == Mark.RX else data) for mark, data in self.reads)
        return [(mark, data) for mark, data in bare if data]

    def _bare(self, data: bytes) -> bytes:
        size = self.status
        return b"".join(data[at + _STATUS : at + size] for at in range(0, len(data), size)) if size else data


@dataclass(frozen=True, slots=True, eq=False)
class _Transfers:
    """Transfers with data: packet, device (bus and number), place and size of the data, whether the device sent it."""

    packet: Ints
    device: Ints
    begin: Ints
    size: Ints
    inward: NDArray[np.bool_]


class UsbLines:
    """A file of USB packets as one of serial lines.

    `judge` knows right check values: other devices send in bulk, too.
    """

    def __init__(self, file: PacketFile, judge: ByteJudge) -> None:
        self._file = file
        self._devices: dict[int, _Adapter] = {}
        for packets in file.packets(_unheard):
            for link, chosen in self._by_link(packets):
                self._meet(packets.data, _transfers(packets, chosen, link, _BULK))
                self._set(packets.data, _transfers(packets, chosen, link, _CONTROL, setup=True))
        for device in self._devices.values():
            device.learn()
        speaking = {key: one for key, one in self._devices.items() if one.carried}
        modbus = {key: one for key, one in speaking.items() if kind_of(one.carried, judge) is not None}
        self._devices = modbus or (speaking if len(speaking) == 1 else {})
        for number, device in enumerate(self._devices.values()):
            device.number = number
        self.interfaces = [Interface(USER.start, one.name, one.baud) for one in self._devices.values()]

    @property
    def header(self) -> Mapping[str, object]:
        """What this tool wrote of the line."""
        return self._file.header

    def packets(self, note: Note) -> Iterator[Packets]:
        """All that the adapters' lines carried."""
        for packets in self._file.packets(note):
            parts = [self._lines(_transfers(packets, chosen, link, _BULK)) for link, chosen in self._by_link(packets)]
            packet, begin, size, interface, flags = np.concatenate([*parts, np.zeros((5, 0), np.int64)], axis=1)
            order = np.argsort(packet, kind="stable")
            packet = packet[order]
            first = np.searchsorted(packet, list(packets.comments)).tolist()
            yield Packets(
                data=packets.data,
                at=begin[order],
                size=size[order],
                missing=packets.missing[packet],
                t_ns=packets.t_ns[packet],
                interface=interface[order],
                flags=flags[order],
                comments={
                    i: texts
                    for i, (at, texts) in zip(first, packets.comments.items(), strict=True)
                    if i < len(packet) and packet[i] == at
                },
            )

    def _by_link(self, packets: Packets) -> Iterator[tuple[int, Ints]]:
        links = np.array([one.link for one in self._file.interfaces], np.int64)[packets.interface]
        for link in sorted(USB.intersection(links.tolist())):
            yield link, np.flatnonzero(links == link)

    def _meet(self, data: Bytes, transfers: _Transfers) -> None:
        for key in np.unique(transfers.device).tolist():
            device = self._device(key)
            mine = device.sample(np.where(transfers.device == key, transfers.size, -1))
            for begin, size, inward in zip(
                *(column[mine].tolist() for column in (transfers.begin, transfers.size, transfers.inward)), strict=True
            ):
                device.reads.append((Mark.RX if inward else Mark.TX, data[begin : begin + size].tobytes()))

    def _set(self, data: Bytes, transfers: _Transfers) -> None:
        """What a driver sets lines to."""
        columns = transfers.device, transfers.begin, transfers.size
        for key, begin, size in zip(*(column.tolist() for column in columns), strict=True):
            asked = data[begin : begin + size].tobytes()
            if asked[:2] in (_SET_LINE_CODING, _SET_BAUD):
                baud = int.from_bytes(asked[-7:][:4] if asked[:2] == _SET_LINE_CODING else asked[-4:], "little")
                self._device(key).baud = baud if baud in _BAUDS else None

    def _device(self, key: int) -> _Adapter:
        return self._devices.setdefault(key, _Adapter(0, f"USB {key >> 16}.{key & 0xFFFF}"))

    def _lines(self, transfers: _Transfers) -> Ints:
        """Columns packet, begin, size, interface, flags: what the adapters' lines carried, without status."""
        known = np.isin(transfers.device, list(self._devices))
        packet, key, begin, size, inward = (
            column[known]
            for column in (transfers.packet, transfers.device, transfers.begin, transfers.size, transfers.inward)
        )
        numbers = np.array([self._devices[one].number for one in key.tolist()], np.int64)
        whole = np.array([self._devices[one].status for one in key.tolist()], np.int64) * inward
        parts = np.where(whole > 0, (size + whole - 1) // np.maximum(whole, 1), 1)
        row = np.repeat(np.arange(len(parts)), parts)
        skipped = (np.arange(len(row)) - (np.cumsum(parts) - parts)[row]) * whole[row]
        left = size[row] - skipped
        status = np.where(whole[row] > 0, _STATUS, 0)
        part = np.where(whole[row] > 0, np.minimum(left, whole[row]), left) - status
        flags = np.where(inward[row], INBOUND, OUTBOUND)
        columns = np.stack((packet[row], begin[row] + skipped + status, part, numbers[row], flags))
        return columns[:, part > 0]


def _transfers(packets: Packets, chosen: Ints, link: int, kind: int, *, setup: bool = False) -> _Transfers:
    """The transfers of a kind that carry data; with `setup` also what is asked of the device, before the data."""
    layout, data = _PSEUDO_HEADERS[link], packets.data
    at, size = packets.at[chosen], packets.size[chosen]
    endpoint = take_bytes(data, at + layout.endpoint)
    answered = take_bytes(data, at + layout.inward) == layout.answered
    inward: NDArray[np.bool_] = (endpoint & _TO_HOST) != 0
    begin = layout.setup if setup else layout.head
    carries = (take_bytes(data, at + layout.transfer) == kind) & (answered == inward) & (size > begin)
    if setup:
        carries &= ~inward
    at, size = at[carries], size[carries]
    device = take_bytes(data, at + layout.device)
    if layout.device_bytes > 1:
        device |= take_bytes(data, at + layout.device + 1) << 8
    bus = take_bytes(data, at + layout.bus) | take_bytes(data, at + layout.bus + 1) << 8
    return _Transfers(chosen[carries], bus << 16 | device, at + begin, size - begin, inward[carries])


def _unheard(_where: str, _what: str) -> None:
    """Damage is for the second reading to say."""
