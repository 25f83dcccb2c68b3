"""The keys of a frame's JSON line that say what the frame speaks of, in words, and when."""

from __future__ import annotations

from typing import Any

from dissectors.subject import Subject

from ..words import clock_text


def spoken_json(subject: Subject, summary: str, t_start_ns: int | None) -> dict[str, Any]:
    """These keys; None where there is nothing, and for a time without a date."""
    return {
        "address": subject.address,
        "quantity": subject.quantity,
        "values": list(subject.values),
        "summary": summary,
        "time": (clock_text(t_start_ns) or None) if t_start_ns is not None else None,
    }
