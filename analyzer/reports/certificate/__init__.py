"""Acceptance of a line: `certify` holds a capture against limits, `markdown` and `html` lay the certificate out."""

from __future__ import annotations

from .limits import AcceptanceLimits, LimitsError, default_limits, load_limits
from .model import Certificate, certify
from .page import html, markdown

__all__ = [
    "AcceptanceLimits",
    "Certificate",
    "LimitsError",
    "certify",
    "default_limits",
    "html",
    "load_limits",
    "markdown",
]
