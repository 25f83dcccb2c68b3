"""What the page shows beyond the counts of a report, collected as batches come, in flat memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .examples import Examples
from .timeline import Timeline

if TYPE_CHECKING:
    from analyzer.pipeline import Analysed


class Sights:
    """The bus over time, and examples of what was found."""

    def __init__(self) -> None:
        self.timeline = Timeline()
        self.examples = Examples()

    def feed(self, analysed: Analysed) -> None:
        """See one batch."""
        self.timeline.add(analysed.batch.rows, analysed.findings)
        self.examples.add(analysed.batch, analysed.findings)
