"""What bytes speak, weighed in bits: RTU by right check values, TCP by chains of headers, ASCII mode by its frames.

The one decider of protocols: of a port whose bytes come one by one (`PortWeights`), and of bytes that are all there is
(`rtu_bits`, `tcp_bits`), as in a paste. Weights are log-likelihood ratios against chance, as in the lattice; nothing
here hangs on how bytes were cut into reads. Plain Python without arrays: a few hundred bytes decide.
"""

from __future__ import annotations

import re
from bisect import insort
from collections.abc import Collection, Iterable, Iterator
from math import log2
from typing import Final, NamedTuple

from dissectors.crc import crc16, crc_bytes, crc_ok
from dissectors.declaration import USER_DEFINED
from dissectors.envelopes import MBAP, Adu, ascii_frames
from dissectors.length_rules import LengthRule, Role
from dissectors.lengths import Expectation, declared_roles, expectation, pdu_length, plausibility, rule, sound_roles
from dissectors.limits import BROADCAST, CRC_SIZE, EXCEPTION, LAST_UNIT, MAX_ADU, MIN_ADU, Sized

_CRC_BITS: Final = 18.0  # a right check value, 16, and a function in use, of which there are a score of 128
_TURNED: Final = 1.0  # less, where its bytes are the wrong way round: one firmware in some
_COLON: Final = ord(":")
_LRC_BITS: Final = 12.0  # a colon, digits alone, an end of a line and a right check value of 8 bits
_HEADER: Final = 4.0  # three zeros and a length: every request to register 0 has them
_CHAINED: Final = 12.0  # the same just where the frame before it ended
_ANSWERS: Final = 12.0  # the transaction, and what its request asked for
_JUNK: Final = -10.0  # what no header covers: a stream loses nothing but its beginning
_EXCEPTION: Final = 8.0
_COUNTED: Final = 10.0  # as long as a byte count says
_FIXED: Final = 5.0  # as long as its function always is
_SERIAL_ONLY: Final = frozenset((7, 8, 11, 12, 17))  # [1] 6.7 to 6.13: nobody asks a network for them
_READS: Final = (b"\1", b"\2", b"\3", b"\4")
_FUNCTION_BITS: Final = 4.0  # a score of 256
_COUNT_BITS: Final = 8.0  # a byte that counts the rest
_UNDECLARED: Final = -4.0
_FREE: Final = -2.0  # undeclared, but free for users
_UNSOUND: Final = -8.0  # another length than its function predicts
_ILLEGAL: Final = -4.0  # for each limit that it breaks
_LEGAL_UNIT: Final = 3.0
_NO_UNIT: Final = -6.0  # 248 and over, or a broadcast that nobody can answer
_CUT: Final = -2.0  # what is not all there
_BARE: Final = -2.0  # without a check value
_EXACTLY_TURNED: Final = 10.0
_LAST_EXCEPTION: Final = 0x0B
_BEFORE: Final = 6  # bytes of a header that its length does not count
_LENGTHS: Final = range(2, 255)
_SURE: Final = 16.0  # bits over the next best
_LIKELIER: Final = 4.0  # of bytes of which no more come
_SERIAL: Final = -40.0  # what a serial line has against MBAP: a gateway set wrongly, several exchanges long
_BINARY: Final = 256  # bytes without a frame of anything that are RTU's, damaged, unless they are text:
_FIRST_LOOK: Final = 64  # bytes
_HEAD: Final = 2048  # then so many
_FOREIGN: Final = re.compile(rb"[^:0-9A-Fa-f\r\n]")  # what no line in ASCII mode carries
_FOREIGN_SHARE: Final = 4  # one such byte in so many is no ASCII mode
_COLON_FRAME: Final = re.compile(rb"[:>](?:[0-9A-Fa-f]{2}){3,260}[\r\n]")
_LONGEST_COLON: Final = 2 * 260 + 2
_OPEN: Final = 16  # requests that an answer may be to


class SpokenBits(NamedTuple):
    """After so many bytes it is known that they weigh so much more for a protocol."""

    after: int
    protocol: str
    bits: float


