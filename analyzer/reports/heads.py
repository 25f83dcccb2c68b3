"""The head of a page about a capture: which one it is of, how its line is set, and when it was recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..version import __version__

if TYPE_CHECKING:
    from .model import Report


def head_json(report: Report, sha256: str | None) -> dict[str, Any]:
    """As plain values; `sha256` of the capture's file, None where it is none."""
    return {
        "capture": report.source,
        "capture_sha256": sha256,
        "version": __version__,
        "t_start_ns": report.t_start_ns,
        "span_ns": report.span_ns,
        "partial": report.partial,
    }


def line_json(report: Report) -> dict[str, Any]:
    """How the line is set, as plain values."""
    return {name: getattr(report, name) for name in ("format", "baud", "char_bits", "parity", "stop_bits", "tap")}
