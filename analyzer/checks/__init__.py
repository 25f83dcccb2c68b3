"""Assertions on a capture, for test benches and CI: `run(capture, [compile_check("no crc errors")])`.

A rule is a line of a small language: `model` holds the collection of what can be said and goes over a capture once for
all rules, `rules` says it, a family a file; `parsing` reads a line. `docs/check.md` is made from the forms.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..filters import FilterError
from ..lazy import lazily

if TYPE_CHECKING:
    from .model import Breach, Check, Outcome, Results, run
    from .parsing import compile_check, load_rules

__all__ = ["Breach", "Check", "CheckError", "Outcome", "Results", "compile_check", "load_rules", "run"]

_HOMES = {
    "Check": "model",
    "Outcome": "model",
    "Breach": "model",
    "Results": "model",
    "compile_check": "parsing",
    "load_rules": "parsing",
    "run": "model",
}


__getattr__ = lazily(__name__, _HOMES)


class CheckError(FilterError):
    """A rule that cannot be used: `message` says what is wrong, `column` where (from 0); the text says both."""
