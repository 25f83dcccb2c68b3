"""Which way a write and its echo go, where only time tells: they read alike.

The answer to a write (05, 06, 22) says nothing that its request does not. A server sends it soon, and then the client
goes on as it always does. A client that got none waits for its timeout, asks again, and waits for as long once more,
or for as long and its usual pause. So what comes late, and is followed by such a silence while answers on this bus are
followed by far shorter ones, or by none like it where it comes yet again, is the client's: nobody answered. Where a
client's timeout is known, what comes after just that is too.
And a write that stands where the client goes on is no late answer to an older one, if it is answered, or waited for.
A client whose answer came damaged asks again, too: what stands around that is a damaged answer before it, and another
one, or a good one, behind.

A row is held back until the next one, or so much silence that there can be none that matters, tells which. What is
decided hangs on rows and their times alone, not on how they were fed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import GLITCHES, Bools, Int64s, Kind, Protocol, UInt8s
from ..tables.transactions import ECHOED
from .segments import UnorderedRows

_LATE_NS: Final = 100_000_000  # sooner no client gives up whose timeout a tap's clock can tell from a slow answer
_LONGER: Final = 2  # times what usually follows an answer
_SHORT: Final = 2
_SELDOM: Final = 0.1  # of the answers
_STRAYS: Final = 0.05  # of a timeout, from one to the next,
_STRAYS_NS: Final = 10_000_000  # at least,
_STRAYS_PAUSE: Final = 0.25  # and so much of the pause, which may stand behind it
_LATENCY_NS: Final = 1_000_000_000  # by which a read may come late: what began before is known by then
_EVER: Final = 1 << 62
_ROWS: Final = 128  # in which pauses and timeouts are looked for; of more than
_KEPT: Final = 1024  # at once, those alone are kept
_LEAST: Final = 3  # timeouts
_DAMAGED: Final = 4  # bytes of a damaged answer: fewer may be noise,
_ALIKE: Final = 2  # but not twice the same
_SHOWN: Final = 8  # bytes that are looked at
_NOISE, _REQUEST, _RESPONSE = int(Kind.NOISE), int(Kind.REQUEST), int(Kind.RESPONSE)


class _Settled(NamedTuple):
    """Rows as they were given: what is done to rows later does not change `kind`.

    `late`: echoes that came late, whoever sent them; `turned`: frames that were read the other way.
    """

    loose: UnorderedRows
    kind: UInt8s
    late: Bools
    turned: Bools

    @classmethod
    def of(cls, loose: UnorderedRows, late: Bools, turned: Bools) -> _Settled:
        """The newest of these rows."""
        count = len(late)
        if count > _KEPT:
            loose, late, turned = loose.picked(np.arange(count - _ROWS, count)), late[-_ROWS:], turned[-_ROWS:]
        return cls(loose, loose.rows.kind.copy(), late, turned)


class _FrameBefore(NamedTuple):
    """The right frame before a row; `since`: what stands between the two in no right frame, the beginning of it."""

    kind: int
    captured: bytes
    t_end_ns: int
    turned: bool
    since: bytes


class _ClientHabits(NamedTuple):
    """What a client usually does, in ns: how long it rests behind answers (in order), and waits for one that does not
    come."""

    pauses: Int64s
    timeout: int | None

    @classmethod
    def of(cls, settled: Sequence[_Settled]) -> _ClientHabits | None:
        """By the newest rows; None where there is no answer among them."""
        rows = [each.loose.rows for each in settled]
        kind = np.concatenate([each.kind for each in settled])[-_ROWS:]
        unit = np.concatenate([each.unit for each in rows])[-_ROWS:-1]
        late = np.concatenate([each.late for each in settled])[-_ROWS:-1]
        begin = np.concatenate([each.t_start_ns for each in rows])[-_ROWS:]
        silence = begin[1:] - np.concatenate([each.t_end_ns for each in rows])[-_ROWS:-1]
        goes_on = (kind[1:] == _REQUEST) & (unit != 0)
        pauses = silence[goes_on & (kind[:-1] == _RESPONSE) & ~late]
        timeouts = silence[goes_on & (kind[:-1] == _REQUEST)]
        if not len(pauses):
            return None
        return cls(np.sort(pauses), _middle(timeouts) if len(timeouts) >= _LEAST else None)

    @property
    def pause(self) -> int:
        """How long it rests from one poll to the next: behind some it rests longer, until a round begins anew."""
        return int(self.pauses[(len(self.pauses) - 1) // 4])

    def rests(self, silence: int) -> bool:
        """Whether it now and then rests so long behind an answer."""
        low, high = np.searchsorted(self.pauses, (silence - _timer(silence), silence + _timer(silence)))
        return bool(high - low > _SELDOM * len(self.pauses))

    def strays(self, delay: int) -> int:
        """By how much a timeout of this length may differ from the next one."""
        return int(_timer(delay) + _STRAYS_PAUSE * self.pause)

    def gives_up(self, delay: int) -> bool:
        """Whether a timeout is known, and this is it."""
        return self.timeout is not None and abs(delay - self.timeout) <= self.strays(delay)

    def asks_again(self, delay: int, behind: int) -> bool:
        """Whether an echo that came `delay` after the request is the client's, which goes on so long `behind` it."""
        strays, longer = self.strays(delay), behind - delay
        as_long = min(abs(longer), abs(longer - self.pause)) <= strays
        return as_long or (self.gives_up(delay) and longer >= -strays)


