"""The one source of the version, and of the rules that it has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

__version__ = "0.3.0"

# A number is raised once a release, where the same bytes come to other rows than in the release before: lakes make anew
# what these rules make (tests/test_rules.py tells).
RULES: Final[Mapping[str, int]] = {
    "reading": 1,  # bytes, times and damage of a capture: captures
    "framing": 1,  # frames and what is in them: dissectors, analyzer.deframing, analyzer.tables
    "pairing": 1,  # what became of requests, and how long that took: analyzer.tables.transactions, analyzer.diagnosis
    "findings": 1,  # analyzer.diagnosis.rules
    "causes": 1,  # analyzer.causes
}
