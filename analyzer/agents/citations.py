"""What citations refer to, and whether a statement says what its frames say. No model has a part in it.

It reads captures anew, frame by frame as an export does, and shares no figure with the tools.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from captures.errors import CaptureError
from captures.files import read_head
from captures.formats import likely

from ..analysis import Analysis
from ..analysis import open as open_capture
from ..causes.registry import Cause
from ..languages import error_words, tr, wording
from ..reports.hashes import file_sha256
from ..tables.batch import Frame
from ..tables.schema import Kind
from . import AgentError
from .answers import HASH, MARK, citation
from .root import AgentRoot

_PLACE: Final = r"(?:@\d{1,15}|\d{1,12}(?:-\d{1,12})?)"
_CITATION: Final = re.compile(rf"\b([0-9a-f]{{{HASH}}}):({_PLACE}(?:,{_PLACE})*)")
_MOST: Final = 1000  # frames of one citation
_CUT: Final = "…"


@dataclass(frozen=True, slots=True)
class Cited:
    """A citation as it was written: the hash's first digits, frames, and where bytes in no frame begin."""

    text: str
    sha256: str
    frames: tuple[int, ...]
    octets: tuple[int, ...]


def citations(text: str) -> list[Cited]:
    """All citations in a text, in order, each once. AgentError where one names more frames than anybody looks up."""
    return [
        Cited(found.group(), found.group(1), _frames(found.group(2)), _octets(found.group(2)))
        for found in {each.group(): each for each in _CITATION.finditer(text)}.values()
    ]


def _frames(text: str) -> tuple[int, ...]:
    frames: list[int] = []
    for run in text.split(","):
        if run.startswith("@"):
            continue
        first, _, last = run.partition("-")
        if int(last or first) - int(first) + len(frames) >= _MOST:
            raise AgentError(f"{text}: over {_MOST:,} frames in one citation")
        frames += range(int(first), int(last or first) + 1)
    return tuple(frames)


def _octets(text: str) -> tuple[int, ...]:
    return tuple(int(place[1:]) for place in text.split(",") if place.startswith("@"))


class CitedCapture:
    """A capture that citations name: its frames by index, and where bytes in no frame begin, with how many."""

    def __init__(self, name: str, analysis: Analysis) -> None:
        self.name, self.analysis = name, analysis
        self.frames = {frame.index: frame for frame in analysis.frames()}
        rows = analysis.rows()
        noise = rows[rows.kind == Kind.NOISE]
        self.noise = dict(zip(noise.start.tolist(), noise.length.tolist(), strict=True))
        self._counts: dict[str, int] = {}

    @cached_property
    def findings(self) -> Counter[str]:
        """How many there are of each code."""
        return Counter(each.code for each in self.analysis.findings())

    @cached_property
    def causes(self) -> dict[tuple[str, tuple[int, ...]], Cause]:
        """By name and units."""
        return {(each.cause, each.units): each for each in self.analysis.causes()}

    def counted(self, filter: str) -> int:
        """How many frames pass a display filter."""
        if filter not in self._counts:
            self._counts[filter] = sum(1 for _ in self.analysis.filter(filter).frames())
        return self._counts[filter]


class CitationResolver:
    """The captures under a root, by their hashes."""

    def __init__(self, root: AgentRoot) -> None:
        self._root = root
        self._paths: dict[str, str] | None = None
        self._captures: dict[str, CitedCapture] = {}

    def frames(self, cited: Cited) -> tuple[str, list[Frame]]:
        """The capture's name, and the frames. AgentError where there is no such capture, or no such frame."""
        capture = self.capture(cited.sha256)
        if missing := [frame for frame in cited.frames if frame not in capture.frames]:
            raise AgentError(f"{capture.name} has no frame {missing[0]}")
        if missing := [octet for octet in cited.octets if octet not in capture.noise]:
            raise AgentError(f"{capture.name} has no bytes outside of frames that begin at {missing[0]}")
        return capture.name, [capture.frames[frame] for frame in cited.frames]

    def capture(self, sha256: str) -> CitedCapture:
        """The capture of a hash, or of its first digits. AgentError."""
        if self._paths is None:
            self._paths = {}
            for name, is_lake in self._root.names():
                if not is_lake and self._is_capture(name):
                    self._paths[file_sha256(self._root.file(name))[:HASH]] = name
        short = sha256[:HASH]
        if short not in self._paths:
            raise AgentError("no capture under the root has this hash")
        if short not in self._captures:
            name = self._paths[short]
            self._captures[short] = CitedCapture(name, open_capture(self._root.file(name)))
        return self._captures[short]

    def _is_capture(self, name: str) -> bool:
        try:
            return likely(name, read_head(self._root.file(name)))
        except (OSError, CaptureError, AgentError):
            return False

    def contradictions(self, answer: Mapping[str, Any]) -> Iterator[str]:
        """What of an answer of a tool about a capture its frames do not bear out; every statement must be cited."""
        capture = self.capture(answer["sha256"])
        for statement in answer["statements"]:
            found = citations(str(statement.get("cite", "")))
            if len(found) != 1 or found[0].sha256 != answer["sha256"][:HASH]:
                yield f"not cited: {statement}"
                continue
            try:
                _, frames = self.frames(found[0])
            except AgentError as error:
                yield f"{error}: {statement}"
                continue
            for key, check in _CHECKS.items():
                if key in statement and (wrong := check(capture, statement, frames)):
                    yield f"{key}: {wrong}: {statement}"


