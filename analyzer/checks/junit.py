"""Results as JUnit XML, which CI servers read: a test case a rule. A rule that only warns is a case with its words."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from dissectors.values import harmless

from ..exports.sink import output
from .model import Outcome, Results


def xml(results: Results) -> bytes:
    """The document."""
    failed = sum(outcome.word == "FAIL" for outcome in results.outcomes)
    counts = {"tests": str(len(results.outcomes)), "failures": str(failed), "errors": "0", "skipped": "0"}
    root = ElementTree.Element("testsuites", counts)
    suite = ElementTree.SubElement(root, "testsuite", {"name": "rtuscope check", **counts})
    for outcome in results.outcomes:
        case = ElementTree.SubElement(
            suite, "testcase", {"classname": harmless(results.source), "name": harmless(outcome.name)}
        )
        if outcome.word == "FAIL":
            failure = ElementTree.SubElement(case, "failure", {"message": _message(outcome)})
            failure.text = _outcome_words(outcome)
        else:
            ElementTree.SubElement(case, "system-out").text = _outcome_words(outcome)
    ElementTree.indent(root)
    document: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return document + b"\n"


def write(results: Results, path: str | Path, *, source: Path | None = None) -> None:
    """Write it; the file appears whole or not at all. `source`, the capture, is never written over.

    Raises ExportError and captures.CaptureError.
    """
    with output(path, source=source) as stream:
        stream.write(xml(results))


def _message(outcome: Outcome) -> str:
    return harmless(f"{outcome.check}: {outcome.measured}")


def _outcome_words(outcome: Outcome) -> str:
    lines = [f"{outcome.word} {_message(outcome)}", *outcome.places_told]
    return "\n".join(lines)