class WriteDirections:
    """Rows of a port in, and out again in their order, as soon as the direction of each is certain."""

    _held: UnorderedRows
    _settled: deque[_Settled]
    _rows: int

    def __init__(self) -> None:
        self._held = UnorderedRows.nothing()  # a write of which the silence behind it has to tell
        self._settled = deque()
        self._rows = 0  # in these

    @property
    def held(self) -> int:
        """How many rows are held back."""
        return len(self._held.rows)

    def release(self) -> UnorderedRows:
        """What is held back, as it is."""
        held, self._held = self._held, UnorderedRows.nothing()
        return held

    def settle(self, loose: UnorderedRows, until: int | None, *, timed: bool = True) -> UnorderedRows:
        """More rows; gives those that are certain.

        All that was heard before `until` (ns) is known; None: all. `timed`: times mean something.
        """
        if len(self._held.rows):
            loose = UnorderedRows.joined([self.release(), loose])
        count = len(loose.rows)
        late, turned = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        if ECHOED.take(loose.rows.function).any():
            turning = _Turning(loose, until, self._settled, late, turned, timed=timed)
            certain = turning.turn()
            if certain < count:
                self._held = loose.picked(np.arange(certain, count))
                loose, late, turned = loose.picked(np.arange(certain)), late[:certain], turned[:certain]
                count = certain
        if count:
            self._settled.append(_Settled.of(loose, late, turned))
            self._rows += len(self._settled[-1].kind)
            while self._rows - len(self._settled[0].kind) >= _ROWS:
                self._rows -= len(self._settled.popleft().kind)
        return loose