def pdu_bits(pdu: bytes) -> float:
    """What the contents of a PDU speak for its being one, where other facts say where it begins and ends."""
    if not pdu:
        return _UNSOUND
    code = pdu[0]
    if code & EXCEPTION:
        return _EXCEPTION if len(pdu) == 2 and 0 < pdu[1] <= _LAST_EXCEPTION else _UNSOUND
    roles = sound_roles(pdu)
    if not roles:
        if any(rule(code, role) is not None for role in Role):
            return _UNSOUND
        return _FREE if code in USER_DEFINED else _UNDECLARED
    if code in _SERIAL_ONLY:
        return 0.0
    counted = any((one := rule(code, role)) is not None and one.count is not None for role in roles)
    return (_COUNTED if counted else _FIXED) + _ILLEGAL * min(len(plausibility(pdu, role)) for role in roles)


def bare_bits(pdu: bytes) -> float:
    """How seldom chance gives bytes that are all of a PDU and break no rule of it, the binary logarithm; else 0."""
    sound = (role for role in sound_roles(pdu) if not plausibility(pdu, role))
    return max((_rarity(declared) for role in sound if (declared := rule(pdu[0], role))), default=0.0)


def _rarity(declared: LengthRule) -> float:
    limits = sum(check.bits for check in declared.checks if not isinstance(check, Sized))
    return _FUNCTION_BITS + limits + _COUNT_BITS * (declared.count is not None)


def tcp_bits(data: bytes) -> float:
    """What speaks for these bytes, all there is, being Modbus TCP from the first one on."""
    bits, at = 0.0, 0
    while at < len(data):
        if not begins_tcp(data, at):
            return bits + _JUNK
        end = at + _BEFORE + data[at + 5]
        bits += (_CHAINED if at else _HEADER) + _announced_bits(data[at + MBAP : end], end - at - MBAP)
        at = end
    return bits


def tcp_head_bits(data: bytes) -> float:
    """What speaks for these bytes beginning with a frame of Modbus TCP, whole or cut."""
    return tcp_bits(data[: _BEFORE + data[5]]) if begins_tcp(data, 0) else _JUNK


def _announced_bits(pdu: bytes, size: int) -> float:
    """The same of a PDU whose header says how long it is, of which perhaps not all is there."""
    if len(pdu) == size:
        return pdu_bits(pdu)
    if not pdu:
        return _CUT
    lengths = {pdu_length(pdu, role) for role in Role if rule(pdu[0], role) is not None}
    if size in lengths:
        return _CUT + _FIXED
    return _CUT if None in lengths else _CUT + _UNSOUND


def rtu_bits(data: bytes, roles: Iterable[Role] = Role) -> float:
    """What speaks for these bytes, all there is, being one RTU frame, whether or not its check value is right or there.

    They must be as long as the frame's header says.
    """
    best = _JUNK
    if len(data) <= 2:
        return best
    unit, bare = data[0], data[1:]
    for pdu, shown in ((data[1:-CRC_SIZE], True), (bare, False)):
        for role in roles:
            if not pdu or rule(pdu[0], role) is None or pdu_length(pdu, role) != len(pdu):
                continue
            counted = (one := rule(pdu[0], role)) is not None and one.count is not None
            bits = (_COUNTED if counted else _FIXED) + _ILLEGAL * len(plausibility(pdu, role))
            if pdu[0] & EXCEPTION:
                bits = _EXCEPTION if 0 < pdu[1] <= _LAST_EXCEPTION else _UNSOUND
            bits += _unit_bits(unit, pdu)
            if not shown:
                bits += _BARE
            elif (right := crc_bytes(data[:-CRC_SIZE])) == data[-CRC_SIZE:]:
                bits += _CRC_BITS
            elif right == data[: -CRC_SIZE - 1 : -1]:
                bits += _EXACTLY_TURNED
            best = max(best, bits)
    return best


def _unit_bits(unit: int, pdu: bytes) -> float:
    """What a unit speaks for its being one; nobody can answer what is asked of all."""
    asked_of_all = unit == BROADCAST and pdu[:1] in _READS
    return _NO_UNIT if unit > LAST_UNIT or asked_of_all else _LEGAL_UNIT


def rtu_head_bits(data: bytes, roles: Collection[Role] = tuple(Role)) -> float:
    """What speaks for these bytes beginning with an RTU frame, cut, or with more behind it."""
    best = rtu_bits(data, roles)
    for role in roles:
        if (data[1:] and rule(data[1], role) is None) or (length := pdu_length(data[1:], role)) == -1:
            continue
        known = data[1:][:length]
        bits = _CUT + _ILLEGAL * len(plausibility(known, role))
        bits += _unit_bits(data[0], data[1:])
        if len(data) - 2 == length and crc_bytes(data[:-1])[:1] == data[-1:]:  # half its CRC
            bits += _CRC_BITS / CRC_SIZE
        best = max(best, bits)
    return best


