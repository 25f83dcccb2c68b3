"""A certificate as Markdown, and as one HTML page that prints to A4 with room for names and signatures."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from dissectors.values import harmless

from ...languages import grouped, page_words
from ...version import RULES, __version__
from ...words import between, decimal, duration, unit_word
from ..markdown import markdown_table, markdown_text
from ..model import Report
from ..page import facts, file_name
from .claims import FAIL, MARGINAL, PASS, UNKNOWN, WORST_FIRST, Claim
from .model import Certificate, not_shown

CLAIM_WORDS: Final = {
    "lost": "requests without a good answer in time",
    "damaged": "damaged answers",
    "exceptions": "answers by exception",
    "retries": "repeated requests",
    "response": "response time, {quantile:g}% of answers within",
    "load": "load, {quantile:g}% of seconds within",
}
_LINE_WORDS: Final = {**CLAIM_WORDS, "damaged": "damaged answers and requests"}  # of which no unit can be known
VERDICT_WORDS: Final = {PASS: "pass", MARGINAL: "marginal", FAIL: "fail", UNKNOWN: "cannot say"}
SENTENCES: Final = {
    PASS: "The line is within its limits.",
    MARGINAL: "The line is marginal: it just meets its limits or slightly exceeds them.",
    FAIL: "The line exceeds its limits.",
    UNKNOWN: "This capture cannot show whether the line is within its limits.",
}
HEADS: Final = ("claim", "seen", "confidence bounds", "limit", "needed / seen", "verdict")
SIGNED: Final = ("name", "role", "date", "signature")
_FACTS: Final = ("line", "span", "frames", "requests")
_MINUTE_NS: Final = 60 * 10**9


def unit_title(unit: int | None) -> str:
    """The heading of a unit's claims, or of the line's."""
    return page_words("the line") if unit is None else page_words("unit {unit}", unit=unit)


def claim_cells(certificate: Certificate, claim: Claim) -> list[str]:
    """The cells of a claim, as `HEADS` names them."""
    quantile = None if claim.limit.quantile is None else 100 * claim.limit.quantile
    known = _LINE_WORDS if claim.unit is None else CLAIM_WORDS
    words = page_words(known[claim.claim], **({} if quantile is None else {"quantile": quantile}))
    verdict = page_words(VERDICT_WORDS[claim.verdict])
    longer = certificate.longer_ns(claim)
    if longer is not None:
        verdict += page_words("; needs {time}", time=_whole_minutes(longer))
    return [
        words,
        _seen(claim),
        _bounds(claim),
        _limit(claim),
        f"{grouped(claim.needed)} / {grouped(claim.seen)}",
        verdict,
    ]


def _whole_minutes(ns: int) -> str:
    """A duration of minutes rounded up: what a capture must last is no matter of seconds."""
    minutes = -(-ns // _MINUTE_NS)
    return f"{minutes} {unit_word('min')}" if 1 < minutes < 60 else duration(ns)


def _seen(claim: Claim) -> str:
    if claim.hits is not None and claim.seen:
        return f"{grouped(claim.hits)} ({_share(claim.value)})"
    return _figure(claim, claim.value)


def _bounds(claim: Claim) -> str:
    if {claim.low, claim.high} == {None}:
        return "?"
    if claim.limit.timed and claim.low is not None and claim.high is not None:
        return between(round(claim.low), round(claim.high))
    return f"{_figure(claim, claim.low)} .. {_figure(claim, claim.high)}"


def _limit(claim: Claim) -> str:
    passes, fails = (_figure(claim, each) for each in (claim.limit.passes, claim.limit.fails))
    return page_words("up to {passes}; fails above {fails}", passes=passes, fails=fails)


def _figure(claim: Claim, value: float | None) -> str:
    if value is None:
        return "?"
    return duration(round(value)) if claim.limit.timed else _share(value)


def _share(value: float | None) -> str:
    return "?" if value is None else decimal(f"{100 * value:.3g}%")


def certificate_facts(certificate: Certificate) -> Iterator[tuple[str, str]]:
    """What the certificate is of: a label with its words."""
    report = certificate.report
    yield page_words("capture"), file_name(report.source) or page_words("unnamed")
    yield "SHA-256", certificate.sha256 or "?"
    known = dict(_told(report))
    for label in _FACTS:
        if label in known:
            yield page_words(label), known[label]
    by_verdict = {verdict: certificate.units_of(verdict) for verdict in WORST_FIRST}
    judged = [(page_words(VERDICT_WORDS[verdict]), units) for verdict, units in by_verdict.items() if units]
    if judged:
        yield page_words("units"), "; ".join(f"{word}: {', '.join(map(str, units))}" for word, units in judged)
    yield (
        page_words("confidence"),
        page_words("{share:g}% for each bound pair", share=100 * certificate.limits.confidence),
    )
    rules = ", ".join(f"{name} {number}" for name, number in RULES.items())
    yield page_words("made by"), page_words("rtuscope {version}; rules: {rules}", version=__version__, rules=rules)


def _told(report: Report) -> Iterator[tuple[str, str]]:
    yield from ((label, words) for label, words in facts(report) if label)


def markdown(certificate: Certificate) -> str:
    """The certificate as Markdown; newline at the end."""
    return "\n".join(harmless(line) for line in _lines(certificate)) + "\n"


def _lines(certificate: Certificate) -> Iterator[str]:
    verdict = certificate.verdict
    yield f"# {page_words('Acceptance of a Modbus line')}"
    yield ""
    yield f"**{page_words(VERDICT_WORDS[verdict]).upper()}.** {page_words(SENTENCES[verdict])}"
    yield ""
    for label, words in certificate_facts(certificate):
        yield f"- {label}: {markdown_text(words)}"
    for unit in (None, *certificate.units):
        yield from ("", f"## {unit_title(unit)}", "")
        yield from markdown_table(HEADS, (claim_cells(certificate, claim) for claim in certificate.of(unit)))
    yield from ("", f"## {page_words('What this capture cannot show')}", "")
    for sentence in not_shown(certificate):
        yield f"- {markdown_text(sentence)}"
    yield from ("", f"## {page_words('Signatures')}", "")
    yield from markdown_table(SIGNED, [[" "] * len(SIGNED)] * 2)


def html(certificate: Certificate) -> str:
    """The certificate as one page, self-contained."""
    from ..html.page import page_environment

    tables = [
        (unit_title(unit), [(claim, claim_cells(certificate, claim)) for claim in certificate.of(unit)])
        for unit in (None, *certificate.units)
    ]
    verdict = certificate.verdict
    return (
        page_environment(__package__)
        .get_template("certificate.html.j2")
        .render(
            verdict=verdict,
            word=page_words(VERDICT_WORDS[verdict]),
            sentence=page_words(SENTENCES[verdict]),
            facts=list(certificate_facts(certificate)),
            heads=[page_words(head) for head in HEADS],
            tables=tables,
            not_shown=list(not_shown(certificate)),
            signed=[page_words(head) for head in SIGNED],
        )
    )
