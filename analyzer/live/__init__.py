"""A bus while it happens: from a tap or a replay to frames, findings and a recording.

    from analyzer.live import Session, TapSource
    from captures.live.settings import PortSettings

    with Session(TapSource([PortSettings("/dev/ttyUSB0", 19200, "E")])) as session:
        for step in session.steps():
            for frame in step.batch.frames():
                print(frame.t_end_ns, frame.summary())

`session` puts bytes on the disk first and analyses them then, `tapsource` and `replaying` are where bytes come from,
`lines` and `status` are what a person sees, `conditions` say what to show and keep what was around a trigger.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .replaying import Replay
    from .session import Session, SessionStep
    from .tapsource import TapSource

__all__ = ["Replay", "Session", "SessionStep", "TapSource"]

_HOMES = {"Replay": "replaying", "Session": "session", "SessionStep": "session", "TapSource": "tapsource"}


__getattr__ = lazily(__name__, _HOMES)