def begins_tcp(data: bytes, at: int = 0) -> bool:
    """Whether a header begins here, as far as its length and all of it there."""
    return at + _BEFORE <= len(data) and not any(data[at + 2 : at + 5]) and data[at + 5] in _LENGTHS


def _wrong_at(head: bytes) -> int:
    """After how many of its bytes it is plain that no header begins so; 0 where one may."""
    for at in range(2, min(len(head), _BEFORE - 1)):
        if head[at]:
            return at + 1
    return _BEFORE if len(head) == _BEFORE and head[-1] not in _LENGTHS else 0


class PortWeights:
    """The protocols of a port, weighed as its bytes come. `sure` is the one that they made sure, and after how many."""

    bits: dict[str, float]
    sure: tuple[int, str] | None
    proven: str | None
    _data: bytearray
    _rtu: _RtuFrames
    _tcp: _TcpChain
    _ascii: _ColonFrames

    def __init__(self, *, serial: bool = False) -> None:
        """`serial`: the tap is one of a serial line, by what is known of it."""
        self.bits = {"ascii": 0.0, "tcp": _SERIAL if serial else 0.0, "rtu": 0.0}
        self.sure = None
        self.proven = None  # the same where frames made it sure, not that there are none
        self._data = bytearray()
        self._rtu, self._tcp, self._ascii = _RtuFrames(), _TcpChain(), _ColonFrames()

    def feed(self, octets: bytes) -> None:
        """The next bytes: few at first, for most ports are sure after some frames."""
        at, step = 0, _FIRST_LOOK
        while at < len(octets) and self.sure is None and len(self._data) < _HEAD:
            self._look(octets[at : at + step])
            at, step = at + step, 2 * step

    def _look(self, octets: bytes) -> None:
        before = len(self._data)
        self._data += octets[: _HEAD - before]
        data = bytes(self._data)
        found = [*self._ascii.found(data), *self._tcp.found(data), *self._rtu.found(data)]
        found += [SpokenBits(limit, "", 0.0) for limit in (_BINARY, _HEAD) if before < limit <= len(data)]
        for after, protocol, bits in sorted(found):
            if protocol:
                self.bits[protocol] += bits
            self._decide(after)
            if self.sure is not None:
                return

    def _decide(self, after: int) -> None:
        best, lead = self._lead()
        if lead >= _SURE and self.bits[best] >= _SURE:
            self.sure, self.proven = (after, best), best
        elif after >= _HEAD:
            self.sure = after, best if lead >= _LIKELIER else "rtu"
        elif after >= _BINARY and max(self.bits["ascii"], self.bits["tcp"]) < _LIKELIER and self._binary(after):
            self.sure = after, "rtu"

    def _lead(self) -> tuple[str, float]:
        ranked = sorted(self.bits, key=self.bits.__getitem__)
        return ranked[-1], self.bits[ranked[-1]] - self.bits[ranked[-2]]

    def _binary(self, after: int) -> bool:
        return _FOREIGN_SHARE * len(_FOREIGN.findall(self._data, 0, after)) > after

    def of_all(self) -> str | None:
        """The likeliest protocol where no more bytes come; None where they speak for none."""
        if self.sure is not None:
            return self.sure[1]
        data = bytes(self._data)
        self.bits["rtu"] = max(self.bits["rtu"], rtu_bits(data)) if len(data) <= MAX_ADU else self.bits["rtu"]
        self.bits["tcp"] = max(self.bits["tcp"], tcp_bits(data)) if self.bits["tcp"] >= 0 else self.bits["tcp"]
        best, lead = self._lead()
        if self.bits[best] >= _LIKELIER and lead > 0:
            return best
        return "rtu" if self._binary(len(data)) else None


