"""The bus in time: exchanges become bytes on a wire, each with the end of its stop bit, and faults happen to them.

Every byte is here once, in order, and a frame knows where its bytes stand. Times are ns since the capture began.

    request, answer       3.5 characters of silence at least before either
    no answer             the client waits 200 to 220 ms, then asks again or goes on
    late answer           the answer comes while the client waits for that to its next request
    broadcast             nobody answers; the client waits 100 to 200 ms
    glitch                a driver is switched: 00, FF, FE about a character away from a frame
    stray                 noise between two exchanges

Who talks on a wire and what goes wrong there, in shares of frames or of exchanges, is an entry in `WIRES`. What a fault
does is a function from what was sent to what arrives; a byte that is lost is None in its place, since its time passes
all the same.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from random import Random
from types import MappingProxyType

from .chances import Chances
from .conversation import Asking, Exchange
from .truth import TruthFrame

_COLLISION = 16  # bytes: no longer do two servers talk at once

Spoilt = list[int | None]


def _flip(random: Random, sent: bytes) -> Spoilt:
    data: Spoilt = list(sent)
    at = random.randrange(len(sent))
    data[at] = sent[at] ^ 1 << random.randrange(8)
    return data


def _drop(random: Random, sent: bytes) -> Spoilt:
    data: Spoilt = list(sent)
    data[random.randrange(len(sent))] = None
    return data


def _truncate(random: Random, sent: bytes) -> Spoilt:
    return list(sent[: random.randint(1, len(sent) - 1)])


def _collide(random: Random, sent: bytes) -> Spoilt:
    # A bit is 0 where either of the two sends 0.
    noise = random.randbytes(min(len(sent), _COLLISION))
    return [ours & theirs for ours, theirs in zip(sent, noise, strict=False)] + list[int | None](sent[_COLLISION:])


FAULTS: Mapping[str, Callable[[Random, bytes], Spoilt]] = MappingProxyType(
    {"flip": _flip, "drop": _drop, "trunc": _truncate, "collide": _collide}
)


@dataclass(frozen=True, slots=True)
class Wire:
    """What a wire does, as probabilities.

    Of the conversation: `public`, that its servers know all public functions and not only the common ones; `vendor`,
    the weight of an undocumented function beside a common one's 1; `hostile`, the share of register reads answered
    with a payload meant to fool a CRC scan; `broadcast`, the share of requests.

    Of each frame: `flip` of a bit, `drop` of a byte, holes inside (`slow`), stray bytes hard before it and, drawn
    apart, hard after it (`glitch`); of a response also `truncate` and `collide`, with another server's.

    Of each exchange: `silent`, no answer; `late`, the answer comes after the next request; `stray`, noise before it.
    """

    public: float = 0.5
    vendor: int = 0
    hostile: float = 0.0
    broadcast: float = 0.0
    flip: float = 0.0
    drop: float = 0.0
    truncate: float = 0.0
    collide: float = 0.0
    slow: float = 0.0
    glitch: float = 0.0
    silent: float = 0.0
    late: float = 0.0
    stray: float = 0.0


_NOISY = Wire(flip=0.018, drop=0.02, truncate=0.02, collide=0.018, silent=0.03, late=0.01, stray=0.1)

WIRES: Mapping[str, Wire] = MappingProxyType(
    {
        "clean": Wire(),
        "hard": Wire(hostile=0.36),
        "slow-slave": Wire(slow=0.3),
        "noisy": _NOISY,
        "glitch": Wire(glitch=0.3, silent=0.045),
        "vendor": Wire(public=0.0, vendor=2, flip=0.01, silent=0.02),
        "broadcast": Wire(broadcast=0.04),
        "brutal": replace(
            _NOISY,
            public=1.0,
            vendor=1,
            hostile=0.3,
            broadcast=0.01,
            flip=0.055,
            drop=0.055,
            truncate=0.05,
            collide=0.05,
            slow=0.11,
            glitch=0.15,
            silent=0.08,
            late=0.035,
            stray=0.3,
        ),
    }
)


MS = 1e6  # ns
_START_NS = 100 * MS
_TIMEOUT_NS = 200 * MS
_T35 = 3.5  # characters
_LONGEST_HOLE_NS = 25 * MS
_SHORTEST_HOLE = 1.6  # characters
_HOLE_SHARE = 0.16  # of the places between bytes of a frame with holes
_GLITCH_BYTES = (0x00, 0x00, 0x00, 0xFF, 0xFE)
_GLITCH_BEFORE, _GLITCH_AFTER = (1, 1, 2), (1, 1, 2, 4)  # bytes
_GLITCH_GAP = 0.6  # characters


@dataclass(frozen=True, slots=True)
class WireBytes:
    """What passed on the wire: bytes, the end of each one's stop bit (ns), and the frames that they belong to."""

    data: bytes
    times: array[float]
    frames: tuple[TruthFrame, ...]


