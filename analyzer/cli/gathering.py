"""What the commands about registers begin with: a capture read through, its values and its units' words kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .inputs import tell_damage
from .terminal import Progress, interruptible, tell

if TYPE_CHECKING:
    from analyzer.options import Options
    from analyzer.registers.readings import RegisterReadings
    from analyzer.registers.recognition import UnitTexts
    from captures import Capture


@dataclass(frozen=True, slots=True)
class RegisterTraffic:
    """What the registers of a capture were, and what its units say of themselves."""

    readings: RegisterReadings
    texts: UnitTexts
    stopped: bool
    """By Ctrl-C: it is what was read until then, which was said."""

    @property
    def units(self) -> list[int]:
        """Those whose answers carry values, in order."""
        return sorted({block.unit for block in self.readings})


def gathered(
    capture: Capture, name: str, limits: Options, *, command: str = "registers", most: int | None = None
) -> RegisterTraffic:
    """Read a capture through; `most`: readings of a block that are kept, where it is not the usual number."""
    from analyzer.core import deframe
    from analyzer.registers.readings import RegisterReadings
    from analyzer.registers.recognition import UnitTexts

    readings = RegisterReadings() if most is None else RegisterReadings(most)
    texts, progress = UnitTexts(), Progress(f"{command} {name}")
    with interruptible() as stop:
        octets = 0
        for batch in deframe(capture, limits):
            readings.feed(batch)
            texts.feed(batch)
            octets += len(batch.data)
            progress(readings.frames, octets)
            if stop():
                break
    progress.clear()
    tell_damage(name, capture)
    if stop():
        tell("stopped by Ctrl-C; what was read until then was used")
    return RegisterTraffic(readings, texts, stop())
