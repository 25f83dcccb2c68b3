"""What happened on the bus: frames, transactions, exports and reports.

    import analyzer

    bus = analyzer.open("bus.jsonl")
    for frame in bus.frames():
        print(frame.t_start_ns, frame.summary())
    rows = bus.rows()                       # the same as a numpy structured array
    slow = bus.transactions()["response_ns"].max()

Live: `analyzer.Deframer(line)` takes chunks as they come (`feed`, `tick`, `close`) and gives batches of rows.
Names are loaded when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .lazy import lazily
from .version import __version__

if TYPE_CHECKING:
    from .analysis import Analysis, open
    from .deframing.options import Options
    from .deframing.stream import Deframer
    from .findings.diagnosis import Diagnosis
    from .findings.model import Finding, Severity
    from .frames import Batch, Frame
    from .pipeline import Analysed, analyse, deframe
    from .transactions import Transactions

_HOMES = {
    "Analysed": "pipeline",
    "Analysis": "analysis",
    "Batch": "frames",
    "Deframer": "deframing.stream",
    "Diagnosis": "findings.diagnosis",
    "Finding": "findings.model",
    "Frame": "frames",
    "Options": "deframing.options",
    "Severity": "findings.model",
    "Transactions": "transactions",
    "analyse": "pipeline",
    "deframe": "pipeline",
    "open": "analysis",
}

__all__ = [
    "Analysed",
    "Analysis",
    "Batch",
    "Deframer",
    "Diagnosis",
    "Finding",
    "Frame",
    "Options",
    "Severity",
    "Transactions",
    "__version__",
    "analyse",
    "deframe",
    "open",
]


__getattr__ = lazily(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
