"""What the README and the page for Python show is what the tool does."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from analyzer.cli import main

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PYTHON = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")


def test_the_parsed_frame(capsys: pytest.CaptureFixture[str]) -> None:
    shown = re.search(r"```text\n\$ rtuscope (parse [0-9A-F ]+)\n(.*?)\n```", README, re.DOTALL)
    assert shown is not None
    assert main(shown[1].split()) == 0
    assert capsys.readouterr().out.rstrip() == shown[2]


def test_the_report_of_the_bundled_sample(capsys: pytest.CaptureFixture[str]) -> None:
    shown = re.search(r"```text\n(capture .*?)\n\.\.\.\n```", README, re.DOTALL)
    assert shown is not None
    assert main(["demo"]) == 0
    assert capsys.readouterr().out.startswith(shown[1])


def test_the_vendor_function(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    declared = re.search(r"```python\n(from construct import .*?)\n```", PYTHON, re.DOTALL)
    assert declared is not None
    file = tmp_path / "trend.py"
    file.write_text(declared[1])
    assert main(["parse", "--functions", str(file), "--role", "request", "01 41 07 50 22"]) == 0
    assert "trend of 7" in capsys.readouterr().out


@pytest.mark.parametrize("begin", ["import analyzer", "from analyzer import Deframer"])
def test_what_is_done_from_python(begin: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = re.search(rf"```python\n({begin}.*?)\n```", PYTHON, re.DOTALL)
    assert code is not None
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "captures" / "samples" / "troubled.jsonl", "bus.jsonl")
    done = subprocess.run([sys.executable, "-c", code[1]], capture_output=True, text=True, check=True)
    assert "all-silent" in done.stdout or "read 3 holding registers" in done.stdout


def test_every_file_that_is_named_exists() -> None:
    names = re.findall(r"\]\(([^)#:]+)\)", README)
    assert names
    for name in names:
        assert (ROOT / name).exists(), name
