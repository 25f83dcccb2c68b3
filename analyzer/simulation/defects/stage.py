"""A healthy bus on which defects are put, and the one collection of those: an entry a code of the findings' table.

The bus: a master that polls its list in turn, answers in time, silences kept. Nothing that happens here by itself
deserves an error or a warning: requests are distinct and recur, no exceptions, all units answer within 4 to 8 ms, the
line is idle half of the time. A defect takes the next poll and spoils it, or does things of its own; what it does wrong
it says with `found`. Times are ns since the capture began.

    @defect("no-response")
    def no_response(stage: Stage) -> None:
        \"\"\"A unit is silent for once.\"\"\"
        ...

A module of `analyzer.simulation.defects` holds such functions; nothing lists the modules. A function puts the defect on
the stage once, from an idle line to an idle line. One that shapes the whole capture (`whole=True`) is called once, with
the number of exchanges that the capture should have, and yields after each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, TypeVar

from ...registry import Registry
from ..chances import Chances
from ..conversation import Client, Exchange, Habits, adu
from ..devices import Device
from ..line import PassingBytes
from ..truth import TruthFinding, TruthFrame

MS: Final = 1e6  # ns
TIMEOUT_NS: Final = 250 * MS  # that the master waits for an answer
BROADCAST_NS: Final = 130 * MS  # that it waits after a broadcast: over the 100 ms of [2] 2.4.1
_FIRST_NS: Final = 100 * MS
_T35: Final = 3.5  # characters ([2] 2.5.1.1)
_T35_LEAST_NS: Final = 1.75 * MS  # above 19200 bit/s
_POLLS: Final = 12
_ANSWERS_MS: Final = (4.0, 8.0)
_IDLE_MS: Final = (20.0, 60.0)
_TRIES: Final = 400
_READS: Final = range(1, 5)


class Stage:
    """The line, and the master's list of polls."""

    def __init__(self, chances: Chances, character_ns: float, units: int) -> None:
        self.random = chances.faults
        self._pace = chances.pace
        self._bus = chances.bus
        self.character = character_ns
        self.silence = max(_T35 * character_ns, _T35_LEAST_NS)
        self.client = Client(chances.bus, Habits(False, 0, 0.0, 0.0, 0.0), units)
        for device in self.client.devices:
            device.response_ns = chances.bus.uniform(*_ANSWERS_MS) * MS
        self.passing = PassingBytes()
        self.errors: list[int] = []  # offsets of bytes that the UART marked
        self.findings: list[TruthFinding] = []
        self.now = _FIRST_NS
        self.idle_ms = _IDLE_MS
        self.polls = self._list()
        self._turn = 0
        self._stranger = self.client.by(self.random)

    def _list(self) -> list[Exchange]:
        """Polls no two of which one could do."""
        chosen: dict[tuple[int, int], Exchange] = {}
        for _ in range(_TRIES):
            exchange = self.client.exchange()
            key = (exchange.request[0], exchange.request[1])
            if key not in chosen and (key[1] in _READS or len(chosen) >= _POLLS // 2):
                chosen[key] = exchange
            if len(chosen) == _POLLS:
                break
        polls = list(chosen.values())
        self._bus.shuffle(polls)
        return polls

    def device(self, unit: int) -> Device:
        return next(device for device in self.client.devices if device.unit == unit)

    def next(self, functions: Iterable[int] | None = None) -> Exchange:
        """The next poll, with a fresh answer; of these functions only, if any are on the list."""
        wanted = None if functions is None else set(functions)
        for _ in self.polls:
            exchange = self.polls[self._turn % len(self.polls)]
            self._turn += 1
            if wanted is None or exchange.request[1] in wanted:
                break
        else:
            if wanted is not None:
                return self.made(self.random.choice(sorted(wanted)))
        device = self.device(exchange.request[0])
        answer = device.answer(self._bus, exchange.request[1:-2])
        return Exchange(exchange.request, adu(device.unit, answer), device.response_ns)

    def made(self, function: int) -> Exchange:
        """An exchange of this function that is not on the list."""
        while True:
            exchange = self._stranger.exchange()
            if exchange.request[1] == function:
                return exchange

    def healthy(self, exchanges: int) -> Iterator[None]:
        """So many polls, answered as they should be, a step each."""
        for _ in range(exchanges):
            self.play(self.next())
            yield

    def play(self, exchange: Exchange) -> tuple[TruthFrame, TruthFrame]:
        """One exchange as it should be, and the pause after it."""
        request = self.ask(exchange.request)
        assert exchange.response is not None
        response = self.answer(exchange.response, request, exchange.response_ns)
        self.pause()
        return request, response

    def ask(self, sent: bytes, captured: bytes | None = None, **how: Any) -> TruthFrame:
        """A request now; see `send`."""
        return self.send("request", sent, None, captured, **how)

    def answer(
        self,
        sent: bytes,
        request: TruthFrame,
        after_ns: float = 6 * MS,
        captured: bytes | None = None,
        **how: Any,
    ) -> TruthFrame:
        """A response after so long, 3.5 characters at least; see `send`."""
        self.now += max(after_ns * self._pace.uniform(0.9, 1.1), 1.1 * self.silence)
        return self.send("response", sent, request.id, captured, **how)

    def send(
        self,
        direction: str,
        sent: bytes,
        pair: int | None,
        captured: bytes | None = None,
        *,
        fault: str | None = None,
        holes: Mapping[int, float] | None = None,
        marked: Sequence[int] = (),
    ) -> TruthFrame:
        """A frame on the wire: `captured` is what is left of `sent`, silent for `holes` (ns) before these of its bytes,
        `marked` by the UART where it had parity or framing errors."""
        captured = sent if captured is None else captured
        start = self.passing.end
        self.errors.extend(start + at for at in marked)
        for at, byte in enumerate(captured):
            self.put(byte, (holes or {}).get(at, 0.0))
        frame = TruthFrame(
            id=self.passing.number,
            direction=direction,
            unit=sent[0],
            function=sent[1] & 0x7F,
            adu=sent,
            pair=pair,
            start=start,
            length=len(captured),
            fault=fault if captured == sent else fault or "damaged",
        )
        self.passing.frames.append(frame)
        return frame

    def put(self, byte: int, after_ns: float = 0.0) -> None:
        """One byte on the wire, after so much silence."""
        self.now += after_ns + self.character
        self.passing.data.append(byte)
        self.passing.times.append(self.now)

    def pause(self) -> None:
        """What the master waits before its next request."""
        self.now += self.silence + self._pace.uniform(*self.idle_ms) * MS

    def unanswered(self) -> None:
        """What it waits in vain."""
        self.now += TIMEOUT_NS + self._pace.uniform(0, 20) * MS

    def found(self, code: str, frame: TruthFrame, also: tuple[str, ...] = (), **detail: Any) -> None:
        """This is wrong with this frame."""
        self.findings.append(TruthFinding(code, frame.start, frame.length, detail, also))

    def found_at(self, code: str, start: int, also: tuple[str, ...] = (), **detail: Any) -> None:
        """This is wrong with the bytes from `start` on to the newest."""
        self.findings.append(TruthFinding(code, start, self.passing.end - start, detail, also))

    def found_on_bus(self, code: str, **detail: Any) -> None:
        """This is wrong with the bus as a whole."""
        self.findings.append(TruthFinding(code, -1, 0, detail))


EVERY_TAP: Final = ("precise", "irq", "ftdi16", "gateway", "untimed")
TIMED: Final = ("precise",)  # what silences say needs a tap that sees them


@dataclass(frozen=True, slots=True)
class Defect:
    """A defect that can be put on a stage; `taps` are those that can carry its evidence, `units` the fewest that
    it takes."""

    code: str
    place: Callable[..., Iterator[None] | None]
    taps: tuple[str, ...] = EVERY_TAP
    whole: bool = False
    units: int = 1

    @property
    def words(self) -> str:
        """What happens, in a sentence."""
        return (self.place.__doc__ or "").strip().splitlines()[0]

    def put(self, stage: Stage, exchanges: int) -> Iterator[None]:
        """The whole capture: healthy exchanges with this defect, some 30 times in 400 of them. Steps as `healthy`."""
        if self.whole:
            yield from self.place(stage, exchanges) or ()
            return
        yield from stage.healthy(_WARM_UP)
        for _ in range(max(1, exchanges // _APART)):
            yield from stage.healthy(stage.random.randint(_APART - 6, _APART + 2))
            self.place(stage)
            yield
        yield from stage.healthy(_LAST)


_WARM_UP: Final = 14  # exchanges: each poll once
_APART: Final = 12
_LAST: Final = 3

_F = TypeVar("_F", bound=Callable[..., Iterator[None] | None])
_DEFECTS: Final = Registry[Defect]("analyzer.simulation.defects", "defect")


def defect(code: str, **how: Any) -> Callable[[_F], _F]:
    """Enters a function as the defect of this code."""

    def enter(place: _F) -> _F:
        _DEFECTS.enter(code, Defect(code, place, **how))
        return place

    return enter


@cache
def defects() -> Mapping[str, Defect]:
    """All defects, by code."""
    return _DEFECTS.by_name()
