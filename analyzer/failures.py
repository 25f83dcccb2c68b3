"""Parts of an analysis that failed: a defect in one judge or look takes nothing else with it, and is told.

Each is warned of once, where it happens (a line on standard error, a warning in a notebook), and stands in reports and
in the interface. RTUSCOPE_DEBUG=1 raises it instead.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

CAUSES: Final = "causes"  # as a part: all of them
_OURS: Final = frozenset({"analyzer", "captures", "dissectors"})
_SHOWN: Final = 3  # parts that a line names


class PartFailedWarning(RuntimeWarning):
    """A part of the analysis failed; the other parts stand."""


@dataclass(frozen=True, slots=True)
class FailedPart:
    """What failed, by the codes of findings, the id of a cause or the name of a table, and the error in words."""

    part: str
    trouble: str

    def __str__(self) -> str:
        return f"{self.part}: {self.trouble}"


class Failures:
    """The parts that failed so far, each with its first error."""

    _by_part: dict[str, str]

    def __init__(self) -> None:
        self._by_part = {}

    def __contains__(self, part: str) -> bool:
        return part in self._by_part

    @property
    def parts(self) -> tuple[FailedPart, ...]:
        """All of them, in the order in which they failed."""
        return tuple(FailedPart(part, trouble) for part, trouble in self._by_part.items())

    @contextmanager
    def contained(self, part: str) -> Iterator[None]:
        """An error inside is this part's alone: what stands behind goes on."""
        try:
            yield
        except Exception as error:
            self.add(part, error)

    def add(self, part: str, error: Exception) -> None:
        """A part failed by this error."""
        if os.environ.get("RTUSCOPE_DEBUG"):
            raise error
        if part not in self._by_part:
            self._by_part[part] = " ".join(f"{type(error).__name__}: {error}".split())
            warnings.warn(failed_words(self.parts[-1:]), PartFailedWarning, stacklevel=2)


def is_for_users(error: BaseException) -> bool:
    """Whether an error is one of this project's own, which carry a message for the user."""
    return type(error).__module__.partition(".")[0] in _OURS


def is_defect(error: BaseException) -> bool:
    """Whether an error is nothing that a user, a file or the system did."""
    return not (is_for_users(error) or isinstance(error, OSError | MemoryError))


def failed_words(parts: Iterable[FailedPart]) -> str:
    """In one line: what failed, and what stands."""
    named = list(dict.fromkeys(map(str, parts)))
    more = f" and {len(named) - _SHOWN} more" if len(named) > _SHOWN else ""
    told = f"{'; '.join(named[:_SHOWN])}{more}"
    return (
        f"part of the analysis failed: {told}; the rest is unaffected; please report it (RTUSCOPE_DEBUG=1 shows where)"
    )
