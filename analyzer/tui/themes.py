"""Colours, dark and light. Nothing is told by colour alone; these only help the eye."""

from __future__ import annotations

from typing import Final

from textual.theme import Theme

DARK: Final = Theme(
    name="rtuscope-dark",
    primary="#5fafd7", secondary="#87afaf", accent="#ffaf5f", foreground="#d7dae0", background="#16191d",
    surface="#1d2126", panel="#272c33", success="#8fc87a", warning="#e5c07b", error="#ff7b72", dark=True,
    variables={
        "quiet": "#8b949e", "rule": "#3a414a", "asks": "#79c0ff", "answers": "#8fd694", "noise": "#a89cc8",
        "bad": "#ff7b72", "warn": "#e5c07b", "note": "#a5b4c8", "good": "#8fc87a",
        "chosen": "#2f5f8f", "chosen-text": "#ffffff", "chosen-away": "#2c333c",
        "lit": "#5c4a1e", "lit-text": "#ffe8b0",
        "footer-key-foreground": "#ffaf5f",
    },
)  # fmt: skip
LIGHT: Final = Theme(
    name="rtuscope-light",
    primary="#005f87", secondary="#44606e", accent="#8f4700", foreground="#1f2328", background="#ffffff",
    surface="#f3f4f6", panel="#e4e7eb", success="#1a7f37", warning="#7a5200", error="#b3261e", dark=False,
    variables={
        "quiet": "#59636e", "rule": "#c4cad1", "asks": "#0550ae", "answers": "#116329", "noise": "#6639ba",
        "bad": "#b3261e", "warn": "#7a5200", "note": "#4a5968", "good": "#1a7f37",
        "chosen": "#0a58a5", "chosen-text": "#ffffff", "chosen-away": "#d5dde6",
        "lit": "#ffe08a", "lit-text": "#3d2c00",
        "footer-key-foreground": "#8f4700",
    },
)  # fmt: skip
