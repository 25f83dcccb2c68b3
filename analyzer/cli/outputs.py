"""Files that commands write: none is written over unless somebody said so."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Final

from dissectors.values import harmless

from ..languages import counted, tr
from ..terminal_text import terminal_text
from .exits import UsageError

_YES: Final = ("y", "yes", "д", "да")


def add_overwrite_argument(parser: argparse.ArgumentParser | argparse._ArgumentGroup, what: str) -> None:
    """--overwrite, for the file that is called `what` in the help."""
    parser.add_argument(
        "--overwrite", action="store_true", help=f"even if {what} is there already (on a terminal you are asked)"
    )


def to_be_overwritten(path: str | Path, *, overwrite: bool, source: Path | None = None) -> bool:
    """Whether a file stands there that is to be written over: by `overwrite`, or because the user says so now.

    UsageError where it stands there and is not to be touched; `source`, the capture that is read, never is.
    """
    if str(path) == "-" or not Path(path).is_file():  # nothing there, or a pipe, a device, a folder
        return False
    if source is not None and Path(path).samefile(source):
        raise UsageError(f"{path}: is the capture that is being read; give another name")
    if overwrite:
        return True
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(f"{path}: is there already: give another name, or --overwrite")
    sys.stderr.write(terminal_text(harmless(f"{path} is there already: overwrite it? [y/N] ")))
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() not in _YES:
        raise UsageError(f"{path}: left as it was")
    return True


def captured_words(reads: int, octets: int) -> str:
    """How much of a line a capture that was written holds."""
    return tr(
        "{reads}, {bytes} of the line", reads=counted(reads, "read", "reads"), bytes=counted(octets, "byte", "bytes")
    )
