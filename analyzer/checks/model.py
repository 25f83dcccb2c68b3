"""Rules: the one collection of what they can say, and what became of them, as values; one pass over a capture for all.

The same facts are behind the lines, the JSON and JUnit's XML. What a rule can say is an entry a form, found in
`analyzer.checks.rules`.

    @form("at-least-frames", '"at"i "least"i NUMBER "frames"i', "it holds so many frames", "at least 100 frames")
    def at_least_frames(line: LineSettings, number: Token) -> Start:
        ...

A form's grammar is lark's; words in quotes are keywords, and the terminals below stand for the rest. The function gets
the line's settings and the terminals that were found (None for an optional one that was not), and returns what begins
a measure, or raises CheckError with a column. The parser, the errors, `--list` and `docs/check.md` follow from these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextvars import ContextVar
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from captures import Capture
from dissectors.values import harmless

from ..causes.ledger import Ledger
from ..causes.reasoning import causes_of
from ..core import analyse, observed
from ..filters.table import BatchTable
from ..languages import page_words, wording
from ..options import Options
from ..registry import Registry
from ..reports import Report, Summary
from ..tables.batch import Batch
from ..tables.columns import Decoded, decode
from ..tables.findings import Findings
from ..tables.schema import Kind
from ..tables.transactions import TransactionRows

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps

SHOWN: Final = 5  # places that an outcome names


@dataclass(frozen=True, slots=True)
class Breach:
    """Where a rule is broken: `index` of the frame (None for noise and the bus as a whole), `start` and `length` of the
    bytes in their port's stream, `t_ns` when; `text` says what is there."""

    text: str
    index: int | None
    start: int
    length: int
    port: int
    t_ns: int

    @property
    def words(self) -> str:
        """In one line."""
        where = [] if self.index is None else [page_words("frame {index:,}", index=self.index)]
        where += [page_words("byte {at:,}", at=self.start)] if self.start >= 0 else []
        return f"{', '.join(where)}: {self.text}" if where else self.text


@dataclass(frozen=True)
class CheckedBatch:
    """A part of a capture: a batch with its findings, the transactions that began in it, and as a table to filter."""

    batch: Batch
    transactions: TransactionRows
    findings: Findings
    table: BatchTable

    @cached_property
    def decoded(self) -> Decoded:
        return decode(self.batch)

    def place(self, row: int, text: str = "") -> Breach:
        """A row as a place; without `text` the frame tells itself."""
        values = self.batch.rows.row(row)
        if not text:
            noise = values.kind == Kind.NOISE
            findings = self.batch.findings_of(row) if noise else ()
            text = (
                "; ".join([page_words("bytes outside frames"), *(each.text for each in findings[:1])]) if noise else ""
            )
            text = text or self.batch.frame(row).summary(wording())
        index = values.index
        return Breach(
            harmless(text),
            None if index < 0 else index,
            int(values.start),
            int(values.length),
            int(values.port),
            int(values.t_start_ns),
        )


class Breaches:
    """Counts what breaks a rule, and keeps the first of it."""

    def __init__(self) -> None:
        self.count = 0
        self.first: list[Breach] = []

    def add(self, which: NDArray[np.intp], breach_of: Callable[[int], Breach]) -> None:
        """Those of these numbers; `breach_of` makes one of a number."""
        self.count += len(which)
        self.first += [breach_of(number) for number in which[: SHOWN - len(self.first)].tolist()]

    @property
    def told(self) -> tuple[tuple[Breach, ...], int]:
        """The first, and how many more there are."""
        return tuple(self.first), self.count - len(self.first)


@dataclass(frozen=True, slots=True)
class RuleResult:
    """Whether a rule holds, what was measured, the first places where it does not, and how many `more` there are."""

    passed: bool
    measured: str
    places: tuple[Breach, ...] = ()
    more: int = 0


class Measure(Protocol):
    """A rule at work on one capture."""

    def feed(self, checked: CheckedBatch) -> None:
        """Look at the next part."""

    def verdict(self, report: Report) -> RuleResult:
        """What it comes to at the end, which `report` sums up."""
        ...


