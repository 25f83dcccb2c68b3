"""`docs/findings.md` is what the rules declare, and shows each at work."""

from __future__ import annotations

from pathlib import Path

from analyzer.reference.findings import markdown
from analyzer.tables.findings import rules


def test_the_page_is_of_these_rules() -> None:
    page = Path(__file__).resolve().parents[1] / "docs" / "findings.md"
    assert page.read_text(encoding="utf-8") == markdown(), "write it anew: python -m analyzer.reference.findings"


def test_every_rule_says_when_why_and_what_to_do() -> None:
    for rule in rules():
        assert rule.when, rule.code
        assert rule.cause, rule.code
        assert rule.remedy, rule.code
        assert rule.when[0].islower() or rule.when.startswith(("UART", "CRC")), rule.code
        assert not rule.when.endswith("."), rule.code
