"""Examples of what was found: of each rule the first two places that are not alike, with frame or noise.

A frame is laid out for reading: its bytes cut at its top-level fields, each with its words, the bytes meant marked.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dissectors.annotation import annotate
from dissectors.fields import Field
from dissectors.length_rules import Role

from ...languages import field_name, page_words, wording
from ...tables.batch import Batch, Frame, adu_of, rows_of_findings
from ...tables.findings import Finding, Findings, describe
from ...tables.schema import Kind, Protocol
from ...words import between, shortened
from .charts import TroubleBins

if TYPE_CHECKING:
    from ...core import Analysed

_EACH: Final = 2
_LOOKED: Final = 64  # places of a batch that are looked at for them
_NOISE: Final = 32  # bytes kept of a stretch of noise


@dataclass(frozen=True, slots=True)
class FindingExample:
    """One finding with the bytes that it is about.

    `frame` is None for noise, of which `noise` holds the bytes from the finding on, the first ones; `length` is how
    many there are.
    """

    finding: Finding
    frame: Frame | None
    noise: bytes
    length: int


class Examples:
    """The first findings of each rule that have a place."""

    def __init__(self) -> None:
        self._by_rule: dict[int, list[FindingExample]] = {}
        self._by_code: dict[str, list[FindingExample]] = {}

    def of(self, code: str) -> list[FindingExample]:
        """Those of one code; none where it speaks of the bus as a whole."""
        return self._by_code.get(code, [])

    def add(self, batch: Batch, findings: Findings) -> None:
        """Keep what is still missing."""
        for number in np.flatnonzero(np.bincount(findings.rule)).tolist():
            examples = self._by_rule.setdefault(number, [])
            missing = _EACH - len(examples)
            mine = np.flatnonzero((findings.rule == number) & (findings.start >= 0)) if missing > 0 else ()
            for place in mine[:_LOOKED]:
                example = _example(batch, findings[place : place + 1])
                if example is not None and _kind(example) not in map(_kind, examples):
                    examples.append(example)
                    self._by_code[example.finding.code] = examples
                if len(examples) == _EACH:
                    break


def _kind(example: FindingExample) -> tuple[float | None, ...]:
    """What tells examples apart: two of one unit, function and variant are alike."""
    figures = example.finding.numbers
    return tuple(figures.get(name) for name in ("unit", "function", "code", "pattern", "variant", "mistaken"))


def _example(batch: Batch, one: Findings) -> FindingExample | None:
    """The finding with the row that holds its first byte; None where this batch has no such row."""
    rows = batch.rows
    number = int(rows_of_findings(rows, one)[0])
    if number < 0:
        return None
    finding = describe(one, 0)
    if rows.kind[number] != Kind.NOISE:
        return FindingExample(finding, batch.frame(number), b"", finding.length)
    noise = batch.bytes_of(number)[finding.start - int(rows.start[number]) :]
    return FindingExample(finding, None, noise[:_NOISE], len(noise))


# What the page shows beyond the counts of a report, collected as batches come, in flat memory.


class Sights:
    """The bus over time, and examples of what was found."""

    def __init__(self) -> None:
        self.timeline = TroubleBins()
        self.examples = Examples()

    def feed(self, analysed: Analysed) -> None:
        """See one batch."""
        self.timeline.add(analysed.batch.rows, analysed.findings)
        self.examples.add(analysed.batch, analysed.findings)


_BYTES: Final = 16  # shown of one field
_TEXT: Final = 72


@dataclass(frozen=True, slots=True)
class Octet:
    """A byte as two hexadecimal digits, marked where a finding means it."""

    hex: str
    marked: bool


@dataclass(frozen=True, slots=True)
class FieldCell:
    """One field: its bytes, or the first of them, and what it says."""

    name: str
    octets: tuple[Octet, ...]
    more: int  # bytes left out
    text: str
    problem: str


@dataclass(frozen=True, slots=True)
class Strip:
    """Bytes with a line of words above them."""

    title: str
    words: str
    pieces: tuple[FieldCell, ...]


@dataclass(frozen=True, slots=True)
class ExampleView:
    """An example, ready for the page: what was found, and the frames, a request before its answer."""

    text: str
    strips: tuple[Strip, ...]


def example_view(example: FindingExample, origin_ns: int | None) -> ExampleView:
    """Lay an example out; `origin_ns` is the time that counts as 0, None where the capture has no times."""
    finding, frame = example.finding, example.frame
    if frame is None:
        octets = tuple(Octet(f"{byte:02X}", True) for byte in example.noise)
        cell = FieldCell("", octets, example.length - len(octets), "", "")
        title = " · ".join((page_words("noise"), *_location(finding.start, finding.port, finding.t_ns, origin_ns)))
        return ExampleView(finding.text, (Strip(title, page_words("bytes outside frames"), (cell,)),))
    strips = []
    if frame.request_bytes is not None:
        request = adu_of(frame.request_bytes, frame.row.protocol)
        fields = annotate(request, Role.REQUEST, wording=wording())
        strips.append(Strip(page_words("the request before it"), "", _cells(fields, request.data, range(0))))
    strips.append(_strip(frame, finding, origin_ns))
    return ExampleView(finding.text, tuple(strips))


def _strip(frame: Frame, finding: Finding, origin_ns: int | None) -> Strip:
    marks = _meant(frame, finding)
    parts = [
        page_words("frame {index:,}", index=frame.index),
        page_words(frame.direction),
        *_location(frame.start, frame.port, frame.t_start_ns, origin_ns),
    ]
    if (bounds := frame.response_time_bounds_ns) is not None:
        parts.append(page_words("{time} after its request", time=between(*bounds)))
    return Strip(" · ".join(parts), frame.summary(wording()), _cells(frame.fields(wording()), frame.adu.data, marks))


def _meant(frame: Frame, finding: Finding) -> range:
    """The bytes of the frame that the finding points at; none where it means the frame as a whole."""
    if frame.row.protocol != Protocol.RTU:
        return range(0)
    if {"byte", "bit"} <= finding.numbers.keys():
        return range(int(finding.numbers["byte"]), int(finding.numbers["byte"]) + 1)
    first = finding.start - frame.start
    return range(first, first + finding.length) if finding.length < frame.length else range(0)


def _location(start: int, port: int, t_ns: int, origin_ns: int | None) -> list[str]:
    parts = [page_words("byte {at:,}", at=start) + (page_words(" of port {port}", port=port) if port else "")]
    if origin_ns is not None:
        parts.append(page_words("at {time:,.6f} s", time=(t_ns - origin_ns) / 1e9))
    return parts


def _cells(fields: tuple[Field, ...], data: bytes, marks: range) -> tuple[FieldCell, ...]:
    cells = []
    for field in fields:
        span = range(field.start, field.start + field.length)
        octets = tuple(Octet(f"{data[i]:02X}", i in marks) for i in span[:_BYTES])
        text = shortened(field.text, _TEXT)
        problem = field.problem or ""
        cells.append(
            FieldCell(field_name(field.name).replace("_", " "), octets, len(span) - len(octets), text, problem)
        )
    return tuple(cells)
