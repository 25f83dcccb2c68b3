"""The line between the drawn clients and devices of `ask_devices`: what a tap hears of what they ask and answer."""

from __future__ import annotations

from array import array
from random import Random

from ask_devices import Drawn

from analyzer.simulation.taps import TAPS
from captures.chunks import Chunk
from dissectors.crc import crc_bytes


class _DrawnLine:
    """Bytes on the line, with the times (ns) of their ends."""

    def __init__(self, char_ns: float) -> None:
        self.char_ns, self.now = char_ns, 5e7
        self.data, self.times = bytearray(), array("d")

    def send(self, frame: bytes) -> None:
        """A frame from now on."""
        for octet in frame:
            self.now += self.char_ns
            self.data.append(octet)
            self.times.append(self.now)


def chunks_of(drawn: Drawn, tap: str, random: Random) -> list[Chunk]:
    """What a tap delivers of the client's rounds."""
    baud = drawn.header.baud or 9600
    line = _DrawnLine(11e9 / baud)
    pause, cycle = random.uniform(5e6, 3e7) + 5 * line.char_ns, random.choice((0.0, 0.0, 5e8))
    cycle = cycle if drawn.cycle_s is None else drawn.cycle_s * 1e9
    for turn in range(drawn.rounds):
        began = line.now
        for unit, pdu in [*drawn.polls, *drawn.extra(turn)]:
            if drawn.skips(line.now / 1e9, unit, pdu):
                continue
            for _ in range(1 + drawn.retries):
                if _asked(drawn, unit, pdu, line, random):
                    break
            line.now += pause * random.uniform(1, 1.3)
        line.now = max(line.now, began + cycle)
    return list(TAPS[tap].deliver(bytes(line.data), line.times, random, line.char_ns))


def _asked(drawn: Drawn, unit: int, pdu: bytes, line: _DrawnLine, random: Random) -> bool:
    """Whether the client is content with what it got."""
    body = bytes((unit,)) + pdu
    line.send(body + crc_bytes(body))
    asked, device = line.now, drawn.devices.get(unit)
    answer = None
    if device is not None and not device.is_down(line.now / 1e9):
        code = device.state(line.now / 1e9, pdu)
        answer = bytes((pdu[0] | 0x80, code)) if code else device.answer(pdu)
    if answer is not None:
        line.now += random.uniform(3e6, 2e7) + 4 * line.char_ns
        frame = bytearray(bytes((unit,)) + answer)
        frame += crc_bytes(bytes(frame))
        hit = random.random() < drawn.noise
        if hit:
            frame[random.randrange(len(frame))] ^= 1 << random.randrange(8)
        line.send(bytes(frame))
        if not hit and (
            pdu[0] not in (3, 4) or answer[0] & 0x80 or len(answer) == 2 + 2 * int.from_bytes(pdu[3:5], "big")
        ):
            return True
    line.now = max(line.now, asked + drawn.timeout_s * 1e9)
    return False