def _text(value: Any) -> Any:
    """What a statement says, marked or not."""
    return value[MARK] if isinstance(value, dict) and MARK in value else value


def _frame(_: CitedCapture, statement: Mapping[str, Any], frames: list[Frame]) -> str:
    line = frames[0].to_json()
    said = {**statement, "findings": statement.get("findings", []), "index": statement["frame"]}
    line["findings"] = [each["code"] for each in line["findings"]]
    line["t_ns"] = line["t_start_ns"]
    for key in ("index", "t_ns", "direction", "unit", "crc_ok", "response_time_ns", "findings", "hex", "summary"):
        told = _text(said.get(key, line[key]))
        whole = told.removesuffix(_CUT) if isinstance(told, str) else told
        if line[key] != told and not (isinstance(told, str) and told != whole and line[key].startswith(whole)):
            return f"{key} is {line[key]}"
    return ""


def _counts(capture: CitedCapture, statement: Mapping[str, Any], _: list[Frame]) -> str:
    wrong = [each for each in statement["counts"] if capture.counted(each["all"]) != each["count"]]
    return f"{wrong[0]['all']} passes {capture.counted(wrong[0]['all'])}" if wrong else ""


def _finding(capture: CitedCapture, statement: Mapping[str, Any], frames: list[Frame]) -> str:
    code = statement["finding"]
    if capture.findings[code] != statement["count"]:
        return f"there are {capture.findings[code]}"
    if statement.get("about") == "bus":
        return ""
    bare = [frame.index for frame in frames if code not in {each.code for each in frame.findings}]
    return f"not on frame {bare[0]}" if bare else ""


def _cause(capture: CitedCapture, statement: Mapping[str, Any], frames: list[Frame]) -> str:
    cause = capture.causes.get((statement["cause"], tuple(statement["units"])))
    if cause is None or round(cause.confidence, 3) != statement["confidence"]:
        return "no such cause"
    stray = {frame.index for frame in frames} - set(cause.frames)
    return "it rests on other frames" if cause.frames and stray else ""


def _place(_: CitedCapture, statement: Mapping[str, Any], frames: list[Frame]) -> str:
    first, words = statement["address"], statement["words"]
    for frame in frames:
        begin, quantity = frame.subject.address, frame.subject.quantity
        held = begin is not None and quantity is not None and begin <= first and first + words <= begin + quantity
        if not held or frame.unit != statement["unit"]:
            return f"frame {frame.index} does not tell it"
    return ""


def _raw(_: CitedCapture, statement: Mapping[str, Any], frames: list[Frame]) -> str:
    held = frames[0].subject.values or ()
    window = statement["raw"]
    return "" if any(list(held[at : at + len(window)]) == window for at in range(len(held))) else f"it holds {held}"


def _unit(_: CitedCapture, statement: Mapping[str, Any], frames: list[Frame]) -> str:
    return "" if all(frame.unit == statement["unit"] for frame in frames) else "frames of another unit"


def _poll(capture: CitedCapture, statement: Mapping[str, Any], _: list[Frame]) -> str:
    poll = statement["poll"]
    good = (each for each in capture.frames.values() if each.direction == "request" and each.crc_ok is not False)
    asked = sum(all(poll.get(name) in (None, value) for name, value in _asked_for(each).items()) for each in good)
    return "" if asked == statement["asked"] else f"asked {asked} times"


def _asked_for(frame: Frame) -> dict[str, int | None]:
    subject = frame.subject
    return {
        "unit": frame.unit,
        "function": frame.function,
        "address": subject.address,
        "quantity": subject.quantity,
    }


def _line(capture: CitedCapture, statement: Mapping[str, Any], _: list[Frame]) -> str:
    return "" if capture.analysis.line.baud == statement.get("baud") else "another rate"


_CHECKS: Final[Mapping[str, Callable[[CitedCapture, Mapping[str, Any], list[Frame]], str]]] = {
    "frame": _frame,
    "counts": _counts,
    "finding": _finding,
    "cause": _cause,
    "words": _place,
    "raw": _raw,
    "unit": _unit,
    "poll": _poll,
    "format": _line,
}


def resolved_lines(root: AgentRoot, text: str) -> tuple[list[str], int]:
    """Each citation of a text with its frames in words, and how many refer to nothing."""
    resolver, lines, broken = CitationResolver(root), list[str](), 0
    for cited in citations(text):
        try:
            name, frames = resolver.frames(cited)
        except AgentError as error:
            broken += 1
            lines.append(f"{cited.text}: {error_words(error)}")
            continue
        for octet in cited.octets:
            count = resolver.capture(cited.sha256).noise[octet]
            told = tr("{name}, bytes outside frames: {count}", name=name, count=count)
            lines.append(f"{citation(cited.sha256, (), (octet,))}: {told}")
        for frame in frames:
            told = tr(_TOLD[frame.direction], name=name, unit=frame.unit, summary=frame.summary(wording()))
            lines.append(f"{citation(cited.sha256, (frame.index,))}: {told}")
    return lines, broken


_TOLD: Final = {
    "request": "{name}, request, unit {unit}: {summary}",
    "response": "{name}, response, unit {unit}: {summary}",
}
