"""One pass over a capture for all rules, in flat memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from captures import Capture

from ..causes.ledger import Ledger
from ..causes.reasoning import causes_of
from ..core import analyse, observed
from ..filters.table import BatchTable
from ..options import Options
from ..reports import Summary
from ..tables.transactions import TransactionRows
from .model import Check, CheckedBatch, Outcome, Results


def run(
    capture: Capture,
    checks: Sequence[Check],
    *,
    source: str = "",
    options: Options = Options(),  # noqa: B008 - frozen
    progress: Callable[[int, int], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Results:
    """What becomes of each rule.

    `progress` is told (frames, bytes) after each batch; once `stop` says True, what came so far is judged. Raises
    FilterError where a filter counts in characters and the line's speed is not known.
    """
    measures = [check.start() for check in checks]
    summary = Summary(capture.line.character_ns)
    wanted = any(getattr(measure, "needs_causes", False) for measure in measures)
    ledger = Ledger(capture.line, options) if wanted else None
    origin_ns: int | None = None
    waiting = TransactionRows.zeros(0)  # transactions whose answer stands in a batch to come
    for analysed in analyse(observed(capture, stop=stop), options):
        rows = analysed.batch.rows
        if origin_ns is None and len(rows):
            origin_ns = int(rows.t_start_ns[0])
        joined = TransactionRows.joined((waiting, analysed.transactions))
        table = BatchTable(analysed.batch, capture.line, transactions=joined, origin_ns=origin_ns)
        checked = CheckedBatch(analysed.batch, analysed.transactions, analysed.findings, table)
        for measure in measures:
            measure.feed(checked)
        waiting = joined[joined.response > rows.index.max(initial=-1)]
        summary.feed(analysed)
        if ledger is not None:
            ledger.feed(analysed.batch, analysed.transactions)
        if progress is not None:
            progress(summary.frames, summary.bytes)
    partial = stop is not None and stop()
    report = summary.report(capture, source=source, partial=partial)
    if ledger is not None:
        ledger.close()
        report = replace(report, causes=tuple(causes_of(ledger)))
    outcomes = []
    for check, measure in zip(checks, measures, strict=True):
        verdict = measure.verdict(report)
        breaches = () if verdict.passed else verdict.places
        name = check.name or check.text
        outcomes.append(Outcome(name, check.text, check.severity, verdict.passed, verdict.measured, breaches))
    return Results(source, report.frames, partial, tuple(outcomes))
