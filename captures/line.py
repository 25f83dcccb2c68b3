"""How the line was set: what a capture knows of the wire besides its bytes.

One mapping of keys serves every format that can carry it (the header line of serial-chunks, the metadata of MCAP), so
it is read and written here once. Keys that are not settings are kept as text, so that copying a capture loses nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

DIRECTIONS_NOTE = "directions"  # in the notes of a line: the only direction of each port, in order: `request,response`
BY_MARKS = "marked"  # among these: a port that hears both, where marks say who asks (TX) and who answers
PROTOCOLS_NOTE = "protocols"  # in the notes of a line: what each port speaks, in order: `tcp,rtu`, where that is known
EXCERPT_NOTE = "excerpt"  # in the notes of a line: a text of a few reads, which may leave out what was on the bus
POLARITIES = ("normal", "inverted")  # of edges: a line that is high, or low, when idle
_BAUD_LIMIT = 100_000_000
_DATA_BITS = (5, 8)
_STANDARD_BITS = 11  # start, 8 data, parity, stop


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

    @property
    def character_ns(self) -> float | None:
        """Time of one character on the wire in ns; None unless both speed and character length are known."""
        return self.char_bits * 1e9 / self.baud if self.baud and self.char_bits else None

    @property
    def nominal_character_ns(self) -> float | None:
        """The same with the 11 bits of the standard ([2] 2.5.1) where nobody said how long a character is.

        For what needs a scale only; what is measured by characters (a load) asks `character_ns`. None without a speed.
        """
        return (self.char_bits or _STANDARD_BITS) * 1e9 / self.baud if self.baud else None

    @property
    def _stop(self) -> float:
        """Stop bits, one where nobody says."""
        return self.stop_bits or 1

    @property
    def data_bits(self) -> int | None:
        """Data bits of a character, where its length and parity say."""
        if self.char_bits is None or self.parity is None:
            return None
        data = self.char_bits - _character_bits(0, self.parity, self._stop)
        return data if _whole(data, *_DATA_BITS) else None

    @property
    def character_format(self) -> str | None:
        """Data bits, parity, stop bits as people write them: `8E1`; None unless parity and length are known."""
        return f"{self.data_bits}{self.parity}{self._stop:g}" if self.data_bits else None

    @classmethod
    def from_header(cls, header: Mapping[str, object]) -> tuple[LineSettings, list[str]]:
        """Settings out of a header's keys, and a complaint for each setting with an impossible value.

        An impossible value becomes a note, like every key that is not a setting. A character's length may be said in
        parts, as ports are set up: parity, data bits and stop bits, one where nobody says.
        """
        settings: dict[str, object] = {}
        notes: dict[str, str] = {}
        complaints: list[str] = []
        said: dict[str, Any] = dict(header)
        for name, ours in _OTHER_NAMES.items():
            if ours not in said and _IN_PARTS[ours](said.get(name)):  # else it is a note of that name
                said[ours] = said.pop(name)
        parts = {
            "data_bits": said.get("data_bits"),
            "parity": said.get("parity"),
            "stop_bits": said.get("stop_bits", 1),
        }
        if all(_IN_PARTS[name](value) for name, value in parts.items()):
            said.setdefault("char_bits", _character_bits(*parts.values()))
        for key, value in said.items():
            if value is None:
                continue
            if key not in _RULES:
                notes[key] = _note_text(value)
            elif _RULES[key](value):
                settings[key] = value
            else:
                notes[key] = _note_text(value)
                complaints.append(f"{key} is {_note_text(value)[:40]}, impossible for a line: ignored")
        return cls(**settings, notes=notes), complaints  # type: ignore[arg-type]

    def to_header(self) -> dict[str, object]:
        """The keys that `from_header` reads, settings first, unknown ones left out."""
        header: dict[str, object] = {key: getattr(self, key) for key in _RULES if getattr(self, key) is not None}
        return {**header, **{key: value for key, value in self.notes.items() if key not in header}}

    def with_settings(
        self,
        baud: int | None = None,
        parity: str | None = None,
        bits: int | None = None,
        stop: float | None = None,
    ) -> LineSettings:
        """The same line, set as somebody says who knows; None where they don't.

        `bits` are the data bits, 5 to 8. What they leave open of a character is as it was, else 8 data bits, no parity,
        one stop bit. ValueError for a setting that no line can have.
        """
        settings = {"baud": baud, "parity": parity, "stop_bits": stop}
        for name, value in settings.items():
            if value is not None and not _RULES[name](value):
                raise ValueError(f"{name.partition('_')[0]} {value!r} is impossible for a line")
        if bits is not None and not _whole(bits, *_DATA_BITS):
            raise ValueError(f"{bits!r} data bits are a setting that no line can have: 5 to 8")
        line = replace(self, baud=baud or self.baud, parity=parity or self.parity, stop_bits=stop or self.stop_bits)
        if (parity, bits, stop) == (None, None, None):
            return line
        data = bits or self.data_bits or 8
        return replace(line, char_bits=_character_bits(data, line.parity or "N", line._stop))


def _character_bits(data: int, parity: str, stop: float) -> int:
    """Bits of a character on the wire, its start bit too; half a stop bit counts as one."""
    return 1 + data + (parity != "N") + ceil(stop)


def _whole(value: object, low: int, high: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and low <= value <= high


_RULES = {
    "baud": lambda value: _whole(value, 1, _BAUD_LIMIT),
    "char_bits": lambda value: _whole(value, 7, 13),
    "parity": lambda value: value in ("N", "E", "O", "M", "S"),
    "stop_bits": lambda value: not isinstance(value, bool) and value in (1, 1.5, 2),
    "tap": lambda value: isinstance(value, str),
}
_IN_PARTS: Mapping[str, Callable[[Any], bool]] = {**_RULES, "data_bits": lambda value: _whole(value, *_DATA_BITS)}
_OTHER_NAMES = {"bits": "data_bits", "stop": "stop_bits", "baudrate": "baud"}  # by which loggers call them as well


def _note_text(value: object) -> str:
    if isinstance(value, str):
        return value
    import json  # rare, and `rtuscope parse` starts without

    return json.dumps(value, ensure_ascii=False)
