"""Characters that an output's encoding lacks (POSIX's locale, a pipe in a Windows code page), as it can have them."""

from __future__ import annotations

import codecs
from typing import Final

TWINS: Final = "rtuscope-twins"
"""A handler of encoding errors: what looks the same or nearly so, else the escape."""

_LOOKS: Final = {
    "×": "x", "·": ".", "•": "*", "…": "...", "–": "-", "—": "-", "−": "-", "⁻": "-", "±": "+-", "≈": "~", "≤": "<=",
    "≥": ">=", "→": "->", "←": "<-", "↑": "^", "↓": "v", "▲": "^", "▴": "^", "▼": "v", "▾": "v", "⟨": "<", "⟩": ">",
    "«": '"', "»": '"', "“": '"', "”": '"', "‘": "'", "’": "'", "№": "No.", "✓": "+", "●": "*", "▪": "*", "€": "EUR",
    "µ": "u", "μ": "u", "Ω": "Ohm", "φ": "phi", "°": "deg", "º": "deg", "℃": "degC", "¹": "1", "²": "2", "³": "3",
    "\N{NO-BREAK SPACE}": " ", "\N{NARROW NO-BREAK SPACE}": " ", "─": "-", "━": "=", "│": "|", "┊": ":", "├": "+",
    "└": "+", "┌": "+", "┐": "+", "┘": "+", "┤": "+", "┬": "+", "┴": "+", "┼": "+", "╵": "|", "╷": "|", "█": "#",
    "░": ".", "▒": ":", **dict(zip("▁▂▃▄▅▆▇", "_.-=+*%", strict=True)),
}  # fmt: skip


def _twin(error: UnicodeError) -> tuple[str | bytes, int]:
    if isinstance(error, UnicodeEncodeError):
        twin = _LOOKS.get(error.object[error.start])
        if twin is not None:
            return twin, error.start + 1
        error = UnicodeEncodeError(error.encoding, error.object, error.start, error.start + 1, error.reason)
    return codecs.backslashreplace_errors(error)


codecs.register_error(TWINS, _twin)
