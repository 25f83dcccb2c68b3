"""How sure a cause is, as people read it: in words, and by a figure where that is calibrated (docs/causes.md)."""

from __future__ import annotations

from typing import Final, Literal

from ..languages import page_words

CALIBRATED: Final = 0.95  # people read a figure from here on: what is less sure was not as often so as it said
_LIKELY: Final = 0.7

Words = Literal["certain", "most likely", "perhaps"]


def in_words(share: float) -> Words:
    """What certainty is called."""
    return "certain" if share >= CALIBRATED else "most likely" if share >= _LIKELY else "perhaps"


def how_sure(share: float) -> str:
    """The same in the language in use, with the figure where it is calibrated."""
    words = page_words(in_words(share))
    return page_words("{words} ({share:.0%})", words=words, share=share) if share >= CALIBRATED else words
