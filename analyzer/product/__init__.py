"""The public API: what `import rtuscope` gives. `docs/python.md` says what of it is kept across versions.

    import rtuscope

    bus = rtuscope.open("bus.jsonl")                          # a capture of any format
    paste = rtuscope.parse("11 03 00 6B 00 03 76 87")         # pasted bytes
    request = rtuscope.build(3, unit=17, starting_address=107, quantity=3)

The build installs this folder as the package `rtuscope` (see `.ci/build_hook.py`). Names are loaded when first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.version import __version__ as __version__

if TYPE_CHECKING:
    from analyzer.analysis import Analysis as Analysis
    from analyzer.analysis import open as open
    from analyzer.core import Analysed as Analysed
    from analyzer.core import analyse as analyse
    from analyzer.core import deframe as deframe
    from analyzer.deframing.protocols import Deframer as Deframer
    from analyzer.diagnosis.judge import Diagnosis as Diagnosis
    from analyzer.errors import RtuscopeError as RtuscopeError
    from analyzer.face import build as build
    from analyzer.face import listen as listen
    from analyzer.face import parse as parse
    from analyzer.face import registers as registers
    from analyzer.fleet.lake import lake as lake
    from analyzer.options import Options as Options
    from analyzer.tables.batch import Batch as Batch
    from analyzer.tables.batch import Frame as Frame
    from analyzer.tables.findings import Finding as Finding
    from analyzer.tables.findings import Severity as Severity
    from analyzer.tables.transactions import Transactions as Transactions
    from captures.chunks import Capture as Capture
    from captures.chunks import Chunk as Chunk
    from captures.line import LineSettings as LineSettings

_HOMES = {
    "Analysed": "analyzer.core",
    "Analysis": "analyzer.analysis",
    "Batch": "analyzer.tables.batch",
    "Capture": "captures.chunks",
    "Chunk": "captures.chunks",
    "Deframer": "analyzer.deframing.protocols",
    "Diagnosis": "analyzer.diagnosis.judge",
    "Finding": "analyzer.tables.findings",
    "Frame": "analyzer.tables.batch",
    "LineSettings": "captures.line",
    "Options": "analyzer.options",
    "RtuscopeError": "analyzer.errors",
    "Severity": "analyzer.tables.findings",
    "Transactions": "analyzer.tables.transactions",
    "analyse": "analyzer.core",
    "build": "analyzer.face",
    "deframe": "analyzer.core",
    "lake": "analyzer.fleet.lake",
    "listen": "analyzer.face",
    "open": "analyzer.analysis",
    "parse": "analyzer.face",
    "registers": "analyzer.face",
}

__all__ = [*_HOMES, "__version__"]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
