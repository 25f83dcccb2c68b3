"""What counts as right when registers are inferred, and how it is summed up.

A value of the truth counts where one of its words moved. It is right where the answer has its registers, integer or
float, and its word order. Second readings count for `first two`.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
from register_series import MadeDevice, number_of

from analyzer.registers.evidence import Weights
from analyzer.registers.hypotheses import HYPOTHESES
from analyzer.registers.runs import Cut, cut_of, run_posteriors, runs_of
from dissectors.maps.model import MapArea

COLUMNS = ("all", "16-bit", "float", "both words", "one word", "64-bit")


@dataclass(slots=True)
class Tally:
    """Values by kind: how many there were, how many right; confidences with whether they were right."""

    due: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    right: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    two: int = 0
    sure: list[tuple[float, bool]] = field(default_factory=list)
    misses: list[str] = field(default_factory=list)

    def add(self, kinds: list[str], right: bool, in_two: bool) -> None:
        for kind in kinds:
            self.due[kind] += 1
            self.right[kind] += right
        self.two += in_two

    def __str__(self) -> str:
        shares = [
            f"{kind} {self.right[kind] / self.due[kind]:.4f} ({self.due[kind]})" for kind in COLUMNS if self.due[kind]
        ]
        return (
            f"{'; '.join(shares)}; first two {self.two / max(self.due['all'], 1):.4f}; calibration {self.error():.4f}"
        )

    def error(self, bins: int = 10) -> float:
        """Expected calibration error over all answers that moved."""
        if not self.sure:
            return 0.0
        confidence, right = (np.array(column, float) for column in zip(*self.sure, strict=True))
        which = np.minimum((confidence * bins).astype(int), bins - 1)
        total = sum(
            abs(confidence[which == b].mean() - right[which == b].mean()) * (which == b).sum()
            for b in set(which.tolist())
        )
        return float(total / len(confidence))

    def calibration(self) -> str:
        confidence, right = (np.array(column, float) for column in zip(*self.sure, strict=True))
        lines = []
        for low in np.arange(0, 1, 0.1):
            here = (confidence >= low) & (confidence < low + 0.1 + (low > 0.85))
            if here.any():
                lines.append(f"  said {confidence[here].mean():.3f} right {right[here].mean():.3f} ({here.sum()})")
        return "\n".join(lines)


def tallied(device: MadeDevice, weights: Weights, tally: Tally) -> None:
    """Enter one device."""
    runs = runs_of(device.readings)
    answers: dict[tuple[MapArea, int], tuple[int, Cut]] = {}
    for run, posterior in zip(runs, run_posteriors(runs, weights), strict=True):
        for cut in cut_of(run, posterior) if run.unit == 1 else ():
            answers[run.area, run.address + cut.at] = (cut.number, cut)
    truths: dict[tuple[MapArea, int], int] = {}
    within: set[tuple[MapArea, int]] = set()  # registers of values that begin before them: no value of their own
    for area, address, quantity, rows in device.truth:
        block = next(b for b in device.readings if b.key == (1, area, address, quantity))
        words = block.series[0]
        moved = (words != words[0]).any(axis=0)
        for row in rows:
            number = number_of(row)
            if row.type == "text":
                continue
            truths[area, row.address] = number
            within.update((area, register) for register in range(row.address + 1, row.end))
            at = row.address - address
            mine = moved[at : at + row.length]
            if not mine.any():
                continue
            answer = answers.get((area, row.address))
            right = answer is not None and answer[0] == number
            in_two = right or any(
                second is not None
                and (a[1].run.area, a[1].run.address + second[0], second[1]) == (area, row.address, number)
                for a in answers.values()
                for second in [a[1].second]
            )
            tally.add(_kinds(row, mine), right, in_two)
            if not right:
                said = None if answer is None else HYPOTHESES[answer[0]]
                near = slice(max(0, at - 2), at + row.length + 2)
                tally.misses.append(
                    f"{device.name} {area} {row.address - address}/{quantity} {row.name}: {row.type} {row.order}"
                    f" moved {mine.astype(int)} said {said}"
                    f" {words[0, near]} {words[-1, near]}"
                )
    for (area, address), (number, cut) in answers.items():
        if cut.moved:
            alone = 0 if (area, address) not in within else None
            tally.sure.append((cut.confidence, truths.get((area, address), alone) == number))


def _kinds(row, mine) -> list[str]:
    kinds = ["all"]
    if row.length == 1:
        kinds.append("16-bit")
    elif row.is_float:
        kinds.append("float")
    elif row.length == 2:
        kinds.append("both words" if mine.all() else "one word")
    else:
        kinds.append("64-bit")
    return kinds
