"""A frame laid out for reading: its bytes cut at its top-level fields, each with its words, the bytes meant marked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from dissectors.annotation import annotate
from dissectors.fields import Field
from dissectors.length_rules import Role

from ...languages import field_name, page_words, wording
from ...tables.findings import Finding
from ...tables.frame import Frame, adu_of
from ...tables.schema import Protocol
from ...tables.transactions import bounds_of
from ...words import between
from .examples import FindingExample

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


def shown(example: FindingExample, origin_ns: int | None, off_ns: float | None) -> ExampleView:
    """Lay an example out; `origin_ns` is the time that counts as 0, None where the capture has no times; `off_ns`: by
    how much response times may be wrong."""
    finding, frame = example.finding, example.frame
    if frame is None:
        octets = tuple(Octet(f"{byte:02X}", True) for byte in example.noise)
        cell = FieldCell("", octets, example.length - len(octets), "", "")
        title = " · ".join((page_words("noise"), *_location(finding.start, finding.port, finding.t_ns, origin_ns)))
        return ExampleView(finding.text, (Strip(title, page_words("bytes in no frame"), (cell,)),))
    strips = []
    if frame.request_bytes is not None:
        request = adu_of(frame.request_bytes, frame.row.protocol)
        fields = annotate(request, Role.REQUEST, wording=wording())
        strips.append(Strip(page_words("the request before it"), "", _cells(fields, request.data, range(0))))
    strips.append(_strip(frame, finding, origin_ns, off_ns))
    return ExampleView(finding.text, tuple(strips))


def _strip(frame: Frame, finding: Finding, origin_ns: int | None, off_ns: float | None) -> Strip:
    marks = _meant(frame, finding)
    parts = [
        page_words("frame {index:,}", index=frame.index),
        page_words(frame.direction),
        *_location(frame.start, frame.port, frame.t_start_ns, origin_ns),
    ]
    bounds = None if frame.response_time_ns is None else bounds_of(frame.response_time_ns, off_ns)
    if bounds is not None:
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
        text = field.text if len(field.text) <= _TEXT else field.text[: _TEXT - 1] + "…"
        problem = field.problem or ""
        cells.append(
            FieldCell(field_name(field.name).replace("_", " "), octets, len(span) - len(octets), text, problem)
        )
    return tuple(cells)
