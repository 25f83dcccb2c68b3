"""What a target is, and the registry of them: a module of `targets`, named by the suffix that it writes.

A new target is one new file there with `open_sink(out, capture, options) -> Sink`; nothing else has to know it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Protocol, cast

from ..meant import did_you_mean
from ..registry import module_names
from . import targets
from .output import ExportError, OutputStream

if TYPE_CHECKING:
    from collections.abc import Mapping

    from captures import Block, Capture
    from dissectors.maps import RegisterMap

    from ..core import Analysed
    from ..filters import Filter
    from ..tables.batch import Batch


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What is written beside the frames."""

    explain: bool = False  # why each boundary stands where it does
    noise: bool = False  # the bytes between frames, so that lines tile the stream
    filter: Filter | None = None  # only rows that pass; one that names noise brings noise without being asked to
    table: str = "frames"  # or one of `records.TABLES`
    delimiter: str = ","  # of CSV
    bom: bool = False  # a byte order mark before a CSV, by which spreadsheets know UTF-8
    charts: Mapping[int, RegisterMap] | None = None  # register maps by unit, which name the values


class Sink(Protocol):
    """A target being written. Blocks and batches come as the capture is read; a block before the batches it gave."""

    def block(self, block: Block) -> None:
        """Raw chunks."""

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """Rows `first` to `last` (excluded) of a batch, in wire order."""

    def batch(self, analysed: Analysed) -> None:
        """A batch all of whose rows have come, with what is said of them; the last one may have been cut short."""

    def close(self) -> None:
        """Write what is left."""


class Target(Protocol):
    """A module of `targets`.

    One whose files cannot hold a part of a capture has WHOLE, which says why not; one whose files are no text has
    BINARY, which is True.
    """

    def open_sink(self, out: OutputStream, capture: Capture, options: ExportOptions) -> Sink: ...


def formats() -> tuple[str, ...]:
    """The names of all targets, which are the suffixes too."""
    return module_names(targets.__name__)


def target(path: str | PurePath, name: str | None = None) -> Target:
    """The target for a path, by name or else by suffix; standard output is jsonl.

    Raises ExportError where there is none.
    """
    from importlib import import_module

    return cast(Target, import_module(f"{targets.__name__}.{format_name(path, name)}"))


def format_name(path: str | PurePath, name: str | None = None) -> str:
    """The format of that name, or else of the path's suffix; standard output is jsonl. Raises ExportError."""
    if name is None:
        name = "jsonl" if str(path) == "-" else PurePath(path).suffix.removeprefix(".").lower()
    if name not in formats():
        which = (
            f"no format {name!r}{did_you_mean(name, formats())}" if name else f"{path}: no suffix to tell the format by"
        )
        raise ExportError(f"{which}; formats are {', '.join(formats())} (by suffix or --format)")
    return name
