"""The terminal interface (Textual). It sees a bus through `analyzer.model` only.

    from analyzer.tui import run

    run(source)

A `Source` (`analyzer.model.source`) is anything with `name`, `line`, `timed`, `live`, `path`, and
`batches(stop) -> Iterator[Batch]`: `CaptureSource` is a file; a live tap or a replay is a class of its own whose
`batches` yields a batch as soon as there is one, and an empty batch now and then so that `stop` is looked at.
`notices()` gives lines about what was lost. `batches` runs in a thread; it ends soon after `stop()` says True.
"""

from __future__ import annotations

import gc
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, tzinfo
from pathlib import Path
from typing import TYPE_CHECKING

from ..failures import PartFailedWarning

if TYPE_CHECKING:
    from dissectors.maps.model import RegisterMap

    from ..model.source import ViewSource


@contextmanager
def _failures_at_the_end() -> Iterator[None]:
    """What is warned of while the interface has the terminal: parts that failed are told once it is left."""
    try:
        with warnings.catch_warnings(record=True) as told:
            yield
    finally:
        for each in told:
            if issubclass(each.category, PartFailedWarning):
                warnings.showwarning(each.message, each.category, each.filename, each.lineno)


def run(
    source: ViewSource,
    *,
    view: str | None = None,
    light: bool = False,
    zone: tzinfo = UTC,
    charts: Callable[[Iterable[int]], Mapping[int, RegisterMap]] | None = None,
    reader: Callable[[Path], ViewSource] | None = None,
) -> None:
    """Show a source until the user quits.

    `view` is what is shown first: `frames`, `home`, `paste` …; None: the transactions, or Home where a capture
    has causes to tell. `zone` is that of times of day; `charts` gives the maps of units; `reader` opens a file when the
    user wants another one, or the same anew. `viewer.InterfaceError` where a defect ended it.
    """
    gc.disable()  # until the first rows stand there, see `Jobs`: none of what is imported and built is garbage
    try:
        from .app import Rtuscope
        from .viewer import shown

        app = Rtuscope(source, view=view, light=light, reader=reader)
        app.desk.zone = zone
        if charts is not None:
            app.desk.charts = charts
        with _failures_at_the_end():
            shown(app)
    finally:
        gc.enable()
