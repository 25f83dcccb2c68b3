"""How far two taps' clocks are apart, and what their times are worth, by what is heard."""

from __future__ import annotations

from typing import Final, NamedTuple

from ..tables.schema import NO_GAP

MOST_NS: Final = 60_000_000  # that two adapters' times may be apart: latency timers, jitter, clocks set by hand
_LEAST_NS: Final = 2_000_000
_EVERY: Final = 64  # frames, after which the horizon is measured anew
_BYTE_BY_BYTE: Final = 0.9  # reads a byte
_STRAYS: Final = 4.0  # horizon for each ns that times stray inside frames
_FADES: Final = 0.75


class ClockSkew(NamedTuple):
    """By how much the clock of the port of answers is ahead of that of requests: bounds, ns."""

    least: int
    most: int


class TapClocks:
    """What two taps' times are worth, measured every so many frames."""

    horizon_ns: int
    unsure_ns: int
    _frames: int
    _reads: int
    _octets: int
    _stray: float
    _delay: float | None
    _turn: float | None
    usual_ns: float

    def __init__(self) -> None:
        self.horizon_ns = MOST_NS
        self.unsure_ns = 0
        self._frames = self._reads = self._octets = 0
        self._stray = 0.0
        self._delay = None  # least wait between a request's end and its answer, by the clocks
        self._turn = None  # and between an answer's end and the next request
        self.usual_ns = 0.0  # wait of an answer

    @property
    def skew(self) -> ClockSkew | None:
        if self._delay is None or self._turn is None:
            return None
        return ClockSkew(*sorted((int(-self._turn), int(self._delay))))

    def frame(self, reads: int, length: int, most: int, least: int) -> None:
        """One was placed."""
        self._reads += reads
        self._octets += length
        if most != NO_GAP:
            self._stray = max(self._stray, abs(most), abs(least))
        self._frames += 1
        if self._frames % _EVERY == 0:
            self._measure()

    def answered(self, wait_ns: int) -> None:
        """A request was answered after so long, by the two clocks."""
        self._delay = wait_ns if self._delay is None else min(self._delay, wait_ns)
        self.usual_ns += (wait_ns - self.usual_ns) / 16
        self.unsure_ns = max(self.unsure_ns, -wait_ns)

    def went_on(self, wait_ns: int) -> None:
        """The next request came so long after an answer."""
        self._turn = wait_ns if self._turn is None else min(self._turn, wait_ns)
        self.unsure_ns = max(self.unsure_ns, -wait_ns)

    def _measure(self) -> None:
        horizon = float(MOST_NS)
        if self._reads >= _BYTE_BY_BYTE * self._octets:
            horizon = min(horizon, max(_LEAST_NS, _STRAYS * self._stray, _STRAYS * self.unsure_ns))
        self.horizon_ns = round(horizon)
        self._stray *= _FADES
        self.unsure_ns = round(self.unsure_ns * _FADES)
        self._reads = self._octets = 0
        if self._delay is not None and self._turn is not None:  # clocks drift: bounds widen until seen again
            self._delay += 0.05 * abs(self._delay)
            self._turn += 0.05 * abs(self._turn)
