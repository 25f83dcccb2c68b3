"""Gives the autopsy its cases: damaged frames and noise that was one, with what the conversation knows of them.

Noise that begins like a frame, or stands where an answer was due, is held to be one that came damaged, if its autopsy
has a good explanation. One cause, one finding: such a stretch is no noise any more.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from captures import Mark
from captures.line import LineSettings
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length, relations, rule
from dissectors.limits import OVERHEAD, Echo
from dissectors.registry import revision

from ...tables.batch import Batch
from ...tables.schema import GLITCHES, NO_GAP, Kind, Protocol, Row
from ...tables.taps import TapKind, may_speak_of, tap_kind
from ...tables.transactions import ALIKE, shared
from ..view import DiagnosisStep, EarlierRow, LookBack, where
from . import FRAME, DamagedFrame, DividedFrame, Explanation, asked_by, autopsy, divided, joined
from .flow_control import IS_FLOW

HASTE_NS: Final = 50_000_000  # sooner than any master gives up waiting
_HARD_NS: Final = 1_500_000  # what comes sooner belongs to the frame before
_TWICE: Final = 2  # bytes
VAGUE: Final = ("collision", "crc-error", "truncated")  # what frames that ran together are easily taken for
_LEAST: Final = 4  # bytes of noise that may be a damaged frame
_MOST: Final = 400
_MOST_EXPLAINED: Final = 4096  # requests
_NEAR: Final = 2.0  # bits by which an explanation may lose to "nothing explains it"
_CUT_NEAR: Final = 6.0  # the same for that the frame is cut short: its length alone says so
_SURE: Final = 0.5  # certainty from which noise is explained
_NOISE, _REQUEST = int(Kind.NOISE), int(Kind.REQUEST)  # asked of many rows: enums are slow


class RecentTraffic(NamedTuple):
    """The right request that waits for its answer, if one does; the one that a row may answer, which may be one that
    this tap alone did not hear whole; requests and units of late."""

    pending: EarlierRow | None
    request: bytes | None
    requests: frozenset[bytes]
    units: frozenset[int]


class _Open(NamedTuple):
    """Rows end to end whose verdict is not the last, since what comes next may belong to them."""

    first: Row
    captured: bytes  # theirs
    recent: RecentTraffic  # before them
    code: str  # their verdict so far
    joinable: bool  # whether noise behind them is weighed with them: not with what is noise itself

    def ends_at(self, row: Row) -> bool:
        return (row.port, row.start) == (self.first.port, self.first.start + len(self.captured)) and not row.errors


class Triage:
    """Looks at rows in turn; remembers the last ones, and whether a port has ever given an 11 or 13."""

    _trail: LookBack
    _no_word: tuple[str, ...]  # the verdicts on noise that tell nothing of it
    _quoted: bool
    _flow_at: dict[int, int]
    _open: _Open | None
    _mended: tuple[int, int, bytes] | None
    explained: dict[int, None]

    def __init__(self, trail: LookBack, line: LineSettings) -> None:
        self._trail = trail
        self._no_word = ("crc-error",) if may_speak_of("collision", line) else ("crc-error", "collision")
        self._quoted = tap_kind(line) is TapKind.EXCERPT  # somebody chose these bytes, and may have left some out
        self._flow_at = {}  # port: where its first 11 or 13 came
        self._open = None  # the newest rows, where their verdict may change
        self._mended = None  # port, end, the request that flow control robbed there
        self.explained = {}  # requests of late, by index, whose answer came damaged

    def examine(self, view: DiagnosisStep) -> dict[int, Sequence[DividedFrame]]:
        """What happened to the damaged rows of a batch, by row: one part, or several frames that ran together."""
        batch = view.batch
        for port in view.ports:
            if port not in self._flow_at:
                self._watch_flow(view, port)
        explained: dict[int, Sequence[DividedFrame]] = {}
        for number in _suspects(view, first=self._open is not None):
            row = EarlierRow.of(batch, number)
            before, self._open = self._open, None
            parts = self._joined(batch, number, row, before) if before is not None and before.ends_at(row.row) else []
            if before is not None and parts:
                explained.pop(number - 1, None)
                explained[number] = parts
                self._remember(row, parts, before.recent.request)
                if parts[0].verdict.code == "collision" and parts[0].length <= _MOST:
                    self._open = before._replace(captured=before.captured + row.captured, code="collision")
            elif not row.row.check and (parts := self._by_itself(batch, number, row)):
                explained[number] = parts
        return explained

    def _by_itself(self, batch: Batch, number: int, row: EarlierRow) -> Sequence[DividedFrame]:
        """What happened to one row; nothing where it is noise that nothing ties to a frame."""
        recent = self._recent_traffic(batch, number, row)
        verdict = self._verdict(batch, number, row, recent)
        vague = verdict is None or verdict.code in VAGUE or verdict.bits < FRAME
        parts = self._divided(row.row, row.captured, recent) if vague and not row.row.errors else []
        if verdict is not None and not parts:
            parts = [DividedFrame(0, row.row.length, verdict)]
            if verdict.code in VAGUE and not row.row.errors:
                self._open = _Open(row.row, row.captured, recent, verdict.code, joinable=row.is_frame)
        self._remember(row, parts, recent.request)
        return parts

    def _watch_flow(self, view: DiagnosisStep, port: int) -> None:
        for hit in where(IS_FLOW.take(view.batch.data)).tolist():
            row = int(view.rows.at.searchsorted(hit, side="right")) - 1
            if int(view.rows.port[row]) == port:
                self._flow_at[port] = int(view.rows.start[row] + hit - view.rows.at[row])
                return

    def _joined(self, batch: Batch, number: int, row: EarlierRow, before: _Open) -> Sequence[DividedFrame]:
        """What a row and the open rows right before it are together, if that explains both better than either by
        itself."""
        newest = next(self._trail.back(batch, number)).row
        if newest.port != row.row.port or newest.start + newest.length != row.row.start:
            return []
        size, both = len(before.captured), before.captured + row.captured
        if row.is_frame:
            collision = Explanation("collision", 0.0, 1.0, length=DamagedFrame(b"", request=before.recent.request).due)
            return [DividedFrame(-size, len(both), collision)] if _overlaid(row.row, before) else []
        if robbed := self._divided(before.first, both, before.recent):
            return [part._replace(start=part.start - size) for part in robbed]
        if not before.joinable or row.row.gap_before_ns > HASTE_NS:
            return []
        pending, request, requests, units = before.recent
        role = None if pending else Role.REQUEST if before.first.kind == Kind.REQUEST else Role.RESPONSE
        flow_free = self._flow_free(before.first)
        case = DamagedFrame(before.captured, role, request, requests, units, flow_free=flow_free)
        best = joined(case, after=row.captured)
        verdict = _nearest(best.verdict)
        more = len(row.captured) >= _LEAST or before.code == "collision"  # a byte or two alone show no second sender
        collided = verdict.code == "collision" and more and not GLITCHES.issuperset(row.captured)
        if best.after and (verdict.repaired is not None or collided):
            return [DividedFrame(-size, len(both), verdict)]
        return []

    def _divided(self, first: Row, captured: bytes, recent: RecentTraffic) -> list[DividedFrame]:
        """The frames that a stretch was before flow control ran them together, on a port that gives no 11 and 13;
        `first` is the stretch, or the row that it begins with."""
        free = self._flow_free(first)
        if not free or len(captured) <= 2 * _LEAST:
            return []
        _, request, requests, units = recent
        return divided(DamagedFrame(captured, None, request, requests, units, flow_free=free))

    def _flow_free(self, row: Row) -> int | None:
        """How many bytes the port had given without any 11 or 13; 0 where there were some, None where no byte was."""
        first = self._flow_at.get(row.port)
        return (row.start or None) if first is None or first >= row.start else 0

    def _verdict(self, batch: Batch, number: int, row: EarlierRow, recent: RecentTraffic) -> Explanation | None:
        """What happened to a row; None where it is noise that nothing ties to a frame."""
        if recent.pending is not None and (echo := _echo(row, recent.pending)):
            return self._explains(recent.pending, echo)
        if row.is_frame:
            return self._verdict_on_frame(batch, number, row, recent)
        return self._repeated(batch, number, row) or self._verdict_on_noise(row, recent)

    def _verdict_on_frame(self, batch: Batch, number: int, row: EarlierRow, recent: RecentTraffic) -> Explanation:
        answered = batch.request_of(number, row.row.request) if row.row.request >= 0 else None
        pending, request = recent.pending, answered or recent.request
        role: Role | None = Role.RESPONSE
        if row.row.kind == Kind.REQUEST:
            if self._mends(row.row) or (pending is not None and _soon(row, pending)):
                role = None  # no master asks again so soon: this is the answer
            else:
                role, pending, request = Role.REQUEST, None, None
        return self._explains(pending, self._looked_at(row, role, request, recent))

    def _verdict_on_noise(self, row: EarlierRow, recent: RecentTraffic) -> Explanation | None:
        pending, request, requests, units = recent
        if cut := _beginning(row.captured, request, requests):
            return self._explains(pending, cut)
        if len(row.captured) < _LEAST:
            return None
        begins = _begins(row.captured, request, units)
        if not (begins or self._quoted):
            return None
        verdict = self._looked_at(row, None, request, recent)
        if not begins and not lacks_first(verdict):
            return None
        if verdict.code not in self._no_word and verdict.certainty >= _SURE:
            return self._explains(pending, verdict)
        like = _request_like(row.captured, requests) if request is None else row.captured[:2] == request[:2]
        return self._explains(pending, Explanation("crc-error", 0.0, 1.0)) if like else None

    def _looked_at(
        self, row: EarlierRow, role: Role | None, request: bytes | None, recent: RecentTraffic
    ) -> Explanation:
        """The autopsy's verdict on a row."""
        free = self._flow_free(row.row)
        return _nearest(_autopsy(row.captured, role, request, recent.requests, recent.units, free, revision()))

    def _repeated(self, batch: Batch, number: int, row: EarlierRow) -> Explanation | None:
        """That noise right behind a frame is the frame's end once more."""
        before = next(self._trail.back(batch, number), None)
        size = len(row.captured)
        if before is None or not before.row.check or size < _TWICE or not row.row.gap_before_ns < _HARD_NS:
            return None
        if before.row.kind == Kind.REQUEST and row.row.gap_before_ns == NO_GAP and size >= len(before.captured) - 1:
            return None  # rather its echo, which lost its first byte
        if size > len(before.captured) or not before.captured.endswith(row.captured):
            return None
        if GLITCHES.issuperset(row.captured):
            return None
        at = len(before.captured) - size
        return Explanation("bytes-repeated", 0.0, 1.0, repaired=before.captured, byte=at, length=size)

    def _explains(self, pending: EarlierRow | None, verdict: Explanation) -> Explanation:
        """The verdict on what is, or was, the answer to a request."""
        if pending is not None:
            self.explained[pending.row.index] = None
            if len(self.explained) > _MOST_EXPLAINED:
                del self.explained[next(iter(self.explained))]
        return verdict

    def _remember(self, row: EarlierRow, parts: Sequence[DividedFrame], request: bytes | None) -> None:
        """Keep the request that a row ends with, if flow control robbed it; `request` waited before the row."""
        for part in parts:
            request = asked_by(part.verdict, request)
        self._mended = (row.row.port, row.row.start + row.row.length, request) if parts and request else None

    def _mends(self, row: Row) -> bool:
        """Whether a row stands right behind a request that flow control robbed."""
        return self._mended is not None and self._mended[:2] == (row.port, row.start)

    def _recent_traffic(self, batch: Batch, number: int, row: EarlierRow) -> RecentTraffic:
        """What was said before a row."""
        pending: EarlierRow | None = None
        newest = True
        requests: set[bytes] = set()
        units: set[int] = set()
        for before in self._trail.back(batch, number):
            said = before.row
            if said.kind == _NOISE or not said.check:
                continue
            units.add(said.unit)
            if said.kind == _REQUEST:
                requests.add(before.captured)
                if newest and said.unit:
                    pending = before
            newest = False
        request = None if pending is None else pending.captured
        if self._mended is not None and self._mends(row.row):
            request = self._mended[2]
        return RecentTraffic(pending, request, frozenset(requests), frozenset(units))


