"""Rows that are no Modbus but another protocol, named: noise that is its frames, and frames that only look like RTU.

What a row is hangs on it and on the rows before it on its port, never on how they were read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.foreign import (
    LOOSE,
    NAMES,
    SAME_CRC,
    FunctionEchoes,
    MeterTalk,
    checked_frames,
    foreign_bytes,
    is_legal,
    is_undeclared,
)
from dissectors.length_rules import Role
from dissectors.lengths import is_open
from dissectors.limits import EXCEPTION
from dissectors.unnamed import CHANCE, TrafficSoFar

from ..tables.schema import Kind, Protocol, Rows
from .rules import Bytes, Index, Mask, lengths_fit

_FRAMED: Final = TrafficSoFar._fields.index("framed")
_LEAST: Final = 4  # bytes of noise that may be a frame of something
_PART: Final = 0.5  # of a row's bytes that must be
_SPANNING: Final = 24  # bytes of a frame that may hold several of another protocol
_SEVERAL: Final = 2
_NEARLY_ALL: Final = 0.9  # of a frame: one run of messages, as MIDI's
_MANY: Final = 4  # frames with the CRC of Modbus that are none,
_TIMES: Final = 2  # and so many times as many as those that are
_AHEAD: Final = 16  # frames of one unit and function that are kept beyond those that bytes ask for
_NUMBER: Final = {name: number for number, name in enumerate(NAMES)}
_DIAGNOSTICS: Final = 8
_FIXED, _READ, _BLOCK = 1, 2, 4  # what the commonest functions' frames are as long as
_FIXED_LENGTH: Final = 8  # bytes
_COMMON: Final = np.zeros(256, np.uint8)
_COMMON[[1, 2, 3, 4]] = _FIXED | _READ
_COMMON[[15, 16]] = _FIXED | _BLOCK
_COMMON[[5, 6, _DIAGNOSTICS]] = _FIXED
_COMMON_OCTETS: Final = _COMMON.tobytes()
_FEW: Final = 48  # rows
_NOISE: Final = int(Kind.NOISE)


class ForeignTalk:
    """Marks such rows, batch after batch in wire order: `foreign` is set, and a frame becomes noise."""

    _talks: dict[int, MeterTalk]
    _shared: set[int]
    _legal: Counter[int]
    _octets: Counter[int]
    _framed: Counter[int]
    _named: dict[int, str]
    _kin: dict[tuple[int, int, int], set[bytes]]
    _echoes: dict[int, FunctionEchoes]
    _odd_octets: Counter[int]
    _loose: Counter[int]

    def __init__(self) -> None:
        self._talks = {}  # by port
        self._shared = set()  # ports on which another protocol was heard
        self._legal = Counter[int]()  # frames of Modbus, by port,
        self._octets = Counter[int]()  # bytes,
        self._framed = Counter[int]()  # and those in frames of whatever function
        self._named = {}  # the protocol that noise of a port was last
        self._kin = {}  # right frames that may be chance, by port, unit and function
        self._echoes = {}  # frames with its CRC that are none, by port,
        self._odd_octets = Counter[int]()  # and their bytes,
        self._loose = Counter[int]()  # and noise that may be a protocol of which a few frames are chance

    def mark(self, rows: Rows, data: Bytes) -> None:
        """Mark them in place, before frames are numbered."""
        if not self._shared and len(rows) <= _FEW and _all_usual(rows, data):
            self._legal.update(rows.port.tolist())
            for port, octets in zip(rows.port.tolist(), rows.length.tolist(), strict=True):
                self._octets[port] += octets
                self._framed[port] += octets
            return
        kind = rows.kind.copy()
        plain = rows.protocol == Protocol.RTU
        noise = (kind == Kind.NOISE) & plain & (rows.length >= _LEAST)
        odd = (kind != Kind.NOISE) & plain & rows.check
        odd[odd] = _unusual(rows, data, odd.nonzero()[0])
        if odd.any():
            odd[odd] = ~_sound(rows, data, odd.nonzero()[0])
        wrong = (kind != Kind.NOISE) & plain & ~rows.check
        heard = {port: self._sums(rows, port, ~odd) for port in np.unique(rows.port).tolist()}
        since = dict.fromkeys(self._shared, -1)
        for row in (noise | odd | wrong).nonzero()[0].tolist():
            adu, port = _bytes(rows, data, row), int(rows.port[row])
            so_far = TrafficSoFar(*heard[port][:, row].tolist())
            if noise[row]:
                rows.foreign[row] = self._of_noise(adu, port, so_far)
                if rows.foreign[row]:
                    since.setdefault(port, row)
                    self._named[port] = NAMES[rows.foreign[row]]
            elif name := self._of_meter(adu, port, so_far) if odd[row] else "":
                _make_foreign(rows, row, name)
            elif so_far.is_chance(len(adu), self._kin_of(adu, port, so_far.octets, right=bool(odd[row]))):
                _make_foreign(rows, row, self._named.get(port, ""))
                heard[port][_FRAMED, row:] -= len(adu)
        for port, sums in heard.items():
            self._legal[port], self._octets[port], self._framed[port] = sums[:, -1].tolist()
        self._shared |= since.keys()
        if since:
            self._mark_spanned(rows, data, since)

    def _kin_of(self, adu: bytes, port: int, octets: int, *, right: bool) -> int:
        """How many different frames of its unit and function were right before, as far as that tells them from chance;
        `right`: this one is, too."""
        kin = self._kin.setdefault((port, adu[0], adu[1] & ~EXCEPTION), set())
        count = len(kin) - (adu in kin)
        if right and count <= octets // CHANCE + _AHEAD:
            kin.add(adu)
        return count

    def _sums(self, rows: Rows, port: int, legal: Mask) -> NDArray[np.int64]:
        """What `TrafficSoFar` has of a port, (3, rows): up to each row and with it."""
        mine = rows.port == port
        framed = mine & (rows.kind != Kind.NOISE)
        each = framed & rows.check & legal, np.where(mine, rows.length, 0), np.where(framed, rows.length, 0)
        before = self._legal[port], self._octets[port], self._framed[port]
        return np.array([np.cumsum(column, dtype=np.int64) + sum_ for column, sum_ in zip(each, before, strict=True)])

    def _mark_spanned(self, rows: Rows, data: Bytes, since: Mapping[int, int]) -> None:
        """Mark frames that are chance over several frames of another protocol, behind the first of it on a port.

        One check value of Modbus is right by chance, theirs all are. An answer that carries one telegram of a meter
        is a gateway's.
        """
        long = (rows.kind != Kind.NOISE) & (rows.protocol == Protocol.RTU) & (rows.length >= _SPANNING)
        for row in long.nonzero()[0].tolist():
            if row > since.get(int(rows.port[row]), len(rows)):
                adu = _bytes(rows, data, row)
                name, frames, covered = foreign_bytes(adu)
                several = frames >= _SEVERAL or covered >= _NEARLY_ALL * len(adu)
                if several and covered >= _PART * len(adu):
                    _make_foreign(rows, row, name)

    def _of_noise(self, octets: bytes, port: int, so_far: TrafficSoFar) -> int:
        name, _, covered = foreign_bytes(octets)
        if covered >= _PART * len(octets) and self._is_believed(name, port, so_far):
            return _NUMBER[name]
        talk = self._talks.setdefault(port, MeterTalk())
        frames = checked_frames(octets)
        odd = [adu for adu in frames if not is_legal(adu)]
        names = [talk.name(adu, undeclared=is_undeclared(adu[1])) for adu in odd]
        if not names:
            name, covered = talk.in_noise(octets)
            return _NUMBER[name] if covered >= _PART * len(octets) else 0
        return _NUMBER[max(names)] if max(names) else _NUMBER[self._of_nobody(port, odd, so_far)]

    def _is_believed(self, name: str, port: int, so_far: TrafficSoFar) -> bool:
        """Whether such noise is that protocol: bytes of registers make messages of MIDI, too."""
        if name not in LOOSE:
            return True
        self._loose[port] += 1
        return self._loose[port] > so_far.legal

    def _of_meter(self, adu: bytes, port: int, so_far: TrafficSoFar) -> str:
        talk = self._talks.setdefault(port, MeterTalk())
        name = talk.name(adu, undeclared=is_undeclared(adu[1]))
        return name or ("" if is_legal(adu) else self._of_nobody(port, [adu], so_far))

    def _of_nobody(self, port: int, frames: Sequence[bytes], so_far: TrafficSoFar) -> str:
        """What frames are that have the CRC of Modbus and nothing else of it: another protocol where most are so, and
        the port speaks little else; among many bytes of anything a few are chance."""
        echoes = self._echoes.setdefault(port, FunctionEchoes())
        for adu in frames:
            echoes.heard(adu)
        self._odd_octets[port] += sum(map(len, frames))
        many = echoes.frames >= max(_MANY, _TIMES * so_far.legal) and not echoes.are_many
        return SAME_CRC if many and self._odd_octets[port] >= _PART * so_far.octets else ""


def _make_foreign(rows: Rows, row: int, name: str) -> None:
    rows.foreign[row], rows.kind[row] = _NUMBER[name], Kind.NOISE
    rows.unit[row] = rows.function[row] = rows.exception[row] = rows.check[row] = 0


def _bytes(rows: Rows, data: Bytes, row: int) -> bytes:
    at = int(rows.at[row])
    return data[at : at + int(rows.length[row])].tobytes()


def _unusual(rows: Rows, data: Bytes, which: Index) -> Mask:
    """Which of these frames are not as long as the commonest functions are: a look that costs little."""
    at, length = rows.at[which], rows.length[which]
    function = data.take(at + 1)
    common = _COMMON.take(function)
    last = at + length - 1
    usual = (length == _FIXED_LENGTH) & (common & _FIXED != 0)
    usual |= (common & _READ != 0) & (length == data.take(np.minimum(at + 2, last)).astype(np.int64) + 5)
    usual |= (common & _BLOCK != 0) & (length == data.take(np.minimum(at + 6, last)).astype(np.int64) + 9)
    usual |= (function > EXCEPTION) & (length == 5)
    unusual: Mask = ~usual
    return unusual


def _all_usual(rows: Rows, data: Bytes) -> bool:
    """Whether all of a few rows are right frames that `_unusual` would not name: one by one, as on a healthy line."""
    if np.count_nonzero(rows.protocol) or not rows.check.all():
        return False
    octets = data.tobytes()
    for kind, at, length in zip(rows.kind.tolist(), rows.at.tolist(), rows.length.tolist(), strict=True):
        function, last = octets[at + 1] if length > 1 else 0, at + length - 1
        common = _COMMON_OCTETS[function]
        if kind == _NOISE or not (
            (length == _FIXED_LENGTH and common & _FIXED)
            or (common & _READ and length == octets[min(at + 2, last)] + 5)
            or (common & _BLOCK and length == octets[min(at + 6, last)] + 9)
            or (function > EXCEPTION and length == 5)
        ):
            return False
    return True


def _sound(rows: Rows, data: Bytes, which: Index) -> Mask:
    """Which of these frames are of a declared function, in a role of which they are as long as that predicts.

    A frame that may be of any length, as one of function 8, is not among them.
    """
    at, length = rows.at[which], rows.length[which]
    function = data.take(at + 1)
    sound = np.zeros(len(which), np.bool_)
    for code in np.bincount(function).nonzero()[0].tolist():
        mine = (function == code).nonzero()[0]
        for role in Role:
            if not is_open(code, role):
                sound[mine] |= lengths_fit(data, at.take(mine), length.take(mine), code, role)
    return sound
