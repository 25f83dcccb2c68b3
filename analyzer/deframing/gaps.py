"""What silence is worth on this tap: classes of gaps, and the trust that they have earned.

A tap reports when a read returned, at or after its last byte. Bytes of one read ("group": equal times) have no gap
between them; before a group the wire was silent for about dt - n * character. Silences are sorted into classes on a
logarithmic scale of characters, class 0 being "same group". How often each class was seen before requests, before
responses and inside frames that the engine has committed is counted as it goes; the logarithm of the ratio is the
evidence that a frame starts there. On a logic analyser's capture that comes to +-12 bits, behind a gateway or without
times to nothing: trust is measured, not configured.

So that results never depend on how the bytes were fed, tables change only at checkpoints, fixed offsets in the
stream, and hold what had been committed before.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .rules import Index, exact_bits

_EDGES: Final = np.array(
    [0.25, 0.75, 1.25, 1.75, 2.5, 3.5, 5, 7, 10, 14, 20, 28, 40, 57, 80, 113, 160, 226, 320, 453, 640, 905, 1280, 2560,
     5120]
)  # characters  # fmt: skip
_CLASS_OF: Final = (np.digitize(np.arange(4 * _EDGES[-1] + 1) / 4, _EDGES) + 1).astype(np.uint8)  # by quarters of one
_CLASS_OCTETS: Final = _CLASS_OF.tobytes()
_MOST: Final = len(_CLASS_OF) - 1
AGAINST: Final = -3.0  # bits: so little silence that hardly a frame ends there
SILENT: Final = 3  # the silence class from which a gap may part frames: 1 is none, 2 a character's worth of jitter
TURNS: Final = len(_EDGES) + 2  # two more classes: the log says that the direction turned, to TX or to RX
CLASSES: Final = TURNS + 2
_CERTAIN: Final = 12.0  # bits: more than this no silence proves
_TELLING: Final = 8.0  # bits: nor does it tell requests from responses better than this
_PARTS: Final = 7.0  # bits: a silence that no frame has inside
_UNANSWERED: Final = -8.0  # bits: at the most, for a request that nobody answers
_UNIT: Final = 4.0  # bits: a unit that is or isn't on this bus
_UNASKED: Final = (-14.0, -2.0)  # bits: the most and the least that an answer costs that nobody was heard to ask for
_NOISE: Final = 9.0  # bits: at the most, for noise to begin
_NOISY: Final = 3.0  # and on a line full of it
_ONE_WAY: Final = 12  # certain answers, and not a request among them: this tap hears answers only
_REQUESTS_ONE_WAY: Final = -30.0  # bits: for a request there
_UPTO: Final = (1 << 12, 1 << 16, 1 << 20)  # bytes: up to these, and behind the last of them,
_STEPS: Final = (1 << 7, 1 << 12, 1 << 16, 1 << 18)  # there is a checkpoint every so many
_MEMORY: Final = 1e6  # bytes: beyond it old counts fade, since taps are re-plugged and settings change


def classes_of(silence_ns: NDArray[np.int64], char_ns: float) -> NDArray[np.uint8]:
    """Classes (1 and up) of the silences before groups."""
    quarters = (silence_ns / char_ns * 4).clip(0, _MOST)
    return _CLASS_OF.take(quarters.astype(np.intp))


def classes_of_few(silences_ns: Sequence[int], char_ns: float) -> list[int]:
    """The same, one by one."""
    return [_CLASS_OCTETS[int(min(max(silence / char_ns * 4, 0), _MOST))] for silence in silences_ns]


def _by_class(mask: NDArray[np.bool_]) -> bytes:
    """For each value that a byte has, 1 where such a class is meant, and 0."""
    return mask.tobytes().ljust(256, b"\0")


MAY_PART: Final = _by_class(np.arange(CLASSES) >= SILENT)


def silence_positions(classes: bytes | bytearray, first: int, meant: bytes) -> list[int]:
    """The positions from `first` on before which a silence of a class that is meant stands."""
    flags = classes.translate(meant)
    positions: list[int] = []
    at = flags.find(1, first)  # they are few among many bytes
    while at >= 0:
        positions.append(at)
        at = flags.find(1, at + 1)
    return positions


def _prior(same_group: float, short: float, middle: float, long: float, weight: float) -> NDArray[np.float64]:
    """Counts to begin with: shares of silences within a read, under 3.5 characters, under 80, and longer."""
    bounds = [1, int(np.searchsorted(_EDGES, 3.5)) + 2, int(np.searchsorted(_EDGES, 80)) + 2, TURNS]
    counts = np.zeros(CLASSES)
    counts[0] = same_group
    for low, high, share in zip(bounds, bounds[1:], (short, middle, long), strict=False):
        counts[low:high] = share / (high - low)
    counts *= weight
    return counts


def checkpoint_before(offset: int) -> int:
    """The last checkpoint at or before a stream offset: close together at first, when each frame teaches much."""
    return offset - offset % _step(offset)


def next_checkpoint(offset: int) -> int:
    """The first checkpoint behind a stream offset."""
    step = _step(offset)
    return offset - offset % step + step


def _step(offset: int) -> int:
    return _STEPS[bisect_right(_UPTO, offset)]


class SpeakerTurn(IntEnum):
    """Whose turn it was: a master that waits for an answer keeps another silence than one that got it."""

    REQUEST = 0
    RESPONSE = 1
    AGAIN = 2  # a request while another is unanswered


_FIRST: Final = [
    _prior(0.25, 0.25, 0.25, 0.25, 6.0),
    _prior(0.30, 0.30, 0.32, 0.08, 6.0),  # answers come soon
    _prior(0.10, 0.10, 0.20, 0.60, 6.0),  # a second try when a timeout is over
]
for _turn in SpeakerTurn:
    _FIRST[_turn][TURNS:] = (0.2, 2.0) if _turn is SpeakerTurn.RESPONSE else (2.0, 0.2)


class LearntFrames(NamedTuple):
    """What committed frames teach: columns."""

    start: Index
    end: Index
    turn: NDArray[np.uint8]  # SpeakerTurn
    unit: NDArray[np.uint8]
    certain: NDArray[np.bool_]  # no frame of the other role looks like it
    unasked: NDArray[np.bool_]  # an answer, and no request right before it


class GapStatistics:
    """What the tap and the line have shown so far, as evidence in bits.

    Silence classes are counted where frames start (by Turn) and inside them; and how often a frame is followed by
    the 00, FE or FF that a driver makes when it switches.
    """

    _unit_bits: list[float]
    _starts: NDArray[np.float64]
    _inside: NDArray[np.float64]
    _units: NDArray[np.float64]
    _requests: float
    _again: float
    _frames: float
    _glitches: float
    _noises: float
    _answers: float
    _unasked: float
    _certain: NDArray[np.float64]
    checkpoint: int
    _trusted: bytes
    _table: NDArray[np.float64]
    _tables: list[list[float]]
    _parts: bytes
    _most: list[float]
    _unanswered_bits: float
    _noise_cost: float
    _request_bits: float
    _unasked_table: NDArray[np.float64]
    _glitch_cost: float

    def __init__(self) -> None:
        self._unit_bits = []
        self._starts = np.array(_FIRST)  # by Turn and class
        self._inside = _prior(0.83, 0.15, 0.015, 0.005, 60.0)
        self._inside[TURNS:] = 0.05
        self._units = np.full(256, 0.5)
        self._requests, self._again = 16.0, 0.5
        self._frames = 64.0
        self._glitches = 0.4
        self._noises = 0.125
        self._answers, self._unasked = 16.0, 0.25
        self._certain = np.zeros(2)  # requests and responses that cannot be taken for each other
        self.checkpoint = 0
        self._refresh()

    @property
    def bits_by_turn(self) -> list[list[float]]:
        """Bits, by Turn and class, that a frame starts after such a silence."""
        return self._tables

    @property
    def table(self) -> NDArray[np.float64]:
        """The same as an array."""
        return self._table

    @property
    def parts(self) -> bytes:
        """By class, whether such a silence surely parts two frames, whichever they are."""
        return self._parts

    @property
    def trusted(self) -> bytes:
        """By class, whether frames begin behind such silences and hardly ever have one inside."""
        return self._trusted

    @property
    def most(self) -> list[float]:
        """Bits, by class, that any frame starts after such a silence, at most."""
        return self._most

    def may_end(self, silence: int) -> bool:
        """Whether a frame may well end before a silence of this class, however long it gets."""
        return min(self._most[silence:TURNS]) >= AGAINST

    @property
    def unit_bits(self) -> list[float]:
        """Bits, by unit, that a frame is from or for it: few units are on a bus, and the same ones again and again."""
        return self._unit_bits

    @property
    def unanswered_bits(self) -> float:
        """Bits that a request without an answer costs: less on a bus where that is common."""
        return self._unanswered_bits

    @property
    def unasked(self) -> NDArray[np.float64]:
        """Bits that an answer costs that nobody was heard to ask for, by certain (0, 1) and class of silence before it.

        Little on a tap that hears answers only. What is not certain looks like a request and rather is one, but behind
        a log's mark of the side that answers.
        """
        return self._unasked_table

    @property
    def answers_only(self) -> bool:
        """Whether this tap hears answers only: what was taken for a request before that showed waits for nothing."""
        return self._request_bits < 0

    @property
    def request_bits(self) -> float:
        """Bits that any request costs: many on a tap that hears answers only."""
        return self._request_bits

    @property
    def noise_cost(self) -> float:
        """Bits for noise to begin, other than switching glitches: fewer on a line that is full of it."""
        return self._noise_cost

    @property
    def glitch_cost(self) -> float:
        """Bits that a run of switching glitches costs: what one tells of a line that seldom shows any."""
        return self._glitch_cost

    def learn(
        self, classes: NDArray[np.uint8], frames: LearntFrames, glitches: Index, noises: Index, offset: int, upto: int
    ) -> None:
        """Count committed frames, whose positions are indices of `classes`, which begins at stream `offset`.

        `glitches` are the ends of runs of glitch bytes, `noises` those of other noise. The stream is committed up to
        offset `upto`; what ends behind the last checkpoint before it is counted for the next one.
        """
        checkpoint = checkpoint_before(upto)
        if checkpoint > self.checkpoint:
            cut, early, soon = (
                int(np.searchsorted(ends, checkpoint - offset, side="right")) for ends in (frames.end, glitches, noises)
            )
            self._count(classes, LearntFrames._make(column[:cut] for column in frames), early, soon)
            self.checkpoint = checkpoint
            self._refresh()
            frames = LearntFrames._make(column[cut:] for column in frames)
            glitches, noises = glitches[early:], noises[soon:]
        self._count(classes, frames, len(glitches), len(noises))

    def _count(self, classes: NDArray[np.uint8], frames: LearntFrames, glitches: int, noises: int) -> None:
        self._glitches += glitches
        self._noises += noises
        starts, ends = frames.start, frames.end
        if not len(starts):
            return
        self._frames += len(starts)
        by_turn = np.bincount(frames.turn, minlength=len(_FIRST)).tolist()
        self._requests += by_turn[SpeakerTurn.REQUEST] + by_turn[SpeakerTurn.AGAIN]
        self._again += by_turn[SpeakerTurn.AGAIN]
        answers = frames.turn == SpeakerTurn.RESPONSE
        certain = int(frames.certain.sum()), int((frames.certain & answers).sum())
        self._certain += (certain[0] - certain[1], certain[1])
        self._answers += certain[1]
        self._unasked += int((frames.certain & frames.unasked).sum())
        self._units += np.bincount(frames.unit, minlength=256)
        at_start = np.bincount(classes.take(starts) + frames.turn * np.uint8(CLASSES), minlength=self._starts.size)
        at_start = at_start.reshape(self._starts.shape)
        self._starts += at_start
        first, last = int(starts[0]), int(ends[-1])
        self._inside += _histogram(classes[first:last]) - at_start.sum(axis=0)
        for gap in (starts[1:] != ends[:-1]).nonzero()[0].tolist():
            self._inside -= _histogram(classes[int(ends[gap]) : int(starts[gap + 1])])

    def _refresh(self) -> None:
        either = _smooth(self._starts.sum(axis=0))
        starts = np.clip(np.log2(either / _smooth(self._inside)), -_CERTAIN, _CERTAIN)
        tells = [np.clip(np.log2(_smooth(counts) / either), -_TELLING, _TELLING) for counts in self._starts]
        self._trusted = _by_class(starts >= _PARTS)
        self._table = exact_bits(np.array([starts + tell for tell in tells]))
        self._tables = self._table.tolist()
        self._parts = _by_class(self._table.min(axis=0) >= _PARTS)
        self._most = self._table.max(axis=0).tolist()
        self._unanswered_bits = min(-1.0, max(_UNANSWERED, exact_bits(math.log2(self._again / self._requests))))
        share = self._units / self._units.sum()
        self._unit_bits = exact_bits(np.clip(np.log2(share * 256), -_UNIT, _UNIT)).tolist()
        self._noise_cost = min(_NOISE, max(_NOISY, exact_bits(-math.log2(self._noises / self._frames))))
        unasked = exact_bits(math.log2(self._unasked / self._answers))
        requests, responses = self._certain.tolist()
        self._request_bits = _REQUESTS_ONE_WAY if responses >= _ONE_WAY * (1 + 8 * requests) else 0.0
        self._unasked_table = np.full((2, CLASSES), min(_UNASKED[1], max(_UNASKED[0], unasked)))
        if not self.answers_only:
            self._unasked_table[0] = _UNASKED[0]
        answers = self._table[SpeakerTurn.RESPONSE, TURNS:] > self._table[SpeakerTurn.REQUEST, TURNS:]
        self._unasked_table[:, TURNS + answers.nonzero()[0]] = _UNASKED[1]
        self._glitch_cost = min(_CERTAIN, max(1.0, exact_bits(-math.log2(self._glitches / self._frames))))
        if self._inside.sum() > _MEMORY:
            self._inside *= 0.5
            self._starts *= 0.5


def _histogram(classes: NDArray[np.uint8]) -> NDArray[np.intp]:
    """How often each class stands there; most bytes are inside a read, class 0."""
    classed = classes.take(classes.nonzero()[0])
    counts = np.bincount(classed, minlength=CLASSES)
    counts[0] = len(classes) - len(classed)
    return counts


def _smooth(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares of the classes, each lent a little from its neighbours on the scale; class 0 has none."""
    shares = counts.copy()
    scale = counts[1:TURNS]
    shares[1:TURNS] = 0.7 * scale
    shares[2:TURNS] += 0.15 * scale[:-1]
    shares[1 : TURNS - 1] += 0.15 * scale[1:]
    shares[1] += 0.15 * scale[0]
    shares[TURNS - 1] += 0.15 * scale[-1]
    result: NDArray[np.float64] = shares / shares.sum()
    return result
