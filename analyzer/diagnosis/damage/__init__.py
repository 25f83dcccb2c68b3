"""The autopsy of a damaged frame: what happened to it on its way?

    verdict = autopsy(Case(captured, Role.RESPONSE, request=asked))
    verdict.code, verdict.byte, verdict.bit         # "bit-flip", 5, 3

`case` is what is known of the bytes, `sent` how likely a frame was sent, each explanation a file of its own, `whole`
weighs them, `joined` does so with the noise beside the frame, `divided` takes frames apart that ran together, `verdict`
is what comes out. Pure functions of the bytes and of what the conversation tells; bytes are never altered: `repaired`
is a supposition.
"""

from __future__ import annotations

from .case import FRAME, ByteRepair, DamagedFrame, Explanation
from .causes import Joined, autopsy, joined
from .flow_control import DividedFrame, divided

__all__ = [
    "FRAME",
    "ByteRepair",
    "DamagedFrame",
    "DividedFrame",
    "Explanation",
    "Joined",
    "autopsy",
    "divided",
    "joined",
]
