"""When reads are told: how long a frame waits counts from its end, and what was told with a tick waits for nothing."""

from __future__ import annotations

from dataclasses import dataclass, field

from captures.chunks import Block
from captures.live.batching import ReadBatching
from captures.live.wire import Decoder, Tick

_MS = 1_000_000


@dataclass
class _Clock:
    t_ns: int = 0

    def now(self) -> int:
        return self.t_ns

    def step(self) -> int | None:
        return None


@dataclass
class _Told:
    """A batching of reads with what it tells: times of reads told together, and of ticks, each with when."""

    clock: _Clock = field(default_factory=_Clock)
    told: list[tuple[int, list[float]]] = field(default_factory=list)
    ticks: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.decoder = Decoder()
        self.batching = ReadBatching(
            self.clock,  # type: ignore[arg-type]
            self._sent,
            hold_ns=20 * _MS,
            quiet_ns=8 * _MS,
            idle_ns=50 * _MS,
        )

    def _sent(self, data: bytes) -> None:
        for item in self.decoder.feed(data):
            if isinstance(item, Block):
                self.told.append((self.clock.t_ns // _MS, (item.t_ns / _MS).tolist()))
            elif isinstance(item, Tick):
                self.ticks.append(item.t_ns / _MS)

    def reads(self, *times_ms: float) -> None:
        """Reads at these times, and the calls that it wants between them."""
        for t_ms in times_ms:
            self.until(t_ms)
            self.batching.read(self.clock.t_ns, 0, b"\1", ())

    def until(self, t_ms: float) -> None:
        while self.batching.deadline <= int(t_ms * _MS):
            self.clock.t_ns = max(self.clock.t_ns, self.batching.deadline)
            self.batching.due(self.clock.t_ns)
        self.clock.t_ns = int(t_ms * _MS)


def test_a_frame_waits_from_its_end_to_the_next_pause_or_a_little_longer() -> None:
    """Reads of one frame, then others with pauses before them: told by the first that comes late enough."""
    line = _Told()
    line.reads(100, 101, 102, 105, 110, 115, 121, 123)  # the first frame ends at 102: at 121 it has waited for 19 ms
    assert line.told == [(123, [100, 101, 102, 105, 110, 115, 121, 123])]
    assert line.ticks[-1] == 123


def test_a_read_that_is_told_while_more_may_follow_it_waits_from_then_on() -> None:
    line = _Told()
    line.reads(100, 105, 110, 115, 120, 125)  # all that is whole is told at 120; the frame of that read is not
    assert [t_ms for t_ms, _ in line.told] == [120]
    line.reads(130, 135, 140)
    assert [t_ms for t_ms, _ in line.told] == [120, 140]


def test_where_no_pause_comes_reads_are_told_all_the_same() -> None:
    line = _Told()
    line.reads(*(100 + i for i in range(60)))
    gathered = [times[-1] - times[0] for _, times in line.told]
    assert gathered and all(20 < span < 30 for span in gathered)


def test_what_a_tick_told_waits_for_nothing() -> None:
    """Frames far apart: each is told when its line falls quiet, never by the first read of the next one."""
    line = _Told()
    line.reads(100, 101, 140, 141, 180, 181)
    line.until(200)
    assert line.told == [(109, [100, 101]), (149, [140, 141]), (189, [180, 181])]