def _suspects(view: DiagnosisStep, *, first: bool) -> list[int]:
    """Rows that need an autopsy: damaged frames in RTU mode, and noise that is not too long; right answers right behind
    them, which tell what they were. `first`: the row before this batch is one of them."""
    noise = view.noise[view.rows.length[view.noise] <= _MOST] if len(view.noise) else view.noise
    if not len(noise) and not len(view.damaged) and not first:
        return []
    protocol = view.rows.protocol
    foreign = view.rows.foreign
    damaged = np.concatenate([noise, view.damaged])
    behind = np.intersect1d(np.append(damaged + 1, 0), view.responses)
    rows = sorted([*damaged.tolist(), *behind.tolist()])
    return [row for row in rows if protocol[row] == Protocol.RTU and not foreign[row]]


def answered_alike(function: int) -> bool:
    """Whether a right answer of a function is its request once more."""
    return any(isinstance(relation, Echo) for relation in relations(function))


def _echo(row: EarlierRow, pending: EarlierRow) -> Explanation | None:
    """That what a log marks as received is what it marks as sent just before, but for a byte or two.

    Not so of what is answered by its like: there it is an answer that came damaged.
    """
    if (pending.row.mark, row.row.mark) != (Mark.TX, Mark.RX) or answered_alike(pending.row.function):
        return None
    same, sent = shared(row.captured, pending.captured), len(pending.captured)
    if same - max(0, len(row.captured) - sent) < sent - ALIKE:
        return None
    kept = _bits_kept(pending.captured, row.captured)
    return Explanation("echo", 0.0, 1.0, repaired=pending.captured, length=sent, lost=sent - same, bit=kept)


