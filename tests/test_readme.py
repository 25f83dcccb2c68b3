"""What the README shows is what the tool does."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from analyzer.cli import main

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_parsed_frame(capsys: pytest.CaptureFixture[str]) -> None:
    shown = re.search(r"```text\n\$ rtuscope (parse [0-9A-F ]+)\n(.*?)\n```", README, re.DOTALL)
    assert shown is not None
    assert main(shown[1].split()) == 0
    assert capsys.readouterr().out.rstrip() == shown[2]


def test_the_report_of_the_bundled_sample(capsys: pytest.CaptureFixture[str]) -> None:
    shown = re.search(r"```text\n(capture .*?)\n\.\.\.\n```", README, re.DOTALL)
    assert shown is not None
    assert main(["demo"]) == 0
    report = capsys.readouterr().out
    assert report.startswith(shown[1])
    worst = re.search(r"```text\n(what costs .*?)\n```", README, re.DOTALL)
    assert worst is not None
    assert worst[1] in report


def test_the_vendor_function(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    declared = re.search(r"```python\n(from construct import .*?)\n```", README, re.DOTALL)
    assert declared is not None
    file = tmp_path / "trend.py"
    file.write_text(declared[1])
    assert main(["parse", "--functions", str(file), "--role", "request", "01 41 07 50 22"]) == 0
    assert "trend of 7" in capsys.readouterr().out


def test_every_file_that_is_named_exists() -> None:
    names = re.findall(r"\]\(([^)#:]+)\)", README)
    assert names
    for name in names:
        assert (ROOT / name).exists(), name