class _Turning:
    """Rows of one port whose directions are settled, one after the other."""

    def __init__(
        self,
        loose: UnorderedRows,
        until: int | None,
        past: deque[_Settled],
        late: Bools,
        turned: Bools,
        *,
        timed: bool,
    ) -> None:
        self._loose, self._rows, self._until, self._past, self._timed = loose, loose.rows, until, past, timed
        self._late, self._turned = late, turned
        self._right = loose.rows.check & (loose.rows.kind != _NOISE)

    def turn(self) -> int:
        """Turn what is to be; how many rows are certain: one of which it is not yet, ends them."""
        doubtful: deque[int] = deque(self._doubtful().tolist())
        while doubtful:
            i = doubtful.popleft()
            kind = self._kind(i)
            if kind is None:
                return i
            if kind != self._rows.kind[i]:
                self._rows.kind[i] = kind
                self._turned[i] = True
                if self._next(i) == i + 1 and self._is_again(i) and (not doubtful or doubtful[0] != i + 1):
                    doubtful.appendleft(i + 1)
        return len(self._rows)

    def _doubtful(self) -> NDArray[np.intp]:
        """Writes that come late behind one like them, and answers that have no request right before them."""
        rows, first = self._rows, self._before(0)
        writes = ECHOED.take(rows.function) & self._right & (rows.unit != 0) & (rows.exception == 0)
        writes &= rows.protocol != Protocol.TCP
        asked = np.concatenate(([first is not None and first.kind == _REQUEST], rows.kind[:-1] == _REQUEST))
        asked[1:] &= self._right[:-1]
        end = np.concatenate(([rows.t_start_ns[0] if first is None else first.t_end_ns], rows.t_end_ns[:-1]))
        doubtful = (rows.t_start_ns - end >= _LATE_NS) | ((rows.kind == _RESPONSE) & ~asked)
        doubtful[0] |= first is not None and (first.turned or bool(first.since))
        found: NDArray[np.intp] = (writes & doubtful).nonzero()[0]
        return found

    def _before(self, i: int) -> _FrameBefore | None:
        """The right frame before a row, if it is not far."""
        since: list[bytes] = []
        for each, at in islice(self._backwards(i), _ROWS):
            rows, captured = each.loose.rows, each.loose.bytes_of(at)
            if each.kind[at] != _NOISE and rows.check[at]:
                between = b"".join(since[: -_SHOWN - 1 : -1])[:_SHOWN]
                return _FrameBefore(
                    int(each.kind[at]), captured, int(rows.t_end_ns[at]), bool(each.turned[at]), between
                )
            since.append(captured)
        return None

    def _backwards(self, i: int) -> Iterator[tuple[_Settled, int]]:
        """Rows before one, the newest first, and where they stand."""
        here = _Settled(self._loose, self._rows.kind, self._late, self._turned)
        yield from ((here, at) for at in range(i - 1, -1, -1))
        for each in reversed(self._past):
            yield from ((each, at) for at in range(len(each.kind) - 1, -1, -1))

    def _kind(self, i: int) -> int | None:
        """Which way a write goes; None where the row behind has to tell, and is not known yet."""
        rows, before = self._rows, self._before(i)
        said = int(rows.kind[i])
        if before is None:
            return said
        silence = int(rows.t_start_ns[i]) - before.t_end_ns
        if before.kind == _REQUEST and before.captured == self._loose.bytes_of(i):
            if before.since:
                return self._kind_behind_damage(i, silence, before.since) if said == _RESPONSE else said
            said = _RESPONSE if before.turned else said
            habits = self._habits(i) if silence >= _LATE_NS else None
            return said if habits is None else self._kind_of_echo(i, said, silence, habits)
        if before.kind == said == _RESPONSE and not before.since and (habits := self._habits(i)) is not None:
            return self._kind_of_answer(i, silence, habits)
        return said

    def _kind_behind_damage(self, i: int, silence: int, one: bytes) -> int | None:
        """Of a write behind the same as a request and what may be its damaged answer: a server answers once."""
        longest = max(_LATE_NS, _SHORT * silence)
        if self._behind(i, longest) is None:
            return None
        following = self._next(i)
        two = self._between(i + 1, len(self._rows) if following is None else following)
        again = following == i + 1 and self._is_again(i)
        alike = len(one) >= _ALIKE and one == two and _is_no_glitch(one, 1)
        return _REQUEST if alike or (_was_answer(one) and (again or _was_answer(two))) else _RESPONSE

    def _kind_of_echo(self, i: int, said: int, delay: int, habits: _ClientHabits) -> int | None:
        """Of a write behind the same as a request."""
        behind = self._behind(i, delay + habits.pause + habits.strays(delay))
        if behind is None:
            return None
        soon = delay <= _LONGER * habits.pause
        if soon and not (self._is_again(i) or habits.gives_up(delay)):
            return said
        self._late[i] = True
        if soon and habits.rests(behind):
            return said
        if habits.asks_again(delay, behind):
            return _REQUEST
        return _RESPONSE if behind <= _SHORT * habits.pause and not self._is_again(i) else said

    def _kind_of_answer(self, i: int, silence: int, habits: _ClientHabits) -> int | None:
        """Of a write behind an answer that reads like one to an older request."""
        if _SHORT * silence < habits.pause:
            return _RESPONSE
        longest = max(_LATE_NS, _LONGER * habits.pause)
        behind = self._behind(i, longest)
        if behind is None:
            return None
        return _REQUEST if behind > longest or self._is_again(i) else _RESPONSE

    def _behind(self, i: int, longest: int) -> int | None:
        """The silence behind a row in ns, `_EVER` where nothing follows for longer, None where nobody knows yet."""
        end = int(self._rows.t_end_ns[i])
        if (following := self._next(i)) is not None:
            return int(self._rows.t_start_ns[following]) - end
        over = self._until is None or (self._timed and self._until >= end + longest + _LATENCY_NS)
        return _EVER if over or len(self._rows) > i + _ROWS else None

    def _habits(self, i: int) -> _ClientHabits | None:
        if not self._timed:
            return None
        first = max(i - _ROWS, 0)
        here = self._loose.picked(np.arange(first, i))
        return _ClientHabits.of(
            (*self._past, _Settled(here, here.rows.kind, self._late[first:i], self._turned[first:i]))
        )

    def _next(self, i: int) -> int | None:
        """The right frame behind a row; None where none is known."""
        behind = self._right[i + 1 : i + 1 + _ROWS].nonzero()[0]
        return i + 1 + int(behind[0]) if len(behind) else None

    def _between(self, first: int, last: int) -> bytes:
        """What stands in these rows: of much the beginning."""
        return b"".join(map(self._loose.bytes_of, range(first, min(last, first + _SHOWN))))[:_SHOWN]

    def _is_again(self, i: int) -> bool:
        """Whether the frame behind a row has the bytes that it has."""
        following = self._next(i)
        return following is not None and self._loose.bytes_of(following) == self._loose.bytes_of(i)


def _was_answer(data: bytes) -> bool:
    """Whether bytes may be a damaged answer and are not what drivers leave on a line."""
    return len(data) >= _DAMAGED and _is_no_glitch(data, _ALIKE)


def _is_no_glitch(data: bytes, least: int) -> bool:
    return sum(octet not in GLITCHES for octet in data) >= least


def _timer(time: int) -> int:
    """By how much one time of a timer (ns) may differ from the next."""
    return int(max(_STRAYS * time, _STRAYS_NS))


def _middle(numbers: Int64s) -> int:
    return int(np.sort(numbers)[(len(numbers) - 1) // 2])
