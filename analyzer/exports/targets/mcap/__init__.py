"""MCAP: one self-contained file for any viewer, and a capture that every command reads again.

Raw chunks go in as they were captured, by the same code that records them; beside them frames, transactions, register
values and findings, a topic each (docs/mcap.md). log_time is when it was on the wire. Messages are protobuf of constant
layouts with their schemas in the file, packed as arrays by `captures.formats.mcap`, since a message at a time costs ten
times as much. Chunks are compressed and each is complete in itself, so that a file that was cut still gives all before
the cut.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from captures import Capture

    from ...sink import ExportOptions, OutputStream
    from .recording import Recording

BINARY: Final = True
TAKES: Final = frozenset({"noise", "explain"})
WHOLE: Final = "an MCAP file holds the whole capture, raw bytes included; write jsonl or csv, or filter what is read"


def open_sink(out: OutputStream, capture: Capture, options: ExportOptions) -> Recording:
    """A recording onto `out`."""
    from .recording import Recording

    return Recording(out, capture, options)
