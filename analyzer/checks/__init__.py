"""Assertions on a capture, for test benches and CI: `run(capture, [compile_check("no crc errors")])`.

A rule is a line of a small language: `forms` holds the collection of what can be said, `rules` says it, a family a
file; `parsing` reads a line, `running` goes over a capture once for all rules. `docs/check.md` is made from the forms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .errors import CheckError as CheckError

if TYPE_CHECKING:
    from .model import Check, Outcome, Place, Results
    from .parsing import compile_check
    from .rulesfile import load_rules
    from .running import run

__all__ = ["Check", "CheckError", "Outcome", "Place", "Results", "compile_check", "load_rules", "run"]

_HOMES = {
    "Check": "model",
    "Outcome": "model",
    "Place": "model",
    "Results": "model",
    "compile_check": "parsing",
    "load_rules": "rulesfile",
    "run": "running",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
