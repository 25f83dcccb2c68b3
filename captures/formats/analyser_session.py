"""Logic analysers' files that are in no public form, or hold a picture of samples: what to export instead is said.

Saleae's `.sal` and `.logicdata`, DSView's `.dsl`, Kingst's `.kvdat`, and what sigrok-cli prints where no output format
is chosen.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final, NoReturn

from ..errors import CaptureError
from ..files import read_head
from . import Format

_SALEAE: Final = re.compile(rb"PK\x03\x04.{26}(?:meta\.json|(?:digital|analog)-\d+\.bin)", re.S)
_DSVIEW: Final = re.compile(
    rb"PK\x03\x04.{26}header.{0,600}?\[version\]|PK\x03\x04.{26}(?:[LO]-\d+/\d+|decoders)", re.S
)
_PRINTED: Final = re.compile(rb"libsigrok [^\n]{1,80}\n(?:FRAME-BEGIN\n)?Acquisition with \d+/\d+ channels at ")


def _sniff(head: bytes) -> float:
    return 1.0 if any(known.match(head) for known in (_SALEAE, _DSVIEW, _PRINTED)) else 0.0


def _read(path: Path) -> NoReturn:
    suffix, head = path.suffix.lower(), read_head(path)
    if _PRINTED.match(head):
        raise CaptureError(
            f"{path}: samples as printed by sigrok-cli: write them with -o FILE.sr, -O vcd or -O csv instead"
        )
    if suffix == ".dsl" or _DSVIEW.match(head):
        raise CaptureError(
            f"{path}: a session of DSView: open it there and export: File > Export, CSV or VCD; rtuscope reads the "
            "result"
        )
    if suffix == ".kvdat":
        raise CaptureError(
            f"{path}: a session of Kingst's analyser: open it there and export its channels as CSV; rtuscope reads the "
            "result"
        )
    if suffix == ".logicdata":
        raise CaptureError(
            f"{path}: a session of Saleae Logic 1: open it there and export: the gear of the Async Serial analyzer > "
            "Export as text/csv file, or Options > Export data, CSV; rtuscope reads the result"
        )
    raise CaptureError(
        f"{path}: a session of Saleae Logic 2: open it there and export: File > Export Data, digital channels as CSV "
        "or binary; or Analyzers > the three dots beside Data > Export Table; rtuscope reads the result"
    )


FORMAT = Format("analyser-session", (".sal", ".logicdata", ".dsl", ".kvdat"), _sniff, _read)
