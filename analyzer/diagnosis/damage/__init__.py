"""The autopsy of a damaged frame: what happened to it on its way?

    verdict = autopsy(DamagedFrame(captured, Role.RESPONSE, request=asked))
    verdict.code, verdict.byte, verdict.bit         # "bit-flip", 5, 3

`case` is what is known of the bytes, what comes out, and how likely a frame was sent; `causes` weighs the
explanations; `joined` does so with the noise beside the frame, `divided` takes frames apart that ran together. Pure
functions of the bytes and of what the conversation tells; bytes are never altered: `repaired` is a supposition.
"""

from __future__ import annotations

from .case import FRAME, ByteRepair, DamagedFrame, Explanation
from .causes import Joined, autopsy, joined
from .flow_control import DividedFrame, asked_by, divided

__all__ = [
    "FRAME",
    "ByteRepair",
    "DamagedFrame",
    "DividedFrame",
    "Explanation",
    "Joined",
    "asked_by",
    "autopsy",
    "divided",
    "joined",
]