class _RtuFrames:
    """Frames whose check value is right at the length that their header predicts, as the bytes come."""

    _next: int
    _open: list[tuple[int, Role]]
    _windows: list[tuple[int, int]]
    _end: int

    def __init__(self) -> None:
        self._next = 0  # the place that was not looked at yet
        self._open = []  # places whose length is not known yet
        self._windows = []  # ends and starts, in order
        self._end = 0  # of the last right frame

    def found(self, data: bytes) -> Iterator[SpokenBits]:
        for start in range(self._next, max(len(data) - 1, self._next)):
            self._open += [(start, role) for role in declared_roles(data[start + 1])]
        self._next = max(len(data) - 1, self._next)
        still: list[tuple[int, Role]] = []
        for start, role in self._open:
            length = pdu_length(data[start + 1 : start + MAX_ADU], role)
            if length is None and len(data) - start < MAX_ADU:
                still.append((start, role))
            elif length is not None and MIN_ADU <= (size := length + 1 + CRC_SIZE) <= MAX_ADU:
                window = start + size, start
                if window not in self._windows:
                    insort(self._windows, window)
        self._open = still
        while self._windows and self._windows[0][0] <= len(data):
            end, start = self._windows.pop(0)
            adu = data[start:end]
            right = crc_ok(adu)
            if start >= self._end and (right or crc16(adu[:-CRC_SIZE]).to_bytes(2, "big") == adu[-CRC_SIZE:]):
                bits = _CRC_BITS - log2(2 * (start - self._end) + 1) - (0 if right else _TURNED)
                self._end = end
                yield SpokenBits(end, "rtu", bits)


class _TcpChain:
    """Headers that follow each other, as the bytes come: transaction, 0, a length that ends where the next begins."""

    _at: int
    _framed: int
    _begun: bool
    _known: int
    _asked: dict[bytes, Expectation]

    def __init__(self) -> None:
        self._at = 0  # where a header is looked for
        self._framed = 0  # the end of the last frame
        self._begun = False  # a frame was found
        self._known = 0  # bytes by which all that was said is known
        self._asked = {}  # by transaction

    def found(self, data: bytes) -> Iterator[SpokenBits]:
        while self._at < len(data):
            follows = self._at == self._framed
            head = data[self._at : self._at + _BEFORE]
            if wrong := _wrong_at(head):
                if follows and self._begun:
                    yield self._said(self._at + wrong, _JUNK)
                self._known = max(self._known, self._at + wrong)
                self._at += 1
                continue
            if len(head) < _BEFORE or (end := self._at + _BEFORE + head[5]) > len(data):
                return
            pdu = data[self._at + MBAP : end]
            bits = pdu_bits(pdu)
            if not follows and bits <= 0:
                self._known = max(self._known, end)
                self._at += 1
                continue
            bits += (_CHAINED if follows and self._begun else _HEADER) - log2(self._at - self._framed + 1)
            bits += self._matched(head[:2], data[self._at + MBAP - 1 : end])
            self._at, self._framed, self._begun = end, end, True
            yield self._said(end, bits)

    def _said(self, after: int, bits: float) -> SpokenBits:
        self._known = max(self._known, after)
        return SpokenBits(self._known, "tcp", bits)

    def _matched(self, transaction: bytes, body: bytes) -> float:
        """What an answer to a request that was seen is worth, over its being as long as it says."""
        asked = self._asked.pop(transaction, None)
        if asked is not None and asked.fits(body):
            return _ANSWERS
        self._asked[transaction] = expectation(body)
        if len(self._asked) > _OPEN:
            del self._asked[next(iter(self._asked))]
        return 0.0


def tells_ascii(adu: Adu, data: bytes) -> bool:
    """Whether a frame in these bytes shows that they are ASCII mode: a right LRC does behind a colon.

    Lines of other protocols begin with `>` too, and one LRC in 256 is right by chance: there its PDU must be sound.
    """
    return bool(adu.check_ok) and (data[adu.start] & 0x7F == _COLON or bool(sound_roles(adu.pdu)))


class _ColonFrames:
    """Frames in ASCII mode with a right LRC, as the bytes come."""

    _at: int

    def __init__(self) -> None:
        self._at = 0

    def found(self, data: bytes) -> Iterator[SpokenBits]:
        for match in _COLON_FRAME.finditer(data, self._at):
            self._at = match.end()
            if any(tells_ascii(adu, match[0]) for adu in ascii_frames(match[0])[:1]):
                yield SpokenBits(match.end(), "ascii", _LRC_BITS)
        self._at = max(self._at, len(data) - _LONGEST_COLON)
