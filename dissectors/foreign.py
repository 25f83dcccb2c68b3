"""Protocols that share a pair of wires with Modbus, known by a structure that chance does not give.

Two kinds. Some show in any bytes: a mark, a length, a check value of their own (BACnet MS/TP: ANSI/ASHRAE 135 clause 9;
HDLC: IEC 62056-46; M-Bus: EN 13757-2; IEC 62056-21; DL/T 645; NMEA 0183), or lines that hold nothing but their own few
characters (Modbus ASCII, DCON, OWEN). Others are meters' own frames with the CRC of Modbus, which look like RTU frames
of odd functions: they are known by lengths and commands that their makers publish.
Prices are bounded: of long bytes the first are looked at.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

from .crc import ALGORITHMS, CRC_TABLE, Algorithm, lrc
from .declaration import USER_DEFINED
from .length_rules import Role
from .lengths import rule, sound_roles
from .limits import CRC_SIZE, EXCEPTION

_MOST: Final = 1 << 12  # bytes looked at
_CHECKS: Final = 64  # check values computed over whole frames
_X25: Final = next(one for one in ALGORITHMS if isinstance(one, Algorithm) and one.name == "CRC-16/X-25")
_ASCII_FRAME: Final = re.compile(rb":((?:[0-9A-Fa-f]{2}){3,255})\r\n?")
_IDENTIFICATION: Final = re.compile(rb"/[A-Z]{2}[A-Za-z][0-9A-Z][ -~]{1,16}\r\n")
_SIGN_ON: Final = re.compile(
    rb"/\?[0-9A-Za-z ]{0,32}!\r\n|\x06[0-9][0-9A-I][0-9A-Z]\r\n|\x01[PRWEB]\d\x02[ -~]{0,64}\x03."
)
_READOUT: Final = re.compile(rb"\x02[ -~\r\n]{4,2000}\x03.", re.S)
_SENTENCE: Final = re.compile(rb"[$!]([A-Z][0-9A-Z]{1,7},[ -)+-~]{0,80})\*([0-9A-F]{2})\r\n?")
_DCON: Final = re.compile(rb"[#$%@~][0-9A-F]{2}[0-9A-Z]{0,12}\r|[!>?][0-9A-Z+\-.]{2,60}\r")
_OWEN: Final = re.compile(rb"#(?:[G-V]{2}){6,22}\r")  # each letter half a byte: address, parameter, data, CRC
_DLT645_HEAD: Final = 10  # bytes before the data


class ForeignFrame(NamedTuple):
    """Bytes [start, end) that are a frame of another protocol."""

    start: int
    end: int


def _mstp(data: bytes) -> Iterator[ForeignFrame]:
    for at in _places(data, b"\x55\xff", 8):
        if mstp_check(data[at + 2 : at + 7]) == data[at + 7]:
            size = int.from_bytes(data[at + 5 : at + 7], "big")
            yield ForeignFrame(at, min(at + 8 + (size + 2 if size else 0), len(data)))


def mstp_check(header: bytes) -> int:
    """The check value of a header of BACnet MS/TP (type, destination, source, length)."""
    check = 0xFF
    for byte in header:
        check ^= byte
        bits = check ^ check << 1 ^ check << 2 ^ check << 3 ^ check << 4 ^ check << 5 ^ check << 6 ^ check << 7
        check = (bits & 0xFE) ^ (bits >> 8 & 1)
    return ~check & 0xFF


def _hdlc(data: bytes) -> Iterator[ForeignFrame]:
    checked = 0
    for at in _places(data, b"\x7e\xa0", 9):
        length = (data[at + 1] & 7) << 8 | data[at + 2]
        if length <= 4 or data[at + 1 + length : at + 2 + length] != b"\x7e" or checked >= _CHECKS:
            continue
        checked += 1
        frame = data[at + 1 : at + 1 + length]
        if _X25(frame[:-2]) == int.from_bytes(frame[-2:], "little"):
            yield ForeignFrame(at, at + 2 + length)


def _mbus(data: bytes) -> Iterator[ForeignFrame]:
    for at in _places(data, b"\x68", 9):
        length = data[at + 1]
        end = at + 4 + length
        if (
            data[at + 2] == length >= 3
            and data[at + 3] == 0x68
            and data[end + 1 : end + 2] == b"\x16"
            and sum(data[at + 4 : end]) & 0xFF == data[end]
        ):
            yield ForeignFrame(at, end + 2)
    for at in _places(data, b"\x10", 5):
        if data[at + 4] == 0x16 and sum(data[at + 1 : at + 3]) & 0xFF == data[at + 3]:
            yield ForeignFrame(at, at + 5)


def _ascii(data: bytes) -> Iterator[ForeignFrame]:
    for match in _ASCII_FRAME.finditer(data):
        frame = bytes.fromhex(match[1].decode())
        if lrc(frame[:-1]) == frame[-1]:
            yield ForeignFrame(*match.span())


def _meter_readout(data: bytes) -> Iterator[ForeignFrame]:
    for pattern in (_IDENTIFICATION, _SIGN_ON):
        for match in pattern.finditer(data):
            yield ForeignFrame(*match.span())
    for match in _READOUT.finditer(data):
        check = 0
        for byte in match[0][1:-1]:
            check ^= byte
        if check == match[0][-1]:
            yield ForeignFrame(*match.span())


def _dlt645(data: bytes) -> Iterator[ForeignFrame]:
    for at in _places(data, b"\x68", 12):
        end = at + _DLT645_HEAD + data[at + 9]
        if (
            data[at + 7] == 0x68
            and data[end + 1 : end + 2] == b"\x16"
            and all((b >> 4 < 10 and b & 15 < 10) or b == 0xAA for b in data[at + 1 : at + 7])  # digits, AA for any
            and sum(data[at:end]) & 0xFF == data[end]
        ):
            yield ForeignFrame(at, end + 2)


def _nmea(data: bytes) -> Iterator[ForeignFrame]:
    for match in _SENTENCE.finditer(data):
        check = 0
        for byte in match[1]:
            check ^= byte
        if check == int(match[2], 16):
            yield ForeignFrame(*match.span())


def _lines_of(pattern: re.Pattern[bytes]) -> Callable[[bytes], Iterator[ForeignFrame]]:
    return lambda data: (ForeignFrame(*match.span()) for match in pattern.finditer(data))


def _places(data: bytes, mark: bytes, length: int) -> Iterator[int]:
    """Where a mark stands with so many bytes behind its beginning."""
    at = data.find(mark)
    while 0 <= at <= len(data) - length:
        yield at
        at = data.find(mark, at + 1)


def _lin(data: bytes) -> Iterator[ForeignFrame]:
    """Frames behind a break and the field 55: identifier with its two parities, data, a sum with carries; or none of
    these, where nobody answers before the next one."""
    for at in _places(data, b"\x55", 4):
        identifier = data[at + 1]
        one, two = (
            (identifier ^ identifier >> 1 ^ identifier >> 2 ^ identifier >> 4),
            (identifier >> 1 ^ identifier >> 3 ^ identifier >> 4 ^ identifier >> 5),
        )
        if identifier >> 6 != (one & 1) | (~two & 1) << 1:
            continue
        begin = at - 1 if at and not data[at - 1] else at
        checked = [
            end
            for end in range(at + 4, min(at + 3 + _LIN_MOST, len(data)) + 1)
            if data[end - 1] in (_lin_check(data[at + 2 : end - 1], 0), _lin_check(data[at + 2 : end - 1], identifier))
        ]
        ends = [end for end in (at + 2, *checked) if data[end : end + 2].startswith((b"\x55", b"\0\x55"))] or checked
        if ends:  # the shortest: with its check value and a break, a frame has a right sum once more
            yield ForeignFrame(begin, ends[0])


def _lin_check(octets: bytes, first: int) -> int:
    total = first
    for byte in octets:
        total += byte
        total -= 0xFF if total > 0xFF else 0
    return ~total & 0xFF


_LIN_MOST: Final = 8  # bytes of data
_MIDI: Final = re.compile(
    rb"(?:\xF8|\xFA|\xFC|\xFE|[\x80-\xBF\xE0-\xEF](?:[\x00-\x7F]{2})+|[\xC0-\xDF][\x00-\x7F]+|\xF0[\x00-\x7F]*\xF7|"
    rb"\xF2[\x00-\x7F]{2}|[\xF1\xF3][\x00-\x7F]|\xF6){4,}"
)
_NMEA: Final = "NMEA 0183 (GPS, ships)"
IN_ANY_BYTES: Final[dict[str, Callable[[bytes], Iterator[ForeignFrame]]]] = {
    "BACnet MS/TP": _mstp,
    "HDLC (DLMS/COSEM meters)": _hdlc,
    "M-Bus": _mbus,
    "Modbus ASCII": _ascii,
    "IEC 62056-21 (meters)": _meter_readout,
    "DL/T 645 (meters)": _dlt645,
    _NMEA: _nmea,
    "LIN": _lin,
    "MIDI": _lines_of(_MIDI),
    "OWEN": _lines_of(_OWEN),
    "DCON": _lines_of(_DCON),
}
TALKERS: Final = frozenset({_NMEA})  # one sends, unasked, to whoever listens
UNCHECKED: Final = frozenset({"OWEN", "DCON", "MIDI"})  # known by the characters of their lines alone
LOOSE: Final = frozenset({"LIN", "MIDI"})  # so short that a few are chance: only what they are most of tells
MERCURY_200: Final = "Mercury 200 (a meter's own, with the CRC of Modbus)"
MERCURY_230: Final = "Mercury 230 (a meter's own, with the CRC of Modbus)"
MILUR: Final = "Milur (a meter's own, with the CRC of Modbus)"
PULSAR: Final = "Pulsar (a meter's own, with the CRC of Modbus)"
SAME_CRC: Final = "a protocol with the CRC of Modbus (meters use it so)"
NAMES: Final = ("", *IN_ANY_BYTES, MERCURY_200, MERCURY_230, MILUR, PULSAR, SAME_CRC)  # by number; 0 is none


def foreign_bytes(data: bytes) -> tuple[str, int, int]:
    """The protocol that most of these bytes are frames of, how many frames, and bytes; ("", 0, 0) for none."""
    best = ("", 0, 0)
    for name, find in IN_ANY_BYTES.items():
        covered = frames = 0
        end = 0
        for frame in sorted(find(data[:_MOST])):
            if frame.start >= end:
                covered, frames, end = covered + frame.end - frame.start, frames + 1, frame.end
        if covered > best[2]:
            best = (name, frames, covered)
    return best


_ANSWERS_200: Final = {  # command of a Mercury 200: bytes of data in its answer
    0x20: 4, 0x21: 7, 0x22: 2, 0x23: 2, 0x24: 1, 0x25: 1, 0x26: 2, 0x27: 16, 0x28: 6, 0x29: 2, 0x2A: 1, 0x2B: 7,
    0x2C: 7, 0x2F: 4, 0x63: 7, 0x65: 1, 0x66: 3, 0x67: 2,
}  # fmt: skip
_SERIAL_200: Final = 5  # first byte of an address at most: eight decimal digits
_FRAME_200: Final = 7  # bytes of a request: address of four, command, CRC
_PULSAR_LENGTH: Final = 5  # where a Pulsar frame says how long it is
_PULSAR_LEAST: Final = 10
_PULSAR: Final = (0, 1, 3, 4, 5, 6, 7, 8, 10, 11)  # its functions
_SHORTEST: Final = 3  # a byte less than a frame has
_LONGEST: Final = 260
_DIAGNOSTICS, _DIAGNOSTICS_ADU, _LAST_DIAGNOSTIC = 8, 8, 0x14  # a function, bytes, a subfunction
_FEW, _SEVERAL = 2, 3  # frames that tell a session
_ECHOED: Final = 8  # one frame in so many repeats the head of the one before
_CHANNEL: Final = 11  # bytes that open a session, of a Mercury 230 and of a Milur


class MeterTalk:
    """Frames of meters with the CRC of Modbus, one after the other as they stand on the line.

    `name` says whose a frame is. It is asked only of frames with a right CRC that are no sound Modbus. A frame that is
    a meter's beyond doubt makes its address known; what else that address says is the meter's, too.
    """

    _known: dict[bytes, str]
    _before: bytes

    def __init__(self) -> None:
        self._known = {}  # by address, of one byte or four
        self._before = b""

    def name(self, adu: bytes, *, undeclared: bool) -> str:
        """The protocol of this frame, or nothing; `undeclared`: nobody has declared its function, which is not
        free for users either."""
        before, self._before = self._before, adu
        size, head = len(adu), adu[:4]
        if (
            size >= _PULSAR_LEAST
            and adu[_PULSAR_LENGTH] == size
            and adu[4] in _PULSAR
            and all(b >> 4 < 10 and b & 15 < 10 for b in head)
        ):
            return PULSAR
        if size >= _FRAME_200:
            due = _ANSWERS_200.get(adu[4])
            requested = size == _FRAME_200 and due is not None and undeclared and adu[0] <= _SERIAL_200
            if requested or (before[:5] == adu[:5] and len(before) == _FRAME_200 and size - _FRAME_200 == due):
                self._known[head] = MERCURY_200
            if self._known.get(head) == MERCURY_200:
                return MERCURY_200
        if (signed := _session(adu)) and adu[:1] not in self._known:
            self._known[adu[:1]] = signed
        return self._known.get(adu[:1], "")

    def in_noise(self, data: bytes) -> tuple[str, int]:
        """Frames of known addresses end to end, which nobody took for RTU: whose they are, and how many bytes."""
        name, at = "", 0
        while at < min(len(data), _MOST):
            protocol = self._known.get(data[at : at + 4]) or self._known.get(data[at : at + 1], "")
            size = _checked(data, at) if protocol and name in ("", protocol) else 0
            if not size:
                break
            name, at = protocol, at + size
        return name, at


class FunctionEchoes:
    """Frames, and whether answers repeat the unit and the function of the one before them, as Modbus has it and a meter
    with its CRC hardly does that nobody has described."""

    frames: int
    _asked: bytes
    _echoes: int

    def __init__(self) -> None:
        self._asked = b""
        self.frames = self._echoes = 0

    def heard(self, adu: bytes) -> None:
        """The next frame. One that is sent once more is no answer."""
        asked, head = self._asked, bytes((adu[0], adu[1] & ~EXCEPTION))
        answers = asked[:2] == head and asked[2:] != adu[2:]
        self._asked = b"" if answers else head + adu[2:]
        self._echoes += answers
        self.frames += 1

    @property
    def are_many(self) -> bool:
        """Half of the frames are broadcasts, perhaps, or answers did not come."""
        return _ECHOED * self._echoes >= self.frames > 0


def checked_frames(data: bytes) -> list[bytes]:
    """The frames with a right CRC of Modbus, of whatever length, that are all of these bytes; none where some are left.

    The shortest each: one that ends sooner by chance is one in 65,536.
    """
    frames, at = list[bytes](), 0
    while at < min(len(data), _MOST):
        size = _checked(data, at)
        if not size and (data[at] or not frames):
            return []
        if size:
            frames.append(data[at : at + size])
        else:  # of a check value whose last byte is 0 the byte before was right already
            frames[-1] += data[at : at + 1]
        at += max(size, 1)
    return frames


def is_legal(adu: bytes) -> bool:
    """Whether a frame with a right CRC may be one of Modbus: a declared function of a right length, or a free one.

    Function 8 is of any length by its declaration; but for loop-backs it has one, and few subfunctions ([1] 6.8).
    """
    if adu[1] == _DIAGNOSTICS and any(adu[2:4]):
        return len(adu) == _DIAGNOSTICS_ADU and adu[2] == 0 and adu[3] <= _LAST_DIAGNOSTIC
    return adu[1] & ~EXCEPTION in USER_DEFINED or bool(sound_roles(adu[1:-CRC_SIZE]))


def session_of(frames: Sequence[bytes]) -> str:
    """The other protocol with the CRC of Modbus that these frames are of, each with a right CRC; nothing where most are
    of Modbus, or too few of anything."""
    talk, names, echoes = MeterTalk(), Counter[str](), FunctionEchoes()
    for adu in frames:
        free = adu[1] & ~EXCEPTION in USER_DEFINED
        name = "" if is_legal(adu) and not free else talk.name(adu, undeclared=is_undeclared(adu[1]))
        if name or not is_legal(adu):
            names[name or SAME_CRC] += 1
            echoes.heard(adu)
    known = names.total() - names[SAME_CRC]
    legal = len(frames) - names.total()
    if names.total() < (_FEW if known else _SEVERAL) or names.total() <= 2 * legal:
        return ""
    if not known and echoes.are_many:
        return ""
    return (
        max(names, key=lambda name: (names[name], name))
        if not known
        else max(names.keys() - {SAME_CRC}, key=names.__getitem__)
    )


def is_undeclared(function: int) -> bool:
    """Whether nobody has declared a function byte, which is not free for users either."""
    code = function & ~EXCEPTION
    return code not in USER_DEFINED and (function > EXCEPTION or rule(function, Role.REQUEST) is None)


def _checked(data: bytes, at: int) -> int:
    """The bytes of the shortest frame from `at` on that ends in a right CRC of Modbus; 0 for none."""
    crc, table = 0xFFFF, CRC_TABLE
    for i in range(at, min(len(data), at + _LONGEST)):
        crc = (crc >> 8) ^ table[(crc ^ data[i]) & 0xFF]
        if not crc and i - at >= _SHORTEST:
            return i + 1 - at
    return 0


def _session(adu: bytes) -> str:
    """Whose a frame is that opens, tests or closes a session, or that carries its own length; nothing for none."""
    size, function = len(adu), adu[1]
    if size == _CHANNEL and function == 0x08 and adu[2] in (0, 1, 2):
        return MILUR
    if size == _CHANNEL and function == 0x01 and adu[2] in (1, 2):
        return MERCURY_230
    return MERCURY_230 if size == 4 and function == 0 else ""
