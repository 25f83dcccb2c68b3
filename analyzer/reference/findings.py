"""The reference of the findings, as Markdown: `python -m analyzer.reference.findings`.

What is said of each code is its declaration's; the example is the first finding in a simulated capture that has this
one defect, as the analyzer words it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from dissectors.fields import Field

from ..tables.findings import Finding, Rule, codes, described, rules, titled

_HEAD: Final = """\
# Findings

Every finding of `rtuscope`: its code, when it appears, and an example. This page is made from the
declarations of the rules (`python -m analyzer.reference.findings`); a test holds it true.

Each example comes from a capture with this one defect; `rtuscope simulate bus.jsonl --defect CODE` makes one like it.
A finding tells first what was seen and measured, then the likely cause, then what to do. Timing is only judged where
the tap's times can carry it.

| code | severity | when |
| --- | --- | --- |
"""
_SHOWN: Final = 14  # bytes of a field or of noise
_LINES: Final = 12
_EXCHANGES: Final = (80, 400)  # in the capture of an example; the second where the first shows nothing
_SEED: Final = 1


@dataclass(frozen=True, slots=True)
class ReferenceExample:
    """A finding, and the bytes that it stands on, annotated."""

    finding: Finding
    lines: tuple[str, ...]


def markdown() -> str:
    """The page, newline at the end."""
    table = "".join(f"| [`{rule.code}`](#{rule.code}) | {_grade(rule)} | {rule.when} |\n" for rule in rules())
    return _HEAD + table + "".join(map(_section, rules()))


def _grade(rule: Rule) -> str:
    return rule.severity.name.lower()


def _section(rule: Rule) -> str:
    clause = f" Rests on {titled(rule.clause)}." if rule.clause else ""
    example = example_of(rule.code)
    finding, frame = example.finding, "\n".join(example.lines)
    return (
        f"\n## {rule.code}\n\n{_grade(rule).capitalize()}, about {_ABOUT[rule.about.value]}: {rule.when}.{clause}\n\n"
        + (f"```text\n{frame}\n```\n\n" if frame else "")
        + f"- **Seen:** {finding.text}.\n"
        + (f"- **Likely cause:** {finding.cause}.\n" if finding.cause else "")
        + (f"- **Remedy:** {finding.remedy}.\n" if finding.remedy else "")
    )


_ABOUT: Final = {
    "frame": "a frame",
    "transaction": "a request and its answer",
    "noise": "bytes outside frames",
    "bus": "the bus as a whole",
}


def example_of(code: str) -> ReferenceExample:
    """The first finding of this code in a capture made to have it."""
    from captures import Capture

    from ..core import analyse
    from ..simulation import Scenario, simulate
    from ..simulation.defects import defects

    number = codes().index(code)
    for exchanges in _EXCHANGES:
        taps = defects()[code].taps
        tap = "precise" if "precise" in taps else taps[0]
        made = simulate(Scenario("clean", tap, transactions=exchanges, seed=_SEED, baud=19200, defect=code))
        capture = Capture.of(made.line, made.chunks, timed=tap != "untimed")
        for analysed in analyse(capture):
            for finding in described(analysed.findings[analysed.findings.rule == number][:1]):
                batch = analysed.batch
                if finding.start < 0:
                    return ReferenceExample(finding, ())
                rows = batch.rows
                row = int(rows.start.searchsorted(finding.start, side="right")) - 1
                if rows.index[row] < 0:
                    data = batch.bytes_of(row)
                    return ReferenceExample(finding, (f"{_hex(data)}  bytes outside frames",))
                frame = batch.frame(row)
                heads = (f"{frame.direction}, {frame.length} bytes: {frame.summary()}",)
                return ReferenceExample(finding, heads + tuple(_annotated(frame.captured, frame.fields())))
    raise LookupError(f"no example shows {code}")


def _annotated(data: bytes, fields: tuple[Field, ...]) -> Iterator[str]:
    for field in fields[:_LINES]:
        octets = _hex(data[field.start : field.start + field.length])
        yield f"{field.start:>4}  {octets:<{3 * _SHOWN}} {field.name}: {field.text}".rstrip(" :")
    if len(fields) > _LINES:
        yield f"      and {len(fields) - _LINES} more fields"


def _hex(data: bytes) -> str:
    return data[:_SHOWN].hex(" ").upper() + (" ..." if len(data) > _SHOWN else "")


if __name__ == "__main__":
    import sys

    sys.stdout.write(markdown())
