"""The analyzer in a notebook: a capture opened, its frames, its columns."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from os import PathLike
from typing import Any

import numpy as np

import captures
from captures.chunks import Capture, Damage
from captures.line import LineSettings

from .findings.model import Finding, describe
from .frames import ROW, Batch, Frame, Rows
from .pipeline import Analysed, Options, analyse, deframe
from .records import joined
from .transactions import TRANSACTION, Transactions


class Analysis:
    """What happened on the bus of one capture. Nothing is read until it is asked for; every call reads anew.

    `batches` and `frames` stream in flat memory; `rows` and `transactions` hold the whole capture as one array.
    """

    def __init__(self, capture: Capture, options: Options = Options()) -> None:  # noqa: B008 - frozen
        self.capture = capture
        self.options = options

    @property
    def line(self) -> LineSettings:
        """Line settings, as far as the capture knows them."""
        return self.capture.line

    @property
    def damage(self) -> list[Damage]:
        """What the newest pass over the capture could not read, and where."""
        return self.capture.damage

    def batches(self) -> Iterator[Batch]:
        """Rows with their bytes, batch after batch in wire order."""
        return deframe(self.capture, self.options)

    def analysed(self) -> Iterator[Analysed]:
        """The same batches, diagnosed, with the transactions and findings that belong to them."""
        return analyse(self.capture, self.options)

    def frames(self) -> Iterator[Frame]:
        """Every frame, in wire order, with its findings."""
        return (frame for analysed in self.analysed() for frame in analysed.batch.frames())

    def findings(self) -> Iterator[Finding]:
        """What is wrong, in wire order batch by batch; what concerns the bus as a whole comes last."""
        return (describe(row) for analysed in self.analysed() for row in analysed.findings)

    def rows(self) -> Rows:
        """All frames and noise as one structured array (dtype `analyzer.frames.ROW`); `at` is for batches only."""
        return joined([np.zeros(0, ROW), *(batch.rows for batch in self.batches())])

    def transactions(self) -> Rows:
        """Requests with their answers as one structured array (dtype `analyzer.transactions.TRANSACTION`)."""
        open_ones = Transactions()
        parts = [open_ones.feed(batch) for batch in self.batches()]
        return joined([np.zeros(0, TRANSACTION), *parts, open_ones.close()])

    def to_arrow(self, *, noise: bool = False) -> Any:
        """All frames as a pyarrow Table with the columns of `analyzer.tables`, with `noise` the bytes between too.

        Needs `rtuscope[columns]`; an ImportError says so.
        """
        from .tables import table

        return table((analysed.batch for analysed in self.analysed()), noise=noise)

    def to_polars(self, *, noise: bool = False) -> Any:
        """The same as a polars DataFrame."""
        return _installed("polars").from_arrow(self.to_arrow(noise=noise))

    def to_pandas(self, *, noise: bool = False) -> Any:
        """The same as a pandas DataFrame."""
        _installed("pandas")
        return self.to_arrow(noise=noise).to_pandas()


def _installed(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"a {name} table needs {name}: pip install {name}", name=name) from error


def open(path: str | PathLike[str], options: Options = Options()) -> Analysis:  # noqa: B008 - frozen
    """Open a capture of any format that `captures` reads; CaptureError says in one line why it can't be."""
    return Analysis(captures.open(path), options)
