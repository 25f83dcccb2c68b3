"""Frames that were whole when they were sent, by a sender with another parity or other stop bits.

Of the same speed: then each bit that was heard is one that was sent. A receiver that finds no stop bit either takes that
bit for the next start, as many UARTs do, or waits for the line to rest. So what stands between two of its characters
follows from how the sender makes its own; few bytes can have been meant, and the check value tells which.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from math import log2
from typing import Final, NamedTuple

from dissectors.crc import crc16

from .rawbytes import CharacterFormat, other_formats

_CHECKED: Final = 16.0  # bits of a check value
_MANY: Final = 1 << 9  # frames that may have been sent: so many say little


def formats_as_fast(line: CharacterFormat) -> Iterator[CharacterFormat]:
    """The other formats of a line's speed that carry whole bytes."""
    for each, drift in other_formats(line):
        if each.baud == line.baud and each.data_bits == line.data_bits and not drift and each != line:
            yield each


class _Sent(NamedTuple):
    """What may have been sent so far: bytes, and the bits of the one that goes on; `begun`: a start bit is the last one."""

    data: bytes = b""
    bits: tuple[int, ...] = ()
    begun: bool = False


class _Sender(NamedTuple):
    """A sender of a frame of which the header is known."""

    form: CharacterFormat
    header: bytes
    due: int

    def then(self, so_far: _Sent, *bits: int) -> _Sent | None:
        """With these bits behind; None where it does not send so."""
        data, mine = so_far.data, so_far.bits
        for bit in bits:
            if len(data) == self.due:
                if not bit:
                    return None
                continue
            mine = (*mine, bit)
            if len(mine) <= self.form.data_bits:
                if mine[0]:
                    return None
                continue
            byte = sum(level << i for i, level in enumerate(mine[1 : self.form.data_bits + 1]))
            whole = self.form.bits(byte)
            if list(mine) != whole[: len(mine)] or byte != (*self.header, *[byte] * self.due)[len(data)]:
                return None
            if len(mine) == len(whole):
                data, mine = data + bytes((byte,)), ()
        return _Sent(data, mine)

    def resting(self, so_far: _Sent | None) -> Iterator[_Sent]:
        """As long as it may rest there, or send ones."""
        for _ in range(len(self.form.bits(0))):
            if so_far is None:
                return
            yield so_far
            so_far = self.then(so_far, 1)


def _heard(sender: _Sender, way: _Sent, byte: int, receiver: CharacterFormat, *, restarts: bool) -> Iterator[_Sent]:
    """What may have been sent where a receiver got this byte next."""
    data = [byte >> i & 1 for i in range(receiver.data_bits)]
    starts = [way] if way.begun else [sender.then(each, 0) for each in sender.resting(way)]
    for parity in ((),) if receiver.parity == "N" else ((0,), (1,)):
        for start in starts:
            ended = sender.then(start, *data, *parity) if start is not None else None
            if ended is None:
                continue
            if (well := sender.then(ended, 1)) is not None:
                yield well
            low = sender.then(ended, 0)
            while low is not None:
                if restarts:
                    yield low._replace(begun=True)
                    break
                if (rested := sender.then(low, 1)) is not None:
                    yield rested
                low = sender.then(low, 0)


@lru_cache(maxsize=1 << 10)
def sent_as(heard: bytes, header: bytes, due: int, form: CharacterFormat, receiver: CharacterFormat) -> float:
    """Bits for a frame of `due` bytes that begins by this header and whose check value is right, had it been sent so; 0
    where it cannot have been."""
    sender, best = _Sender(form, header, due), 0.0
    for restarts in (True, False):
        ways = {_Sent()}
        for byte in heard:
            ways = {sent for way in ways for sent in _heard(sender, way, byte, receiver, restarts=restarts)}
            if not 0 < len(ways) <= _MANY:
                break
        else:
            ended = {sender.then(way, *[1] * len(form.bits(0))) for way in ways}
            sent = {each.data for each in ended if each is not None and len(each.data) == due}
            if any(crc16(data) == 0 for data in sent):
                best = max(best, _CHECKED - log2(len(sent)))
    return best
