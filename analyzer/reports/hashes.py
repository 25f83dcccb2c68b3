"""The hash by which a page names the capture that it is of."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from captures import Capture


def capture_sha256(capture: Capture) -> str | None:
    """SHA-256 of a capture's file, as hex; None where it is no file."""
    if capture.path is None or not capture.path.is_file():
        return None
    with capture.path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
