"""A client that polls one unit, and a unit that may queue: frames with their truth, for tests of whose an answer is."""

from __future__ import annotations

from random import Random

from captures import Chunk, LineSettings
from dissectors.crc import crc_bytes

MS = 1_000_000
LINE = LineSettings(baud=9600, char_bits=11)
POLLS = [bytes((9, 3, 0, 16 * i, 0, 2)) for i in range(4)]


def adu(body: bytes) -> bytes:
    return body + crc_bytes(body)


class Talk:
    """Frames one after the other, each as one read at its end; where each began."""

    def __init__(self, seed: int = 1, *, alike: bool = False) -> None:
        self.random, self.alike = Random(seed), alike
        self.now, self.offset = 1000 * MS, 0
        self.chunks: list[Chunk] = []
        self.truth: dict[int, int] = {}  # start of an answer: that of its request

    def send(self, frame: bytes, pause_ms: float = 20) -> int:
        start = self.offset
        self.now += round((pause_ms + len(frame) * 1.15) * MS)
        self.chunks.append(Chunk(self.now, frame))
        self.offset += len(frame)
        return start

    def ask(self, poll: int, pause_ms: float = 20) -> tuple[int, int]:
        return poll, self.send(adu(POLLS[poll]), pause_ms)

    def answer(self, asked: tuple[int, int], pause_ms: float = 15) -> int:
        poll, request = asked
        level = 0 if self.alike else 7000 * poll + self.random.randrange(40)
        words = level.to_bytes(2) + (0 if self.alike else 30000 + 900 * poll).to_bytes(2)
        start = self.send(adu(bytes((9, 3, 4)) + words), pause_ms)
        self.truth[start] = request
        return start

    def rounds(self, count: int) -> None:
        for i in range(4 * count):
            self.answer(self.ask(i % 4))

    def shifted(self, count: int, *, ends: bool = True) -> list[int]:
        """A silence, and from then on each answer comes behind the next request; it ends by one in a gap, or not."""
        displaced, open_one = [], self.ask(0)
        self.now += 300 * MS
        for i in range(1, count + 1):
            following = self.ask(i % 4)
            displaced.append(self.answer(open_one))
            open_one = following
        if ends:
            self.now += 200 * MS
            self.answer(open_one)
        return displaced
