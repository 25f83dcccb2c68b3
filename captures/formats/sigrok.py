"""sigrok sessions, `.sr`: the samples of a logic analyser, as PulseView and sigrok-cli save them.

A zip with `metadata` (sample rate, names of the probes) and the samples of all probes in parts `logic-1-1`, `logic-1-2`
and so on, each sample as many bytes as the probes need. Analog channels are passed over.
"""

from __future__ import annotations

import configparser
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..chunks import Note
from ..edges.source import EdgePiece, edge_reader
from ..edges.uart import RATE, hertz_of, sample_times
from ..errors import CaptureError
from ..files import opened
from . import Format

_ZIP: Final = b"PK\x03\x04"
_MEMBER: Final = 30  # offset of the first member's name in a zip
_MEMBERS: Final = (b"version", b"metadata", b"logic-1")
_PIECE: Final = 1 << 22  # bytes of samples at once
_MOST: Final = 1 << 20  # bytes of metadata
_DIGITS: Final = 9  # of a number that can be meant


@dataclass(frozen=True, slots=True)
class _SigrokSession:
    path: Path
    names: list[str]
    levels: list[int]
    parts: list[str]  # members with samples, in order
    unit: int  # bytes of a sample
    rate: int  # samples a second
    begin_ns: int = 0

    def pieces(self, note: Note) -> Iterator[EdgePiece]:
        before = sum(level << bit for bit, level in enumerate(self.levels))
        passed = 0  # samples
        for data in self._samples(note):
            changed = _changes(data, before)
            now = data[changed]
            flipped = now ^ np.concatenate((np.array([before], data.dtype), now[:-1]))
            at = sample_times(changed + passed, self.rate)
            edges = [at[flipped >> np.asarray(bit, data.dtype) & 1 == 1] for bit in range(len(self.names))]
            before, passed = int(data[-1]), passed + len(data)
            yield EdgePiece(edges, int(sample_times(np.array([passed]), self.rate)[0]))

    def _samples(self, note: Note) -> Iterator[NDArray[np.unsignedinteger]]:
        """All samples in pieces, as numbers."""
        width = 1 << (self.unit - 1).bit_length()
        with opened(self.path) as file, _archive(self.path, file) as archive:
            for part in self.parts:
                rest = b""
                try:
                    with archive.open(part) as member:
                        while octets := member.read(_PIECE):
                            rest += octets
                            size = len(rest) // self.unit * self.unit
                            if size:
                                yield _numbers(rest[:size], self.unit, width)
                            rest = rest[size:]
                except Exception as error:  # zlib.error and what a damaged zip raises have no base of their own
                    note(part, f"damaged ({str(error)[:80]}): everything before it was read")
                    return
                if rest:
                    note(part, f"{len(rest)} bytes after the last whole sample: skipped")


def _changes(data: NDArray[np.unsignedinteger], before: int) -> NDArray[np.int64]:
    """The samples that differ from the one before them."""
    changed = np.flatnonzero(data[1:] != data[:-1]) + 1
    return np.concatenate(([0], changed)) if int(data[0]) != before else changed


def _numbers(data: bytes, unit: int, width: int) -> NDArray[np.unsignedinteger]:
    if unit == width:
        return np.frombuffer(data, f"<u{width}")
    wide = np.zeros((len(data) // unit, width), np.uint8)
    wide[:, :unit] = np.frombuffer(data, np.uint8).reshape(-1, unit)
    return wide.view(f"<u{width}").ravel()


@contextmanager
def _archive(path: Path, file: object) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(file) as archive:  # type: ignore[call-overload]
            yield archive
    except (zipfile.BadZipFile, NotImplementedError, EOFError, ValueError) as error:
        raise CaptureError(f"{path}: a sigrok session that cannot be opened: {str(error)[:80]}") from error


def _sniff(head: bytes) -> float:
    if not head.startswith(_ZIP):
        return 0.0
    return 1.0 if head[_MEMBER:].startswith(_MEMBERS) else 0.0


def _load(path: Path, _rate: float | None = None) -> _SigrokSession:
    with opened(path) as file, _archive(path, file) as archive:
        return _session(path, archive)


def _session(path: Path, archive: zipfile.ZipFile) -> _SigrokSession:
    """What the metadata says; CaptureError where it does not make sense."""
    try:
        with archive.open("metadata") as member:
            text = member.read(_MOST).decode("utf-8", "replace")
        ini = configparser.ConfigParser(interpolation=None, strict=False)
        ini.read_string(text)
    except Exception as error:
        raise CaptureError(f"{path}: a sigrok session without readable metadata: {str(error)[:80]!r}") from error
    device = next(
        (ini[name] for name in ini.sections() if name.startswith("device") and "capturefile" in ini[name]), None
    )
    if device is None:
        raise CaptureError(f"{path}: a sigrok session without logic channels: no serial line in it")
    rate = RATE.fullmatch(device.get("samplerate", ""))
    unit, probes = device.get("unitsize", "1"), device.get("total probes", "8")
    if (
        max(len(unit), len(probes)) > _DIGITS
        or rate is None
        or not unit.isdecimal()
        or not probes.isdecimal()
        or not 1 <= int(unit) <= 8
    ):
        raise CaptureError(f"{path}: a sigrok session without a usable sample rate, probes or sample size")
    hertz = hertz_of(rate[1], rate[2])
    if hertz is None:
        raise CaptureError(f"{path}: a sample rate of {rate[0].strip()} is out of range")
    name = device["capturefile"]
    numbers = {member: re.fullmatch(rf"{re.escape(name)}(?:-(\d{{1,9}}))?", member) for member in archive.namelist()}
    parts = sorted((int(match[1] or 0), member) for member, match in numbers.items() if match)
    count = min(int(probes), 8 * int(unit))
    names = [" ".join(device.get(f"probe{bit + 1}", f"probe {bit + 1}").split()) for bit in range(count)]
    session = _SigrokSession(path, names, [0] * count, [member for _, member in parts], int(unit), hertz)
    first = next(session._samples(lambda *_: None), None)
    if first is None:
        raise CaptureError(f"{path}: a sigrok session without samples")
    levels = [int(first[0]) >> bit & 1 for bit in range(count)]
    return _SigrokSession(path, names, levels, session.parts, session.unit, session.rate)


FORMAT = Format("sigrok", (".sr",), _sniff, edge_reader(_load))