_FEWER_BITS: Final = (5, 6, 7)  # of a character, as a UART may be set
_CHANGED: Final = 2  # bytes, of which one alone may have changed by chance


def _bits_kept(sent: bytes, heard: bytes) -> int | None:
    """How many bits of each byte arrive, where bytes that need no more came right and all others changed."""
    for bits in _FEWER_BITS:
        pairs = [(one < 1 << bits, one == two) for one, two in zip(sent, heard, strict=False)]
        wide = [same for fits, same in pairs if not fits]
        plain = all(same for fits, same in pairs if fits) and max(heard) < 1 << bits
        if plain and len(sent) == len(heard) and len(wide) >= _CHANGED and not any(wide):
            return bits
    return None


def _overlaid(row: Row, before: _Open) -> bool:
    """Whether a right answer that nobody waited for ended one that had just begun: two senders at once."""
    pending, request, *_ = before.recent
    if pending is None or before.code != "truncated" or not row.check or row.request == pending.row.index:
        return False
    header = DamagedFrame(b"", request=request).header
    return row.gap_before_ns < _HARD_NS and header.startswith(before.captured[: len(header)])


def _soon(row: EarlierRow, pending: EarlierRow) -> bool:
    """Whether a row came after a request sooner than a master gives up; so it is where times tell nothing."""
    return row.row.t_start_ns - pending.row.t_end_ns < HASTE_NS


