"""Rows in; what became of requests, and what is wrong, out: for a capture, the interface and a live line alike.

The rules run over rows as they come, in bounded memory. What is found does not hang on how the rows were cut into
batches. A finding may speak of a row before the batch that brought it to light; `open_from` says from which frame on
more may still be said.

Rules look at columns, which costs the same for one frame as for a hundred. So frames that are as they should be wait a
moment for their diagnosis, and the first one that is not brings theirs along. What is found does not hang on that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings
from dissectors.length_rules import Role

from ..deframing.tap_clock import TapClock
from ..failures import FailedPart, Failures
from ..options import Options
from ..outages import NOTICED_NS, Deaf, excusable, excused, with_cut_off, with_unheard
from ..tables.batch import Batch, join_batches
from ..tables.findings import NOTHING, FindingLook, Findings, codes, codes_of, fresh_looks
from ..tables.schema import Kind, Rows
from ..tables.taps import TapKind, may_speak_of, tap_kind
from ..tables.transactions import NEVER, TransactionRows, Transactions
from .damage.case import predicted_length
from .damage.triage import Triage
from .view import DiagnosisStep, LookBack

_OF_SILENCE: Final = ("no-response", "retry")  # what is said of answers that did not come


class Diagnosis:
    """Rows and settled transactions in, findings out."""

    _line: LineSettings
    _options: Options
    _looks: list[FindingLook]
    _clock: TapClock
    _trail: LookBack
    _examiner: Triage
    _timed: bool
    _now: int
    _mute: list[int]
    _answers: bool
    _failures: Failures

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - frozen
        self._line = line
        self._options = options
        self._looks = fresh_looks()
        self._mute = [number for number, code in enumerate(codes()) if not may_speak_of(code, line)]
        self._answers = tap_kind(line) is not TapKind.EXCERPT  # one may leave out all answers: then silence is none
        self._clock = TapClock(line)
        self._trail = LookBack()
        self._examiner = Triage(self._trail, line)
        self._timed = False
        self._now = 0
        self._failures = Failures()

    @property
    def failed(self) -> tuple[FailedPart, ...]:
        """Looks that failed, and were not asked again: what they remember is broken."""
        return self._failures.parts

    @property
    def open_from(self) -> int | None:
        """Index of the first frame of which more may be said by what comes; None if there is none."""
        bounds = [look.open_from for look in self._looks if hasattr(look, "open_from")]
        return min((bound for bound in bounds if bound is not None), default=None)

    def feed(self, batch: Batch, transactions: TransactionRows) -> Findings:
        """What this batch, and the transactions that it settles, bring to light."""
        self._timed = self._timed or bool(batch.rows.t_end_ns.any())
        view = self._view(batch, transactions)
        self._clock.feed(view.rows)
        findings = self._spoken(self._seen(lambda look: look(view)))
        self._trail.go_on(batch)
        return findings

    def close(self, transactions: TransactionRows | None = None) -> Findings:
        """What the end brings to light: the last transactions, and what concerns the bus as a whole."""
        settled = TransactionRows.zeros(0) if transactions is None else transactions
        self._clock.close()
        view = self._view(Batch.empty(), settled)
        last = self._seen(lambda look: look(view))
        return self._spoken(last + self._seen(lambda look: look.close(view) if hasattr(look, "close") else ()))

    def _seen(self, ask: Callable[[FindingLook], Iterable[Findings]]) -> list[Findings]:
        """What the looks give; one that fails is left out from then on."""
        seen = list[Findings]()
        for look in [*self._looks]:
            try:
                seen += ask(look)
            except Exception as error:
                self._looks = [each for each in self._looks if each is not look]
                self._failures.add(codes_of(look), error)
        return seen

    def _spoken(self, parts: Iterable[Findings]) -> Findings:
        """Those that may be told of such a tap, in order."""
        findings = _ordered(parts)
        mute = self._mute if self._answers else [*self._mute, *map(codes().index, _OF_SILENCE)]
        if not mute or not len(findings):
            return findings
        return findings[~np.isin(findings.rule, mute)]

    def _view(self, batch: Batch, transactions: TransactionRows) -> DiagnosisStep:
        if len(batch):
            self._now = int(batch.rows.t_end_ns[-1])
        waits = transactions.retry.any() & self._timed  # a client that asks again got no answer
        self._answers |= bool(waits | (batch.rows.kind == Kind.RESPONSE).any())
        view = DiagnosisStep(
            batch,
            transactions,
            self._line,
            self._options,
            self._timed,
            self._clock,
            self._trail,
            self._examiner.explained,
            self._now,
        )
        with self._failures.contained("damage"):
            view.verdicts.update(self._examiner.examine(view))
        return view


def _of(column: NDArray[Any], rows: NDArray[np.intp]) -> NDArray[Any]:
    return column if len(rows) == len(column) else column[rows]


def _ordered(parts: Iterable[Findings]) -> Findings:
    """Findings in wire order, those about the whole bus last."""
    tables = list(parts)
    if not tables:
        return NOTHING
    every = Findings.joined(tables)
    return every[np.lexsort((every.rule, every.start, every.t_ns, every.start < 0))]


_NOT_BEGUN: Final = (-1, 0)


def _begun_by(batch: Batch) -> tuple[int, int]:
    """The index and the end (ns) of the last frame, where it is the beginning of an answer; -1 where it is none, or has
    no time."""
    rows = batch.rows
    if rows.kind[-1] != Kind.RESPONSE or rows.check[-1] or rows.t_end_ns[-1] <= 0:
        return _NOT_BEGUN
    length = predicted_length(batch.bytes_of(len(batch) - 1), Role.RESPONSE)
    is_beginning = length is not None and length.length > rows.length[-1]
    return (int(rows.index[-1]), int(rows.t_end_ns[-1])) if is_beginning else _NOT_BEGUN


_WAIT_NS: Final = 1_000_000_000  # that healthy rows wait at most
_ROWS: Final = 512  # that wait at most
_FEW: Final = 48  # rows
_REQUEST: Final = int(Kind.REQUEST)


class Judge:
    """Batches in wire order in, settled transactions and findings out; both may speak of batches before."""

    outages: Sequence[Deaf]
    _transactions: Transactions
    _diagnosis: Diagnosis
    _waiting: list[Batch]
    _rows: int
    _since: int
    _asking: bool
    _frames: int
    _cut: list[tuple[int, Findings]]
    _begun: tuple[int, int]

    def __init__(self, line: LineSettings, options: Options, outages: Sequence[Deaf] = ()) -> None:
        """`outages`: times in which nothing was received; nobody is blamed for what is missing then."""
        self.outages = outages
        self._transactions = Transactions()
        self._diagnosis = Diagnosis(line, options)
        self._waiting = []
        self._rows = 0  # of those
        self._since = 0  # when the first of those came, ns
        self._asking = False  # the last frame was a request
        self._frames = 0  # that were judged
        self._cut = []  # that an outage may excuse, and frames all of which is said
        self._begun = _NOT_BEGUN

    @property
    def open_from(self) -> int | None:
        """The index of the first frame of which more may be said; None where there is none.

        What waits for its judgement is not counted: see `waits`.
        """
        bounds = (self._transactions.open_from, self._diagnosis.open_from, *(before for before, _ in self._cut))
        return min((bound for bound in bounds if bound is not None), default=None)

    @property
    def failed(self) -> tuple[FailedPart, ...]:
        """What of the diagnosis failed so far."""
        return self._diagnosis.failed

    @property
    def waits(self) -> bool:
        """Whether rows wait for their judgement."""
        return bool(self._waiting)

    def feed(self, batch: Batch, now_ns: int) -> tuple[TransactionRows, Findings]:
        """What is to be said by `now_ns`, with these rows (which may be none)."""
        if len(batch):
            self._since = self._since if self._waiting else now_ns
            self._waiting.append(batch)
            self._rows += len(batch)
        if not self._waiting or (
            self._rows < _ROWS and now_ns < self._since + _WAIT_NS and not (len(batch) and self._odd(batch))
        ):
            return TransactionRows.zeros(0), self._uncut(now_ns) if self._cut else NOTHING
        return self._settle(now_ns)

    def close(self, now_ns: int) -> tuple[TransactionRows, Findings]:
        """No more rows come, and nothing was heard up to `now_ns`: the rest, and what concerns the bus as a whole."""
        settled, findings = self._settle(NEVER) if self._waiting else (TransactionRows.zeros(0), NOTHING)
        last = with_unheard(self._transactions.close(), self.outages, last=True)
        index, end_ns = self._begun
        cut = index if now_ns <= end_ns + NOTICED_NS else -1
        last = with_cut_off(last, now_ns, self._transactions.patience_ns, cut)
        concluded = excused(self._diagnosis.close(last), self.outages)
        findings = Findings.joined((findings, concluded, self._uncut(None)))
        return TransactionRows.joined((settled, last)), findings

    def _settle(self, now_ns: int) -> tuple[TransactionRows, Findings]:
        batch = join_batches(self._waiting)
        self._waiting, self._rows = [], 0
        self._begun = _begun_by(batch)
        before = self.open_from
        settled = with_unheard(self._transactions.feed(batch), self.outages)
        findings = self._diagnosis.feed(batch, settled)
        first, self._frames = self._frames, self._frames + int(np.count_nonzero(batch.rows.kind))
        if not len(findings) and not self._cut:
            return settled, findings
        early = excusable(findings) & (findings.t_ns > now_ns - NOTICED_NS)
        if early.any() and batch.rows.t_end_ns.any():  # else there is no clock, and nothing to wait for
            self._cut.append(((first if before is None else min(first, before)) - 1, findings[early]))
            findings = findings[~early]
        return settled, Findings.joined((excused(findings, self.outages), self._uncut(now_ns)))

    def _uncut(self, now_ns: int | None) -> Findings:
        """Findings that an outage might have excused, once none that is told by `now_ns` (None: ever) does."""
        waiting, self._cut = self._cut, []
        over = []
        for before, findings in waiting:
            if now_ns is None or int(findings.t_ns.max()) <= now_ns - NOTICED_NS:
                over.append(excused(findings, self.outages))
            else:
                self._cut.append((before, findings))
        return Findings.joined(over)

    def _odd(self, batch: Batch) -> bool:
        """Whether any of these rows is not what a healthy bus says."""
        rows = batch.rows
        if len(rows) <= _FEW:
            return self._odd_of_few(rows)
        requests = rows.kind == _REQUEST
        asking = requests & (rows.unit > 0)
        again = (requests[0] and self._asking) or (requests[1:] & asking[:-1]).any()
        self._asking = bool(asking[-1])
        unasked = ~requests & (rows.request < 0)
        bad = unasked.any() or not rows.check.all() or rows.exception.any() or rows.errors.any()
        return bool(again or bad)

    def _odd_of_few(self, rows: Rows) -> bool:
        """The same of a few rows, one by one: on a live line arrays of so few take longer."""
        odd = not all(rows.check.tolist()) or any(rows.exception.tolist()) or any(rows.errors.tolist())
        for kind, unit, request in zip(rows.kind.tolist(), rows.unit.tolist(), rows.request.tolist(), strict=True):
            asks = kind == _REQUEST
            odd = odd or (self._asking if asks else request < 0)
            self._asking = asks and unit > 0
        return odd
