"""Running commands as users do: in this process, or in one of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pytest

from analyzer.cli import main

PATIENCE_S: Final = 240.0  # for what must come: tests state what comes, not how fast this machine is today
START = "import sys; from analyzer.cli import main; sys.exit(main())"
ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Ran:
    """What a command did."""

    status: int
    out: str
    err: str
    raw: bytes = b""


def ran(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> Ran:
    """A command in this process."""
    capsys.readouterr()
    status = main([str(argument) for argument in arguments])
    return Ran(status, *capsys.readouterr())


def refused(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> str:
    """The one line on standard error of a command that must end with status 2, without its beginning."""
    done = ran(capsys, *arguments)
    assert done.status == 2, done
    assert done.err.startswith("rtuscope: "), done.err
    assert done.err.count("\n") == 1, done.err
    assert "defect" not in done.err
    assert done.out == ""
    return done.err.removeprefix("rtuscope: ").rstrip("\n")


def environment(**more: str) -> dict[str, str]:
    """The environment of a command that runs from the source tree."""
    path = os.pathsep.join(filter(None, (os.environ.get("PYTHONPATH"), str(ROOT))))
    return {**os.environ, "PYTHONPATH": path, **more}


def spawned(*arguments: str | Path, stdin: bytes = b"", cwd: Path | None = None, **more: str) -> Ran:
    """A command in a process of its own."""
    command = [sys.executable, "-c", START, *map(str, arguments)]
    done = subprocess.run(
        command, input=stdin, capture_output=True, cwd=cwd, env=environment(**more), timeout=PATIENCE_S
    )
    out, err = (said.decode(errors="replace").replace(os.linesep, "\n") for said in (done.stdout, done.stderr))
    return Ran(done.returncode, out, err, done.stdout)
