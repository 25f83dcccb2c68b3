"""What happened on the bus: frames, transactions, exports and reports.

    import analyzer

    bus = analyzer.open("bus.jsonl")
    for frame in bus.frames():
        print(frame.t_start_ns, frame.summary())
    rows = bus.rows()                       # the same as numpy columns
    slow = bus.transactions().response_ns.max()

Live: `analyzer.Deframer(line)` takes chunks as they come (`feed`, `tick`, `close`) and gives batches of rows.
Names are loaded when they are first used, so that importing the package costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .lazy import lazily
from .version import __version__

if TYPE_CHECKING:
    from .analysis import Analysis, open
    from .core import Analysed, analyse, deframe
    from .deframing.protocols import Deframer
    from .diagnosis.judge import Diagnosis
    from .fleet.lake import lake
    from .options import Options
    from .tables.batch import Batch, Frame
    from .tables.findings import Finding, Severity
    from .tables.transactions import Transactions

_HOMES = {
    "Analysed": "core",
    "Analysis": "analysis",
    "Batch": "tables.batch",
    "Deframer": "deframing.protocols",
    "Diagnosis": "diagnosis.judge",
    "Finding": "tables.findings",
    "Frame": "tables.batch",
    "Options": "options",
    "Severity": "tables.findings",
    "Transactions": "tables.transactions",
    "analyse": "core",
    "deframe": "core",
    "lake": "fleet.lake",
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
    "lake",
    "open",
]


__getattr__ = lazily(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
