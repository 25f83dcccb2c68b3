"""Two themes of the sixteen colours that every terminal has: each stands exactly on one of them."""

from __future__ import annotations

from typing import Final

from textual.theme import Theme

DARK_16: Final = Theme(
    name="rtuscope-dark-16",
    primary="#55ffff", secondary="#00aaaa", accent="#ffff55", foreground="#ffffff", background="#000000",
    surface="#000000", panel="#0000aa", success="#55ff55", warning="#ffff55", error="#ff5555", dark=True,
    variables={
        "quiet": "#aaaaaa", "rule": "#555555", "asks": "#55ffff", "answers": "#55ff55", "noise": "#ff55ff",
        "bad": "#ff5555", "warn": "#ffff55", "note": "#aaaaaa", "good": "#55ff55",
        "chosen": "#00aaaa", "chosen-text": "#000000", "chosen-away": "#555555",
        "lit": "#aa5500", "lit-text": "#ffffff",
        "tint-red": "#aa0000", "tint-yellow": "#aa5500", "tint-green": "#00aa00", "tint-blue": "#0000aa",
        "tint-violet": "#aa00aa", "footer-key-foreground": "#ffff55",
    },
)  # fmt: skip
LIGHT_16: Final = Theme(
    name="rtuscope-light-16",
    primary="#0000aa", secondary="#00aaaa", accent="#aa0000", foreground="#000000", background="#ffffff",
    surface="#ffffff", panel="#aaaaaa", success="#00aa00", warning="#aa5500", error="#aa0000", dark=False,
    variables={
        "quiet": "#555555", "rule": "#aaaaaa", "asks": "#0000aa", "answers": "#00aa00", "noise": "#aa00aa",
        "bad": "#aa0000", "warn": "#aa5500", "note": "#555555", "good": "#00aa00",
        "chosen": "#0000aa", "chosen-text": "#ffffff", "chosen-away": "#aaaaaa",
        "lit": "#ffff55", "lit-text": "#000000",
        "tint-red": "#ff5555", "tint-yellow": "#ffff55", "tint-green": "#55ff55", "tint-blue": "#55ffff",
        "tint-violet": "#ff55ff", "footer-key-foreground": "#aa0000",
    },
)  # fmt: skip
