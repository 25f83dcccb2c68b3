"""Other tools on the same frames, a file each: `absent()`, `JOBS` and `ACCURACY`. Importing one imports no library."""

from __future__ import annotations

import marshal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How a tool's accuracy is measured: a command that prints JSON with some of the keys frames, direction, pairs."""

    tool: str
    command: Callable[[Path, Path], Sequence[str | Path]]
    how: str  # what the figures mean, for a note below the table


def all_of_them() -> list[ModuleType]:
    """The peers' modules."""
    from . import construct, mcap, pymodbus, sigrok, tshark

    return [tshark, pymodbus, construct, mcap, sigrok]


def frames(corpus: Path) -> Iterator[list[tuple[bytes, bool]]]:
    """Lists of (frame, whether it is a response)."""
    with (corpus / "frames.marshal").open("rb") as file:
        while True:
            try:
                yield marshal.load(file)
            except EOFError:
                return


def missing(*modules: str) -> str | None:
    """What to say where a Python package is not installed."""
    from importlib.util import find_spec

    gone = [name for name in modules if find_spec(name) is None]
    return f"the package {gone[0]} is not installed" if gone else None


def version(package: str) -> str:
    """An installed package's version."""
    from importlib.metadata import version as found

    return f"{package} {found(package)}"


__all__: list[Any] = ["Accuracy", "all_of_them", "frames", "missing", "version"]
