"""RTU, ASCII and TCP: what stands around the same PDU.

RTU [2] 2.5.1: unit, PDU, CRC. ASCII [2] 2.5.2: `:`, two hex digits a byte, LRC, CR LF, 7-bit characters. TCP [3] 3.1.3:
transaction, protocol 0, length, unit, PDU, no check value. Bytes never raise: what is missing is None.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from .crc import crc16, lrc

Protocol = Literal["rtu", "ascii", "tcp", "pdu"]  # the last: a PDU by itself, as documents show them

MBAP: Final = 7  # bytes from transaction to unit
_HEX: Final = {ord(digit): value for value, digit in enumerate("0123456789abcdef")} | {
    ord(digit): value for value, digit in enumerate("ABCDEF", 10)
}
_STARTS: Final = b":>"  # `>` was seen on real devices in place of the colon
_CR: Final = 0x0D
_LF: Final = 0x0A
_LEAST_ASCII: Final = 3  # unit, function, LRC


_BEFORE: Final[dict[Protocol, int]] = {"rtu": 1, "ascii": 1, "tcp": MBAP, "pdu": 0}  # bytes before the PDU


@dataclass(frozen=True, slots=True)
class Adu:
    """One frame, taken apart as far as its envelope goes.

    `data`: RTU the whole frame, ASCII the decoded bytes from unit to LRC, TCP MBAP and PDU. `start` and `length` are
    its extent in the bytes it was found in. `check_ok` is None for TCP and a PDU alone, which have no check
    value; False where a frame is too short to hold one. Check values are numbers (a CRC sent as `84 0A` is 0A84).
    """

    protocol: Protocol
    data: bytes
    unit: int | None
    pdu: bytes
    check_ok: bool | None
    check_received: int | None
    check_computed: int | None
    start: int
    length: int

    @property
    def pdu_at(self) -> int:
        """Where the PDU begins in `data`."""
        return _BEFORE[self.protocol]


def rtu(data: bytes) -> Adu:
    """These bytes as one RTU frame, whatever they are."""
    unit = data[0] if data else None
    if len(data) < 4:
        return Adu("rtu", data, unit, data[1:], False, None, None, 0, len(data))
    received = int.from_bytes(data[-2:], "little")
    computed = crc16(data[:-2])
    return Adu("rtu", data, unit, data[1:-2], received == computed, received, computed, 0, len(data))


def ascii_adu(data: bytes, start: int = 0, length: int | None = None) -> Adu:
    """Decoded bytes (unit to LRC) as one ASCII frame; `start` and `length` say where its characters were."""
    extent = len(data) if length is None else length
    unit = data[0] if data else None
    if len(data) < _LEAST_ASCII:
        return Adu("ascii", data, unit, data[1:], False, None, None, start, extent)
    received, computed = data[-1], lrc(data[:-1])
    return Adu("ascii", data, unit, data[1:-1], received == computed, received, computed, start, extent)


def ascii_frames(raw: bytes) -> list[Adu]:
    """The ASCII frames in some characters; the eighth bit, letter case and a missing CR LF do not matter.

    A frame runs from its start character to the first one that is no hex digit (CR and LF after it belong to it);
    fewer than three bytes (as in the time `12:30:05`) are none. A last odd digit is dropped, and the LRC then tells.
    """
    characters = bytes(byte & 0x7F for byte in raw)
    frames: list[Adu] = []
    at = 0
    while at < len(characters):
        if characters[at] not in _STARTS:
            at += 1
            continue
        end = at + 1
        while end < len(characters) and characters[end] in _HEX:
            end += 1
        digits = characters[at + 1 : end]
        data = bytes(_HEX[digits[i]] << 4 | _HEX[digits[i + 1]] for i in range(0, len(digits) - 1, 2))
        for terminator in (_CR, _LF):
            if end < len(characters) and characters[end] == terminator:
                end += 1
        if len(data) >= _LEAST_ASCII:
            frames.append(ascii_adu(data, at, end - at))
        at = end
    return frames


def bare(data: bytes, start: int = 0) -> Adu:
    """These bytes as a PDU alone, without unit and check value."""
    return Adu("pdu", data, None, data, None, None, None, start, len(data))


def tcp(data: bytes, start: int = 0) -> Adu:
    """These bytes as one TCP frame, whatever they are."""
    unit = data[MBAP - 1] if len(data) >= MBAP else None
    return Adu("tcp", data, unit, data[MBAP:], None, None, None, start, len(data))


def tcp_frames(raw: bytes) -> list[Adu]:
    """The ADUs of a TCP stream, one after another, as long as MBAP headers follow (protocol 0, length 2 to 254).

    The last may be cut short. What no header covers is outside frames: see `start` and `length`.
    """
    frames: list[Adu] = []
    at = 0
    while at + MBAP < len(raw):
        protocol = int.from_bytes(raw[at + 2 : at + 4], "big")
        length = int.from_bytes(raw[at + 4 : at + 6], "big")
        if protocol or not 2 <= length <= 254:
            break
        frames.append(tcp(raw[at : at + MBAP - 1 + length], at))
        at += MBAP - 1 + length
    return frames
