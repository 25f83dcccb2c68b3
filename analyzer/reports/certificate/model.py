"""A certificate as values: claims with their verdicts, what they rest on, what they cannot show."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from ...languages import counted, page_words
from ...options import Options
from ...outages import unheard
from ...version import RULES
from ...words import duration
from .. import of_one_line, summarize
from ..hashes import capture_sha256
from ..heads import head_json, line_json
from ..model import Report
from .claims import UNKNOWN, Claim, claims_of, fault_of_tap, worst
from .limits import AcceptanceLimits
from .tally import AcceptanceTally

if TYPE_CHECKING:
    from captures import Capture

_BURST: Final = 4  # requests on end that were lost, from which on losses are no independent ones
_DEAF: Final = 4


@dataclass(frozen=True, slots=True)
class Certificate:
    """What a capture says of a line, held against limits.

    `sha256`: of the capture's file, None where it is none; `runs`: by unit, most requests on end that were lost.
    """

    report: Report
    limits: AcceptanceLimits
    claims: tuple[Claim, ...]
    runs: dict[int, int]
    sha256: str | None

    @property
    def verdict(self) -> str:
        """That of the line: the worst of all claims."""
        return worst(claim.verdict for claim in self.claims) if self.report.transactions.requests else UNKNOWN

    @property
    def units(self) -> tuple[int, ...]:
        """The units that were asked for something."""
        return tuple(sorted({claim.unit for claim in self.claims if claim.unit is not None}))

    def of(self, unit: int | None) -> tuple[Claim, ...]:
        """The claims about one unit, or about the line (None)."""
        return tuple(claim for claim in self.claims if claim.unit == unit)

    def units_of(self, verdict: str) -> list[int]:
        """The units whose claims together have this verdict."""
        return [unit for unit in self.units if worst(claim.verdict for claim in self.of(unit)) == verdict]

    def longer_ns(self, claim: Claim) -> int | None:
        """How long a capture must be, at this one's pace, for a claim to be able to pass; None where nobody can say."""
        span = self.report.span_ns
        if claim.verdict != UNKNOWN or claim.tap_at_fault or not span or not 0 < claim.seen < claim.needed:
            return None
        if claim.value is not None and claim.value > claim.limit.passes:
            return None  # more of the same would not pass
        return round(span * claim.needed / claim.seen)

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        report = self.report
        return {
            "verdict": self.verdict,
            **head_json(report, self.sha256),
            **line_json(report),
            "t_end_ns": report.t_end_ns,
            "requests": report.transactions.requests,
            "rules": dict(RULES),
            "confidence": self.limits.confidence,
            "limits": self.limits.to_json(),
            "claims": [claim.to_json() for claim in self.claims],
            "not_shown": list(not_shown(self)),
        }


def certify(
    capture: Capture,
    limits: AcceptanceLimits,
    *,
    source: str = "",
    options: Options = Options(),  # noqa: B008 - frozen
    progress: Callable[[int, int], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Certificate:
    """Read a capture through, and hold what it says against limits."""
    tally = AcceptanceTally(capture.line.character_ns)
    report = of_one_line(
        summarize(capture, source=source, options=options, progress=progress, stop=stop, watch=tally.feed)
    )
    return Certificate(report, limits, claims_of(report, tally, limits), dict(tally.runs), capture_sha256(capture))


def not_shown(certificate: Certificate) -> Iterator[str]:
    """What this capture cannot show, in sentences."""
    report = certificate.report
    if report.partial:
        yield page_words("Reading stopped early: the claims cover the part read.")
    if (fault := fault_of_tap(report)) is not None:
        yield page_words("What is lost or damaged may be the tap's doing: {cause}", cause=fault.text)
    if certificate.sha256 is None:
        yield page_words("The capture is not a file, so it has no hash.")
    if not report.timed:
        yield page_words("The capture has no timestamps: response times and load are unknown.")
    elif report.times.off_ns is None:
        yield page_words("Response times cannot be derived from this tap's timestamps.")
    elif report.times.off_ns:
        off = duration(report.times.off_ns)
        yield page_words("The tap's times may be off by {time}; the response-time bounds include this.", time=off)
    if report.timed and (report.baud is None or report.char_bits is None):
        yield page_words("The line's speed or character length is not known: its load is unknown (--baud, --parity).")
    for time in report.deaf[:_DEAF]:
        yield page_words("Recording was interrupted: {what}.", what=unheard(time))
    if report.transactions.unheard:
        yield page_words(
            "{requests} may have been answered then; no claim counts them.",
            requests=counted(report.transactions.unheard, "request", "requests"),
        )
    if report.damage_count:
        yield page_words("Parts of the capture could not be read: {count:,}.", count=report.damage_count)
    if report.doubtful_frames:
        yield page_words("Frames whose bounds are doubtful: {count:,}.", count=report.doubtful_frames)
    yield from _bursts(certificate)
    yield page_words("Units that were not asked are not judged.")
    yield page_words("A byte-level tap shows no voltages, reflections or termination.")
    yield page_words("The bounds assume independent exchanges under the conditions of this capture.")


def _bursts(certificate: Certificate) -> Iterator[str]:
    answered = {row.unit for row in certificate.report.units if row.counts.answered or row.counts.exceptions}
    bursts = {unit: run for unit, run in certificate.runs.items() if run >= _BURST and unit in answered}
    if bursts:
        unit = max(bursts, key=lambda each: bursts[each])
        yield page_words(
            "Requests were lost in bursts, {run:,} on end at unit {unit}: another hour may be better or worse.",
            run=bursts[unit], unit=unit,
        )  # fmt: skip