def _beginning(data: bytes, request: bytes | None, requests: Collection[bytes]) -> Explanation | None:
    """That a few bytes are the beginning of the answer that is due, or of a request of late."""
    if len(data) >= _LEAST or GLITCHES.issuperset(data):
        return None
    if request is not None:
        case = DamagedFrame(data, request=request)
        return Explanation("truncated", 0.0, 1.0, length=case.due) if case.header.startswith(data) else None
    lengths = [len(earlier) for earlier in requests if earlier.startswith(data)]
    return Explanation("truncated", 0.0, 1.0, length=lengths[0]) if lengths and len(data) == _LEAST - 1 else None


def _request_like(data: bytes, requests: Collection[bytes]) -> bool:
    """Whether noise begins like a request of late, and is as long as that or as its own header predicts."""
    lengths = {len(earlier) for earlier in requests if earlier[:2] == data[:2]}
    return bool(lengths) and len(data) in {*lengths, (pdu_length(data[1:], Role.REQUEST) or 0) + OVERHEAD}


def _begins(data: bytes, request: bytes | None, units: frozenset[int]) -> bool:
    """Whether noise may be a damaged frame: it begins like one, or stands where an answer was due."""
    if GLITCHES.issuperset(data):
        return False
    if not units:
        return False  # no frame so far: this may be no Modbus at all
    plausible = data[0] in units and rule(data[1] & 0x7F, Role.REQUEST) is not None
    return plausible or request is not None or len(data) > _LEAST


def lacks_first(verdict: Explanation) -> bool:
    """Whether a frame is whole but for its first byte."""
    return verdict.code == "byte-missing" and verdict.places[0].first == 0


def _nearest(verdict: Explanation) -> Explanation:
    """The verdict; that nothing explains the frame only where nothing comes near to it."""
    if verdict.code != "crc-error":
        return verdict
    for rival in verdict.rivals:
        if verdict.bits - rival.bits < (_CUT_NEAR if rival.code == "truncated" else _NEAR):
            return rival
    return verdict


@lru_cache(maxsize=2048)
def _autopsy(
    data: bytes,
    role: Role | None,
    request: bytes | None,
    requests: frozenset[bytes],
    units: frozenset[int],
    free: int | None,
    _revision: int,
) -> Explanation:
    return autopsy(DamagedFrame(data, role, request, requests, units, flow_free=free))
