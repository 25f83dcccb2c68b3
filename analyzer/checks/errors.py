"""What is wrong with a rule, and where."""

from __future__ import annotations

from ..filters.errors import FilterError


class CheckError(FilterError):
    """A rule that cannot be used: `message` says what is wrong, `column` where (from 0); the text says both."""