@dataclass(frozen=True)
class Check:
    """A rule ready for use: `start()` begins a measure of it. A broken one of severity `warning` only warns."""

    text: str
    start: Callable[[], Measure] = field(repr=False)
    name: str = ""
    severity: str = "error"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one rule."""

    name: str
    check: str
    severity: str
    passed: bool
    measured: str
    places: tuple[Breach, ...]
    more: int = 0  # places than these

    @property
    def places_told(self) -> Iterator[str]:
        """A line a place, and one for those that are left out."""
        yield from (place.words for place in self.places)
        if self.more:
            yield page_words("and {count:,} more such places", count=self.more)

    @property
    def word(self) -> str:
        """PASS, FAIL or WARN."""
        return "PASS" if self.passed else "WARN" if self.severity == "warning" else "FAIL"


@dataclass(frozen=True, slots=True)
class Results:
    """What became of all rules on one capture; `partial` where it ended before the capture did."""

    source: str
    frames: int
    partial: bool
    outcomes: tuple[Outcome, ...]

    @property
    def passed(self) -> bool:
        """Whether no rule fails."""
        return all(outcome.word != "FAIL" for outcome in self.outcomes)

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        rules = [{**asdict(outcome), "result": outcome.word.lower()} for outcome in self.outcomes]
        return {
            "source": self.source,
            "passed": self.passed,
            "frames": self.frames,
            "partial": self.partial,
            "rules": rules,
        }


def comma_separated(numbers: Iterable[int]) -> str:
    """Numbers in order, with commas."""
    return ", ".join(map(str, sorted(numbers)))


Start = Callable[[], Measure]
CHARTS: Final[ContextVar[UnitMaps | None]] = ContextVar("CHARTS", default=None)
"""The register maps of units, while a form's function makes a rule."""

TERMINALS: Final = r"""
thing: WORD+
numbers: NUMBER ("," NUMBER)*
ranges: RANGE ("," RANGE)*
NUMBER: /[0-9]+(\.[0-9]+)?/
COMPARED: /<=|>=|<|>/
SHARE: /p50|p95|p99|max|min|mean/i
UNIT: /(ns|us|µs|μs|ms|s|min|h)(?![a-z0-9_])/i
RANGE: /([0134]x)?[0-9]+(\s*(-|\.\.)\s*([0134]x)?[0-9]+)?/i
WORD: /[a-z_][a-z0-9_]*(-[a-z0-9_]+)*/i
FILTER: /([^:"']|"[^"]*"|'[^']*'|["'][^"']*$)+/
%import common.WS
%ignore WS
"""
# What a terminal is called in an error.
WORDS_OF_TERMINALS: Final = {
    "NUMBER": "a number",
    "COMPARED": "a comparison such as <",
    "SHARE": "p50, p95, p99, max, min or mean",
    "UNIT": "a unit such as ms",
    "RANGE": "addresses such as 4x0-100 or 40001-40100",
    "WORD": "a finding's code or a plain word for it such as 'crc errors'",
    "FILTER": "a display filter (rtuscope help filters)",
    "$END": "the end",
}


@dataclass(frozen=True, slots=True)
class Form:
    """One form of rule: its grammar, what it asserts in words, examples, and what makes a measure of it."""

    name: str
    grammar: str
    help: str
    examples: tuple[str, ...]
    make: Callable[..., Start]


_F = TypeVar("_F", bound=Callable[..., Start])
_FORMS: Final = Registry[Form]("analyzer.checks.rules", "form of rule")


def form(name: str, grammar: str, help: str, *examples: str) -> Callable[[_F], _F]:
    """Enters a function as the maker of this form."""

    def enter(make: _F) -> _F:
        _FORMS.enter(name, Form(name, grammar, help, examples, make))
        return make

    return enter


@cache
def forms() -> tuple[Form, ...]:
    """All forms, a family after the other."""
    return tuple(_FORMS.entries().values())


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
        breaches = ((), 0) if verdict.passed else (verdict.places, verdict.more)
        name = check.name or check.text
        outcomes.append(Outcome(name, check.text, check.severity, verdict.passed, verdict.measured, *breaches))
    return Results(source, report.frames, partial, tuple(outcomes))
