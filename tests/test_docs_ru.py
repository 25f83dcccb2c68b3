"""The Russian page keeps up with the tool: its codes and their severities, its commands and their options."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from analyzer.cli.app import Parser
from analyzer.cli.commands import add_arguments
from analyzer.tables.findings import rules

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "ru.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^rtuscope (.+?)(?: {2,}#.*)?$", PAGE, re.MULTILINE)


def test_every_finding_stands_there_with_its_severity() -> None:
    told = {code: letter for letter, code in re.findall(r"^\| ([EWN]) \| `([a-z-]+)` \|", PAGE, re.MULTILINE)}
    assert told == {rule.code: rule.severity.name[0] for rule in rules()}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_one(command: str) -> None:
    name, *given = shlex.split(command)
    parser = Parser(prog=name)
    add_arguments(parser, name)
    assert parser.parse_args(given)