class PassingBytes:
    """What passes on a wire, kept until somebody takes it: bytes with their times, and frames, numbered and placed as
    in the whole stream."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.times = array("d")
        self.frames: list[TruthFrame] = []
        self._bytes_taken = 0
        self._frames_taken = 0

    @property
    def end(self) -> int:
        """Bytes that have passed since the capture began."""
        return self._bytes_taken + len(self.data)

    @property
    def number(self) -> int:
        """Of the next frame."""
        return self._frames_taken + len(self.frames)

    def taken(self) -> WireBytes:
        """What has passed since the last time."""
        piece = WireBytes(bytes(self.data), self.times, tuple(self.frames))
        self._bytes_taken += len(self.data)
        self._frames_taken += len(self.frames)
        self.data, self.times, self.frames = bytearray(), array("d"), []
        return piece


def play(client: Asking, wire: Wire, chances: Chances, transactions: int, character_ns: float) -> Iterator[WireBytes]:
    """`transactions` requests, repeated ones included, and what came of each, an exchange at a time."""
    line = _Line(wire, chances, character_ns)
    for _ in line.run(client, transactions):
        yield line.passing.taken()


class _Line:
    def __init__(self, wire: Wire, chances: Chances, character_ns: float) -> None:
        self.passing = PassingBytes()
        self._wire = wire
        self._random = chances.faults
        self._pace = chances.pace
        self._character = character_ns
        self._now = _START_NS
        self._request_faults = ((wire.flip, "flip"), (wire.drop, "drop"))
        self._response_faults = (*self._request_faults, (wire.truncate, "trunc"), (wire.collide, "collide"))

    def run(self, client: Asking, transactions: int) -> Iterator[None]:
        """Each step is an exchange that is over."""
        random, pace, wire = self._random, self._pace, self._wire
        again: Exchange | None = None
        left = transactions
        while left:
            left -= 1
            if again is None and random.random() < wire.stray:
                self._stray()
            exchange = again or client.exchange()
            again = None
            request = self._frame("request", exchange.request, None)
            if exchange.response is None:
                self._now += pace.uniform(100, 200) * MS
            elif not request.intact or random.random() < wire.silent:
                self._now += _TIMEOUT_NS + random.uniform(0, 20) * MS
                again = exchange if random.random() < 0.5 else None
            elif left and random.random() < wire.late:
                left -= 1
                self._late(client, exchange.response, request.id)
            else:
                self._now += max(exchange.response_ns * pace.uniform(0.8, 1.2), _T35 * self._character)
                self._frame("response", exchange.response, request.id)
                self._now += _T35 * self._character + self._pause()
            yield

    def _pause(self) -> float:
        """What a client waits beyond the silence that the specification asks for."""
        kind = self._pace.randrange(3)
        if kind == 0:
            return 0.5 * MS
        return self._pace.uniform(1, 9) * MS if kind == 1 else self._pace.uniform(9, 100) * MS

    def _late(self, client: Asking, response: bytes, request: int) -> None:
        """The answer comes after the next request, which gets none of its own."""
        self._now += _TIMEOUT_NS
        self._frame("request", client.exchange().request, None)
        self._now += _T35 * self._character + self._random.uniform(1, 4) * MS
        self._frame("response", response, request)
        self._now += _TIMEOUT_NS

    def _frame(self, direction: str, sent: bytes, pair: int | None) -> TruthFrame:
        random, wire = self._random, self._wire
        if wire.glitch and random.random() < wire.glitch:
            self._glitch(random.choice(_GLITCH_BEFORE))
            self._now += random.uniform(0, 2 * _GLITCH_GAP) * self._character
        fault = self._fault(self._request_faults if pair is None else self._response_faults)
        start = self.passing.end
        if wire.slow and random.random() < wire.slow:
            self._send_spoilt(FAULTS[fault](random, sent) if fault else sent, _HOLE_SHARE)
        elif fault:
            self._send_spoilt(FAULTS[fault](random, sent), 0)
        else:
            self._send(sent)
        frame = TruthFrame(
            id=self.passing.number,
            direction=direction,
            unit=sent[0],
            function=sent[1] & 0x7F,
            adu=sent,
            pair=pair,
            start=start,
            length=self.passing.end - start,
            fault=fault,
        )
        self.passing.frames.append(frame)
        if wire.glitch and random.random() < wire.glitch:
            self._now += random.uniform(0, _GLITCH_GAP) * self._character
            self._glitch(random.choice(_GLITCH_AFTER))
        return frame

    def _fault(self, shares: tuple[tuple[float, str], ...]) -> str | None:
        point = self._random.random()
        for share, name in shares:
            point -= share
            if point < 0:
                return name
        return None

    def _send(self, data: bytes) -> None:
        now, character = self._now, self._character
        self.passing.data += data
        self.passing.times.extend([now + character * i for i in range(1, len(data) + 1)])
        self._now = now + character * len(data)

    def _send_spoilt(self, data: Sequence[int | None], holes: float) -> None:
        random = self._random
        for i, byte in enumerate(data):
            if i and holes and random.random() < holes:
                self._now += random.uniform(_SHORTEST_HOLE * self._character, _LONGEST_HOLE_NS)
            self._now += self._character
            if byte is not None:
                self.passing.data.append(byte)
                self.passing.times.append(self._now)

    def _glitch(self, length: int) -> None:
        random = self._random
        for i in range(length):
            if i:
                self._now += random.uniform(0, _GLITCH_GAP) * self._character
            self._send(bytes((random.choice(_GLITCH_BYTES),)))

    def _stray(self) -> None:
        random = self._random
        self._send(bytes(random.choice((0x00, 0xFF, random.getrandbits(8))) for _ in range(random.randint(1, 4))))
        self._now += random.uniform(0, 2 * _T35) * self._character
