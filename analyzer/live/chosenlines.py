"""Some columns of each frame, live: cells between tabs for people and `cut`, or objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from dissectors.maps import RegisterMap

from ..exports.chosen import FrameChoice
from ..exports.encoding import noise_json
from ..tables.findings import Finding
from ..tables.schema import Kind
from ..terminal_text import terminal_text
from .lines import ShownRow, dumped

if TYPE_CHECKING:
    from ..registers.watch import Revision


class ChosenLines:
    """A line a frame, with `noise` a line for bytes in none; what is said later, or of the bus, has no columns."""

    def __init__(self, fields: Sequence[str], *, text: bool, noise: bool) -> None:
        self._narrow, self._text, self._noise = FrameChoice(fields), text, noise

    def begins(self, t_ns: int) -> None:
        """From when the seconds count."""
        self._narrow.begins(t_ns)

    def use_charts(self, charts: Mapping[int, RegisterMap]) -> None:
        """Columns know no maps."""

    def of(self, shown: ShownRow) -> bytes:
        """The line of a row, or nothing."""
        noise = shown.values.kind == Kind.NOISE
        if shown.late or (noise and not self._noise):
            return b""
        line = noise_json(shown.batch, shown.row) if noise else shown.frame().to_json()
        chosen = self._narrow.of(line)
        return ("\t".join(map(_cell, chosen.values())) + "\n" if self._text else dumped(chosen)).encode()

    def bus(self, _: Finding) -> bytes:
        """Nothing."""
        return b""

    def register(self, _: Revision) -> bytes:
        """Nothing."""
        return b""


def _cell(value: Any) -> str:
    match value:
        case None:
            return ""
        case bool():
            return str(value).lower()
        case list():
            return ",".join(each["code"] if isinstance(each, dict) and "code" in each else str(each) for each in value)
    return terminal_text(str(value))
