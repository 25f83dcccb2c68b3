"""Packets as columns, and the interfaces that they were captured on: what pcap and pcapng files give alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from ..chunks import Note

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]

INBOUND: Final = 1  # the lowest two flag bits of a packet (pcapng): received, sent
OUTBOUND: Final = 2
LONGEST: Final = 1 << 24  # bytes of a packet or block: more is damage


@dataclass(frozen=True, slots=True)
class Interface:
    """Where packets were captured: `link` is the link type (tcpdump.org/linktypes), `baud` the speed, where told."""

    link: int
    name: str | None = None
    baud: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Packets:
    """n packets of a file. `at` and `size` (captured bytes) point into `data`; the rest are values a packet.

    `missing` are bytes that the snap length cut off, `flags` those of pcapng, `comments` texts by packet.
    """

    data: Bytes
    at: Ints
    size: Ints
    missing: Ints
    t_ns: Ints
    interface: Ints
    flags: Ints
    comments: Mapping[int, list[str]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.at)


class PacketFile(Protocol):
    """What a file format's reader gives. `interfaces` grows as they are met; `header` is what this tool wrote of the
    line, where it wrote the file."""

    @property
    def interfaces(self) -> list[Interface]: ...

    @property
    def header(self) -> Mapping[str, object]: ...

    def packets(self, note: Note) -> Iterator[Packets]:
        """All packets in the file's order; `note` hears of what could not be read. Interfaces are met anew."""
        ...


def take(data: Bytes, at: Ints) -> Ints:
    """The bytes at these places, as numbers; places behind the end give the last byte."""
    return data.take(at, mode="clip").astype(np.int64)


def take_number(data: Bytes, at: Ints, width: int) -> Ints:
    """The big-endian numbers of `width` bytes at these places."""
    value = take(data, at)
    for step in range(1, width):
        value = value << 8 | take(data, at + step)
    return value
