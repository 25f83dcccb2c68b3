"""How long what was heard last may be taken for what is: a value by the period of its poll, a unit by its answers.

Times are of this machine's steady clock, in seconds.
"""

from __future__ import annotations

from collections import deque
from typing import Final

_STEPS_S: Final = (60, 120, 300, 600, 1800, 3600, 7200, 21_600, 43_200, 86_400, 604_800)
_UNKNOWN_S: Final = 300  # until a second one has come
_PERIODS: Final = 3  # without it, in which it goes stale
_SLACK: Final = 4.0  # so much shorter a wanted time leaves the one that is told: no going to and fro
_KEPT: Final = 5  # of the newest periods, whose middle one counts: an outage is one long period
_MISSES: Final = 3  # requests without an answer, one after the other, that make a unit away


class Freshness:
    """Of one value: when it was heard, when told."""

    __slots__ = ("_heard_s", "_periods", "_told_s", "expire_s", "stale")

    def __init__(self) -> None:
        self._periods: deque[float] = deque(maxlen=_KEPT)
        self._heard_s: float | None = None
        self._told_s = -1e9
        self.expire_s = _UNKNOWN_S
        self.stale = False

    def heard(self, now_s: float) -> bool:
        """It came; whether it goes stale after another time from now on."""
        if self._heard_s is not None and now_s > self._heard_s:
            self._periods.append(now_s - self._heard_s)
        self._heard_s, self.stale = now_s, False
        before, self.expire_s = self.expire_s, self._expires()
        return self.expire_s != before

    def is_due(self, now_s: float) -> bool:
        """Whether one that is the same is to be told again, so that nobody takes it for stale."""
        return now_s - self._told_s >= self.expire_s / _PERIODS

    def told(self, now_s: float) -> None:
        """It was told."""
        self._told_s = now_s

    def goes_stale(self, now_s: float) -> bool:
        """Whether it is stale since it was looked at."""
        if self.stale or self._heard_s is None or now_s - self._heard_s <= self.expire_s:
            return False
        self.stale = True
        return True

    def _expires(self) -> int:
        if not self._periods:
            return self.expire_s
        wanted = _PERIODS * sorted(self._periods)[len(self._periods) // 2]
        if len(self._periods) > 1 and self.expire_s / _SLACK < wanted <= self.expire_s:
            return self.expire_s
        return next((step for step in _STEPS_S if step >= wanted), _STEPS_S[-1])


class Presence:
    """Of one unit: whether it is there."""

    __slots__ = ("_fresh", "_misses", "there")

    def __init__(self) -> None:
        self._fresh, self._misses = Freshness(), 0
        self.there = False

    def settled(self, answered: int, unanswered: int, now_s: float) -> None:
        """Requests got these answers, and these none."""
        if answered:
            self._fresh.heard(now_s)
            self._misses, self.there = 0, True
            return
        self._misses += unanswered
        if self._misses >= _MISSES:
            self.there = False

    def left(self) -> None:
        """Nothing can be heard of it."""
        self.there = False

    def looked_at(self, now_s: float) -> bool:
        """Whether it is there now."""
        if self._fresh.goes_stale(now_s):
            self.there = False
        return self.there
