"""Saleae's own sessions, `.sal` and `.logicdata`: their samples are in no public form, so what to export is said."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final, NoReturn

from ..errors import CaptureError
from . import Format

_FIRST_MEMBER: Final = re.compile(rb"PK\x03\x04.{26}(?:meta\.json|(?:digital|analog)-\d+\.bin)", re.S)


def _sniff(head: bytes) -> float:
    return 1.0 if _FIRST_MEMBER.match(head) else 0.0


def _read(path: Path) -> NoReturn:
    if path.suffix.lower() == ".logicdata":
        raise CaptureError(
            f"{path}: a session of Saleae Logic 1: open it there and export: the gear of the Async Serial analyzer > "
            "Export as text/csv file, or Options > Export data, CSV; the file that this gives can be read"
        )
    raise CaptureError(
        f"{path}: a session of Saleae Logic 2: open it there and export: File > Export Data, digital channels as CSV "
        "or binary; or Analyzers > the three dots beside Data > Export Table; the file that this gives can be read"
    )


FORMAT = Format("saleae-session", (".sal", ".logicdata"), _sniff, _read)
