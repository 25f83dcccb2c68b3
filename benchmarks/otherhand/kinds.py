"""Kinds of buses of this hand: faults that have a word, some that have none, and buses that are well.

A module holds the kinds of one idea; what imports this one knows all of them.
"""

from . import answering, nameless, silent, taps, waiting, well, wires
from .sites import OTHER_KINDS, OtherKind, every, made

__all__ = ["OTHER_KINDS", "OtherKind", "every", "made"]

KINDS_OF = (silent, waiting, wires, answering, taps, nameless, well)  # by idea
