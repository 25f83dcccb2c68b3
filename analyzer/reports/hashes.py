"""The hash by which a page names the capture that it is of."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from captures import Capture


def capture_sha256(capture: Capture) -> str | None:
    """SHA-256 of a capture's file, as hex; None where it is no file."""
    return None if capture.path is None or not capture.path.is_file() else file_sha256(capture.path)


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, as hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
