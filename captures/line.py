"""How the line was set: what a capture knows of the wire besides its bytes.

One mapping of keys serves every format that can carry it (the header line of serial-chunks, the metadata of MCAP), so
it is read and written here once. Keys that are not settings are kept as text, so that copying a capture loses nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

_BAUD_LIMIT = 100_000_000


@dataclass(frozen=True, slots=True)
class LineSettings:
    """Settings of the line and the tap; None where nobody said.

    `baud` in bit/s; `char_bits` start, data, parity and stop bits together (11 by the Modbus standard, 10 for 8N1);
    `parity` as "N", "E", "O", "M", "S"; `stop_bits` 1, 1.5 or 2; `tap` the kind of tap, in one word; `notes` all other
    things that a header said, as text (what was not text there, as its JSON).
    """

    baud: int | None = None
    char_bits: int | None = None
    parity: str | None = None
    stop_bits: float | None = None
    tap: str | None = None
    notes: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def from_header(cls, header: Mapping[str, object]) -> tuple[LineSettings, list[str]]:
        """Settings out of a header's keys, and a complaint for each setting with an impossible value.

        An impossible value becomes a note, like every key that is not a setting.
        """
        settings: dict[str, object] = {}
        notes: dict[str, str] = {}
        complaints: list[str] = []
        for key, value in header.items():
            if value is None:
                continue
            if key not in _RULES:
                notes[key] = _text(value)
            elif _RULES[key](value):
                settings[key] = value
            else:
                notes[key] = _text(value)
                complaints.append(f"{key} is {_text(value)[:40]}, which no line can have: not used")
        return cls(**settings, notes=notes), complaints  # type: ignore[arg-type]

    def to_header(self) -> dict[str, object]:
        """The keys that `from_header` reads, settings first, unknown ones left out."""
        header: dict[str, object] = {key: getattr(self, key) for key in _RULES if getattr(self, key) is not None}
        return {**header, **{key: value for key, value in self.notes.items() if key not in header}}


def _whole(value: object, low: int, high: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and low <= value <= high


_RULES = {
    "baud": lambda value: _whole(value, 1, _BAUD_LIMIT),
    "char_bits": lambda value: _whole(value, 7, 13),
    "parity": lambda value: value in ("N", "E", "O", "M", "S"),
    "stop_bits": lambda value: not isinstance(value, bool) and value in (1, 1.5, 2),
    "tap": lambda value: isinstance(value, str),
}


def _text(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
