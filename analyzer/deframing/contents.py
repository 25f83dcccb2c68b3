"""What a poll's answers hold: by its last answers, how strange another one would be among them.

Words are judged one by one against those that stood in their place: how often they came again, and how far they moved
where they did not. What counts is how much stranger an answer is than this poll's own answers are, so that a poll of
lively words and one of constants stand on one footing. Words of one answer move together: the difference is halved,
many words say no more than some, and one answer no more than `MOST_BITS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import expectation, relations
from dissectors.limits import RequestedByteCount

MOST_BITS: Final = 12.0
_UNKNOWN_BITS: Final = 3.0  # of an answer to a poll of which too little is known
REPEATED_BITS: Final = 8.0  # of one that is the answer before once more, which was another poll's
_TELLING: Final = 4  # different words that are no small numbers: two polls hardly hold the same ones
_SMALL: Final = 0x100
_KEPT: Final = 8  # answers of a poll
_SHARE: Final = 0.02  # of itself that a word may move of which no step is known
_STEP_BITS: Final = 3.0  # what such a step costs
_FEW: Final = 4  # steps: of fewer a longer one is no surprise
_WIDER: Final = 3.0
_FARTHEST: Final = 18.0  # bits of a word: as strange as it gets
_USUAL: Final = 0.5  # bits that a word may be stranger than usual
_WORDS: Final = 8  # that speak for themselves: more of them say no more
_POLLS: Final = 512  # known at once
_NOTHING: Final = np.zeros(0, np.int32)
Words = NDArray[np.int32]


@lru_cache(maxsize=64)  # an answer is held against each poll that it may be of
def words_of(adu: bytes) -> Words:
    """What an answer to a read holds: registers, or bytes of coils; nothing of any other answer."""
    counted = [rule for rule in relations(adu[1]) if isinstance(rule, RequestedByteCount)] if adu[1] < 0x80 else []
    if not counted:
        return _NOTHING
    first = counted[0].count_offset + 2
    data = adu[first : first + adu[first - 1]]
    if counted[0].bits == 1 or len(data) % 2:
        return np.frombuffer(data, np.uint8).astype(np.int32)
    return np.frombuffer(data, ">u2").astype(np.int32)


def telling(words: Words) -> bool:
    """Whether an answer holds so much that another poll's would hardly be the same by chance."""
    return len(np.unique(words[words >= _SMALL])) >= _TELLING


@dataclass(slots=True)
class PollContents:
    """The last answers of one poll, the newest last."""

    answers: list[Words] = field(default_factory=list)

    def add(self, words: Words) -> None:
        """One more answer that is certainly of this poll."""
        if self.answers and len(self.answers[-1]) != len(words):
            self.answers.clear()
        self.answers = [*self.answers[1 - _KEPT :], words]

    def held(self, words: Words) -> bool:
        """Whether its last answer was the same."""
        return len(self.answers) > 0 and np.array_equal(self.answers[-1], words)

    def strangeness(self, words: Words) -> float:
        """How much stranger an answer of these words would be than this poll's own, in bits: 0 to `MOST_BITS`."""
        if not len(words):
            return 0.0
        if not self.answers or len(self.answers[-1]) != len(words):
            return _UNKNOWN_BITS
        known = np.array(self.answers)
        far = np.abs(known - words)
        far = np.minimum(far, 0x10000 - far).min(axis=0).astype(np.float64)
        if len(known) == 1:
            reach, stays = 1 + _SHARE * known[0], np.full(len(words), 0.5)
            usual = np.log2(2 * reach) + _STEP_BITS
            return self._told(_bits(far, stays, reach) - usual)
        apart = np.abs(known[1:, None, :] - known[None, :-1, :])
        apart = np.minimum(apart, 0x10000 - apart)
        earlier = np.tri(len(known) - 1, dtype=np.bool_)[:, :, None]  # each against those before it
        steps = np.where(earlier, apart, 0x10000).min(axis=1).astype(np.float64)
        still = (steps == 0).sum(axis=0)
        count = len(steps)
        stays = (still + 0.5) / (count + 1)
        reach = np.maximum(steps.sum(axis=0) / np.maximum(count - still, 1), 1.0)
        if count < _FEW:
            reach *= _WIDER
        return self._told(_bits(far, stays, reach) - _bits(steps, stays, reach).mean(axis=0))

    @staticmethod
    def _told(stranger: NDArray[np.float64]) -> float:
        """What words say together that are so much stranger than usual."""
        few = min(1.0, _WORDS / len(stranger))
        return min(float(np.maximum(stranger - _USUAL, 0.0).sum()) * few / 2, MOST_BITS)


def _bits(steps: NDArray[np.float64], stays: NDArray[np.float64], reach: NDArray[np.float64]) -> NDArray[np.float64]:
    """What it costs to tell of each word how far it lies from one that was there, in bits."""
    moved = -np.log2(1 - stays) + np.log2(2 * reach) + 2 * np.log2(1 + steps / reach)
    bits: NDArray[np.float64] = np.minimum(np.where(steps == 0, -np.log2(stays), moved), _FARTHEST)
    return bits


@dataclass(slots=True)
class KnownPolls:
    """Contents of the polls that were asked about of late, by the bytes of their requests."""

    polls: dict[bytes, PollContents] = field(default_factory=dict)

    def of(self, request: bytes, before: Callable[[], list[bytes]] = list) -> PollContents:
        """Those of a poll; where nobody asked before, with the answers that `before` gives, the newest last."""
        if request in self.polls:
            return self.polls[request]
        if len(self.polls) >= _POLLS:
            del self.polls[next(iter(self.polls))]
        contents = self.polls[request] = PollContents()
        for adu in before():
            contents.add(words_of(adu))
        return contents

    def add(self, request: bytes, answer: bytes) -> None:
        """A certain answer, of a poll that is looked at."""
        if (contents := self.polls.get(request)) is not None and not answer[1] & 0x80:
            contents.add(words_of(answer))


def fits(request: bytes, answer: bytes) -> bool:
    """Whether an answer's header is what a request wants."""
    return expectation(request).fits(answer)
