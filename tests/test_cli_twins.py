"""An output whose encoding lacks a character has its twin."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from running import ROOT, spawned

from analyzer.cli.twins import TWINS
from captures import samples


def signs(source: Path) -> set[str]:
    """What the strings of a module have beside ASCII and letters of alphabets."""
    texts = (node.value for node in ast.walk(ast.parse(source.read_text(encoding="utf-8")))
             if isinstance(node, ast.Constant) and isinstance(node.value, str))  # fmt: skip
    return {sign for text in texts for sign in text if not sign.isascii() and not sign.isalpha()}


def test_every_sign_that_commands_and_the_interface_print_has_a_twin() -> None:
    modules = [path for room in ("cli", "tui", "reports") for path in (ROOT / "analyzer" / room).rglob("*.py")]
    wanted = set().union(*(signs(path) for path in modules)) | {"×", "→", "─", "μ", "Ω"}
    assert len(wanted) > 20
    assert not [sign for sign in sorted(wanted) if "\\" in sign.encode("ascii", TWINS).decode()]


def test_what_has_no_twin_is_escaped() -> None:
    assert "a\U0001f4a5жb→\udc80".encode("ascii", TWINS) == b"a\\U0001f4a5\\u0436b->\\udc80"


@pytest.mark.parametrize("page", ["ascii", "cp1251", "cp866"])
def test_a_page_about_a_healthy_bus_has_no_escapes(page: str) -> None:
    for command in (("report",), ("open", "--plain"), ("info",)):
        done = spawned(*command, samples.path("healthy.jsonl"), PYTHONIOENCODING=page, PYTHONUTF8="0")
        assert done.status == 0, done.err
        assert "\\x" not in done.out and "\\u" not in done.out
